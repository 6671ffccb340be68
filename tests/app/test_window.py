"""The real window on a virtual screen, driven with a real mouse and keyboard and looked at in screenshots."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageGrab
from window_driver import MIDDLE, PANEL_WIDTH, PICTURE, WINDOW, Frame, Window, virtual_screen, why_not

pytestmark = pytest.mark.skipif(bool(why_not()), reason=why_not() or "none")


@pytest.fixture(scope="module")
def display():
    with virtual_screen() as name:
        yield name


def covered(window: np.ndarray) -> np.ndarray:
    """Tell where the model is, bool (720, 644): the background is the same along a row."""
    picture = window[PICTURE]
    return np.abs(picture - picture[:, :1]).max(axis=-1) > 12


def centre(mask: np.ndarray) -> np.ndarray:
    return np.argwhere(mask).mean(axis=0)[::-1]


def changed(one: np.ndarray, other: np.ndarray) -> float:
    """Return the share of the picture's pixels that differ."""
    return float((np.abs(one[PICTURE] - other[PICTURE]).max(axis=-1) > 12).mean())


@pytest.fixture(scope="module")
def models(tmp_path_factory, write_torus):
    folder = tmp_path_factory.mktemp("window")
    write_torus(folder / "torus.ply", rings=360, sides=120, bumps=0.02)
    write_torus(folder / "coarse.ply", rings=24, sides=12)
    (folder / "broken.ply").write_text("ply\nformat ascii 1.0\n")
    return folder


@pytest.fixture(scope="module")
def shared_window(display, models):
    window = Window(display, models, "torus.ply")
    # The picture without tiles, and with them.
    window.wait_until_idle(lines=1, frames=2)
    yield window
    window.close()


@pytest.fixture
def window(shared_window):
    shared_window.home()
    return shared_window


def test_model_and_panel_are_there(window):
    screen = window.look()
    # A torus seen along its axis: the ring is drawn, its hole and the corners are not.
    mask = covered(screen)
    assert not mask[MIDDLE[1], MIDDLE[0]]
    assert not mask[:40, :40].any()
    assert 0.2 < mask.mean() < 0.6
    assert np.allclose(centre(mask), MIDDLE, atol=8)
    panel = screen[:, PICTURE[1].stop :]
    # Bright letters on a dark ground.
    assert np.median(panel) < 40
    assert (panel.min(axis=-1) > 200).sum() > 500


def test_still_picture_is_not_drawn_again(window):
    def cpu_seconds() -> float:
        fields = Path(f"/proc/{window.process.pid}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    frames, cpu = len(window.frames), cpu_seconds()
    time.sleep(1.5)
    assert len(window.frames) == frames
    assert cpu_seconds() - cpu < 0.15


def test_moving_the_mouse_draws_only_the_panel(window):
    frames = len(window.frames)
    window.do("mousemove", 300, 300, "mousemove", 400, 350, "mousemove", WINDOW[0] - 100, 200, draws=False)
    assert len(window.frames) == frames


def test_help_comes_and_goes(window):
    before = window.look()
    window.do("key", "h", draws=False)
    shown = window.look()
    assert changed(before, shown) > 0.05
    window.do("key", "Escape", draws=False)
    assert changed(before, window.look()) == 0.0


def test_left_button_orbits(window):
    before = window.look()
    window.drag(MIDDLE, (MIDDLE[0] + 150, MIDDLE[1] + 60))
    after = window.look()
    assert changed(before, after) > 0.05
    # It turns around its middle, where the hole is.
    assert not covered(after)[MIDDLE[1], MIDDLE[0]]


@pytest.mark.parametrize("with_shift", [True, False])
def test_pan_moves_the_model_with_the_cursor(window, with_shift):
    # Farther away, so that nothing is pushed over the edge.
    window.do("click", 5, "sleep", 0.1, "click", 5)
    before = centre(covered(window.look()))
    if with_shift:
        window.do("keydown", "shift", draws=False)
    window.drag(MIDDLE, (MIDDLE[0] + 60, MIDDLE[1] - 40), button=1 if with_shift else 2)
    if with_shift:
        window.do("keyup", "shift", draws=False)
    assert np.allclose(centre(covered(window.look())) - before, (60, -40), atol=2)


def test_wheel_zooms_towards_the_cursor(window):
    before = covered(window.look())
    rows, columns = np.nonzero(before)
    left = (int(columns.min()), int(rows[columns.argmin()]))
    window.do("mousemove", left[0] + 3, left[1], "click", 4, "sleep", 0.1, "click", 4)
    after = covered(window.look())
    assert after.sum() > 1.15 * before.sum()
    # What was under the cursor, the leftmost point of the ring, is still there.
    assert np.nonzero(after)[1].min() == pytest.approx(left[0], abs=4)
    window.do("click", 5, "sleep", 0.1, "click", 5)
    assert covered(window.look()).sum() == pytest.approx(before.sum(), rel=0.02)


def test_double_click_brings_a_point_of_the_surface_into_the_middle(window):
    mask = covered(window.look())
    row = MIDDLE[1]
    ring = int(np.nonzero(mask[row])[0][:60].mean())
    window.do("mousemove", ring, row, "click", "--repeat", 2, "--delay", 60, 1)
    after = covered(window.look())
    assert after[MIDDLE[1], MIDDLE[0]]
    assert centre(after)[0] > MIDDLE[0] + 100


def test_axis_views(window):
    front = covered(window.look())
    window.do("key", "3")
    side = covered(window.look())
    # From the side a torus around z is a flat bar, and higher than wide.
    rows, columns = np.nonzero(side)
    assert np.ptp(rows) > 2.5 * np.ptp(columns)
    window.do("key", "7")
    rows, columns = np.nonzero(covered(window.look()))
    assert np.ptp(columns) > 2.5 * np.ptp(rows)
    window.do("key", "1")
    assert (covered(window.look()) != front).mean() < 0.01


# Rows of the panel's sliders, and where the box of a toggle is.
R_SIL, R_INNER, W_S = 130, 156, 182
NORMAL_MAPPING = (WINDOW[0] - PANEL_WIDTH + 26, 292)
ORTHOGRAPHIC = (NORMAL_MAPPING[0], 370)
ERROR_GOAL, RATE_GOAL = (WINDOW[0] - PANEL_WIDTH + 26, 208), (WINDOW[0] - PANEL_WIDTH + 26, 234)


def click_slider(window: Window, row: int, share: float) -> Frame:
    """Click into a slider of the panel at a share of its length."""
    left, right = WINDOW[0] - PANEL_WIDTH + 100, WINDOW[0] - 90
    return window.do("mousemove", round(left + share * (right - left)), row, "click", 1, "mousemove", *MIDDLE)


def type_into_slider(window: Window, row: int, value: str) -> Frame:
    """Give a slider an exact value."""
    ctrl_click = ("mousemove", WINDOW[0] - 160, row, "keydown", "ctrl", "click", 1, "sleep", 0.1, "keyup", "ctrl")
    window.do(*ctrl_click, "sleep", 0.1, "key", "ctrl+a", "type", value, draws=False)
    return window.do("key", "Return", "mousemove", *MIDDLE)


def test_sliders_change_the_cut(window):
    start = window.frames[-1]
    coarse = click_slider(window, R_SIL, 0.9)
    assert coarse.primitives < 0.9 * start.primitives
    fine = click_slider(window, R_INNER, 0.04)
    assert fine.primitives > 2.0 * coarse.primitives
    type_into_slider(window, R_INNER, "16")
    assert type_into_slider(window, R_SIL, "2") == start


def test_normal_mapping_by_mouse_and_key(window):
    with_tiles, frame = window.look(), window.frames[-1]
    unmapped = window.do("mousemove", *NORMAL_MAPPING, "click", 1)
    without = window.look()
    assert unmapped == frame
    assert changed(with_tiles, without) > 0.002
    window.do("mousemove", *MIDDLE, "key", "n")
    assert changed(with_tiles, window.look()) == 0.0


def test_projection_by_key_and_mouse(window):
    perspective, frame = window.look(), window.frames[-1]
    window.do("key", "5")
    parallel = window.look()
    assert changed(perspective, parallel) > 0.01
    # Zoom and drag, and look from the front again.
    assert window.do("mousemove", *MIDDLE, "click", 4) != frame
    window.do("click", 5, "key", "Home")
    assert changed(parallel, window.look()) > 0.0
    # The key must not overtake the frame in which the panel sees the click.
    window.do("mousemove", *ORTHOGRAPHIC, "click", 1, "mousemove", *MIDDLE)
    window.do("key", "Home")
    assert window.frames[-1] == frame
    assert changed(perspective, window.look()) == 0.0


def test_overlays_change_the_picture_and_not_the_cut(window):
    plain, frame = window.look(), window.frames[-1]
    for key in ("e", "b", "l"):
        assert window.do("key", key) == frame
        assert changed(plain, window.look()) > 0.002, key
        window.do("key", key)
        assert changed(plain, window.look()) == 0.0, key


def test_w_s_bakes_in_the_background(window):
    before = window.look()
    # From 16 to 2 texels and back; each ends with a frame of its own.
    click_slider(window, W_S, 0.0)
    assert changed(before, window.look()) > 0.0
    click_slider(window, W_S, 0.75)
    assert changed(before, window.look()) == 0.0


def test_rate_is_held_while_moving_and_detail_returns_at_rest(window):
    """At 30 frames a second or whatever this machine makes of it: what moves is coarser than what rests."""
    before = window.frames[-1]
    # The slider's right end: 120 frames a second.
    window.do("mousemove", *RATE_GOAL, "click", 1, draws=False)
    window.do("mousemove", WINDOW[0] - 32, RATE_GOAL[1], "click", 1, "mousemove", *MIDDLE, draws=False)
    still = len(window.frames)
    turns = ("mousemove_relative", "--", 4, 0, "sleep", 0.03, "mousemove_relative", "--", -4, 0, "sleep", 0.03)
    last = window.do("mousedown", 1, *(turns * 25), "mouseup", 1)
    moving = [frame.primitives for frame in window.frames[still:]]
    assert min(moving) < 0.5 * before.primitives
    # At last there is nothing left to do, and what is seen is what was seen before.
    assert last == before
    assert moving[-1] == before.primitives
    # It comes back step by step: some frames lie between.
    coarsest = len(moving) - 1 - moving[::-1].index(min(moving[-8:]))
    assert moving[coarsest:] == sorted(moving[coarsest:])
    assert len(moving) - coarsest >= 3
    window.do("mousemove", *RATE_GOAL, "click", 1, "mousemove", *MIDDLE, draws=False)


def test_error_goal_takes_over_the_sliders(window):
    before = window.frames[-1]
    limited = window.do("mousemove", *ERROR_GOAL, "click", 1, "mousemove", *MIDDLE)
    assert limited != before
    # They do not answer as long as it holds.
    click_r_inner = ("mousemove", WINDOW[0] - 100, R_INNER, "click", 1, "mousemove", *MIDDLE)
    frames = len(window.frames)
    window.do(*click_r_inner, draws=False)
    assert len(window.frames) == frames
    assert window.do("mousemove", *ERROR_GOAL, "click", 1, "mousemove", *MIDDLE) == before


def test_screenshot_is_what_the_window_shows(window, models):
    shown = window.look()
    window.do("key", "s", draws=False)
    (path,) = models.glob("surfelscope-*.png")
    assert re.fullmatch(r"surfelscope-\d{8}-\d{6}\.png", path.name)
    with Image.open(path) as image:
        saved = np.asarray(image.convert("RGB")).astype(int)
    assert np.array_equal(saved, shown[PICTURE])
    path.unlink()


def test_panel_can_be_hidden(window):
    window.do("key", "Tab")
    wide = window.look()
    # The background goes to the right edge.
    assert np.abs(wide[:, -1] - wide[:, 0]).max() <= 12
    window.do("key", "Tab")


def test_bad_file_is_a_message_and_good_one_opens(window):
    before = window.look()
    frames = len(window.frames)
    window.do("key", "ctrl+o", "sleep", 0.3, "type", "broken.ply", draws=False)
    window.do("key", "Return", "sleep", 0.5, draws=False)
    after = window.look()
    # Only the message in the corner is new; the model that was open is still there.
    assert len(window.frames) == frames
    difference = np.argwhere(np.abs(before - after)[PICTURE].max(axis=-1) > 12)
    assert len(difference)
    assert difference.max(axis=0)[0] < 150
    window.do("key", "ctrl+o", "sleep", 0.3, "type", "coarse.ply", draws=False)
    coarse = window.do("key", "Return")
    assert coarse.primitives <= 24 * 12 * 2


def test_dropped_file_opens(window, models):
    if window.frames[-1].primitives <= 24 * 12 * 2:
        window.do("key", "ctrl+o", "sleep", 0.3, "type", "torus.ply", draws=False)
        window.do("key", "Return")
    before = len(window.frames)
    drop = [
        sys.executable,
        str(Path(__file__).with_name("drop_file.py")),
        window.identity(),
        str(models / "coarse.ply"),
    ]
    subprocess.run(drop, env=window.environment, check=True)
    window.wait_until_idle(lines=1, frames=before + 1)
    assert window.frames[-1].primitives <= 24 * 12 * 2


def test_file_dialog_of_the_system(display, models, tmp_path):
    """Where there is a program for dialogs, it is asked; this one always answers with the same file."""
    dialog = tmp_path / "zenity"
    dialog.write_text(f"#!/bin/sh\necho {models / 'torus.ply'}\n")
    dialog.chmod(0o755)
    window = Window(display, models, "coarse.ply", PATH=f"{tmp_path}:{os.environ['PATH']}")
    try:
        window.wait_until_idle(lines=1, frames=1)
        assert window.do("mousemove", *MIDDLE, "key", "ctrl+o").primitives > 24 * 12 * 2
        assert window.complaints == []
    finally:
        window.close()


def test_window_can_be_resized_and_closed(display, models):
    window = Window(display, models, "coarse.ply")
    try:
        window.wait_until_idle(lines=1, frames=1)
        window.do("windowsize", window.identity(), 1200, 600)
        picture = np.asarray(ImageGrab.grab((0, 0, 1200, 600), xdisplay=display).convert("RGB")).astype(int)
        ring = np.abs(picture[:, : 1200 - PANEL_WIDTH] - picture[:, :1]).max(axis=-1) > 12
        assert np.allclose(centre(ring), ((1200 - PANEL_WIDTH) / 2, 300), atol=8)
        subprocess.run(["xdotool", "mousemove", "200", "200", "key", "ctrl+q"], env=window.environment, check=True)
        assert window.process.wait(10.0) == 0
        assert window.complaints == []
    finally:
        window.close()


def test_interrupt_ends_the_window_quietly(display, models):
    window = Window(display, models, "coarse.ply")
    try:
        window.wait_until_idle(lines=1, frames=1)
        window.process.send_signal(signal.SIGINT)
        assert window.process.wait(10.0) == 130
        time.sleep(0.1)
        assert window.complaints == []
    finally:
        window.close()
