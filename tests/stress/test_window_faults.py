"""A window that is killed, closed, resized and fed badly at any moment. The real ones run in the whole share only."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from ledger import Ledger
from PIL import ImageGrab
from window_driver import SCREEN, why_not

from app.errors import GraphicsError
from app.options import Options
from app.viewer import Viewer
from app.viewport import Viewport
from hierarchy.model import ModelError
from renderer.context import ContextError, create_headless_context

SIZE = (320, 240)
HERE = Path(__file__).parents[2]
PATIENCE = 60.0


class RustPanic(BaseException):
    """What a reader in Rust panics with is no Exception."""


def write_sphere(path: Path, rows: int = 24) -> Path:
    """Write a closed sphere as text."""
    u, v = np.meshgrid(np.arange(2 * rows) * np.pi / rows, (np.arange(rows) + 0.5) * np.pi / rows, indexing="ij")
    points = np.stack([np.sin(v) * np.cos(u), np.cos(v), np.sin(v) * np.sin(u)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(2 * rows), np.arange(rows - 1), indexing="ij")
    a, b = i * rows + j + 1, (i + 1) % (2 * rows) * rows + j + 1
    quads = np.stack([a, b, b + 1, a + 1], axis=-1).reshape(-1, 4)
    caps = [[k * rows + 1 for k in range(2 * rows)], [(k + 1) * rows for k in range(2 * rows)][::-1]]
    lines = [f"v {x} {y} {z}" for x, y, z in points] + ["f " + " ".join(map(str, q)) for q in [*quads.tolist(), *caps]]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("faults")
    write_sphere(made / "sphere.obj")
    write_sphere(made / "other.obj", 16)
    (made / "broken.ply").write_text("ply\nformat ascii 1.0\n")
    return made


@pytest.fixture(scope="module")
def fine(folder: Path) -> Path:
    """A model that takes seconds to load, to build and to bake."""
    return write_sphere(folder / "fine.obj", 250)


def settle(viewer: Viewer) -> None:
    viewer.poll(SIZE)
    end = time.monotonic() + PATIENCE
    while viewer.task is not None:
        assert time.monotonic() < end
        viewer.poll(SIZE)
        time.sleep(0.002)


@pytest.fixture
def viewer(folder: Path) -> Iterator[Viewer]:
    made = Viewer(Options(model=folder / "sphere.obj", texels=2), lambda: None, lambda scene: None)
    settle(made)
    yield made
    made.close()


def test_a_bad_file_dropped_50_times_is_one_message_that_stays(viewer: Viewer, folder: Path) -> None:
    scene = viewer.scene
    for _ in range(50):
        viewer.open_path(folder / "broken.ply")
    settle(viewer)
    viewer.state.drop_old_messages(time.monotonic() + 1e6)
    (message,) = viewer.state.messages
    assert message.is_error
    assert "broken.ply" in message.text
    assert viewer.scene is scene
    # A model that opens takes it away.
    viewer.open_path(folder / "sphere.obj")
    settle(viewer)
    assert not any(message.is_error for message in viewer.state.messages)


ERRORS = (MemoryError, RustPanic, SystemError, RuntimeError, ZeroDivisionError, OSError, ModelError)
STAGES = {
    "load": "hierarchy.load.load_model",
    "build": "hierarchy.build.build_hierarchy",
    "prepare": "hierarchy.lod.select_cut",
}


def test_whatever_the_work_raises_is_a_message_and_the_old_model_stays(
    viewer: Viewer, folder: Path, monkeypatch: pytest.MonkeyPatch, ledger: Ledger, amount: Callable[[int, int], int]
) -> None:
    bad, cases = [], 0
    scene = viewer.scene
    for name, function in STAGES.items():
        for error in ERRORS[: amount(2, len(ERRORS))]:
            cases += 1

            def fail(*_: object, error: type[BaseException] = error, **__: object) -> None:
                raise error("first line\nsecond line")

            with monkeypatch.context() as patch:
                patch.setattr(function, fail)
                viewer.open_path(folder / "other.obj")
                settle(viewer)
            texts = [message.text for message in viewer.state.messages if message.is_error]
            if viewer.scene is not scene or len(texts) != 1 or "\n" in texts[0]:
                bad.append((name, error, texts))
            viewer.state.dismiss_error()
    assert not bad
    ledger.record(
        "faults", "work behind the window fails", "every stage by lack of memory, panic and surprise", cases=cases,
        worst=len(bad), bound=0, unit="bad ends",
    )  # fmt: skip


def draw_with_all_tiles(viewport: Viewport, viewer: Viewer) -> None:
    while viewport.draw(viewer).missing:
        time.sleep(0.01)


def test_the_last_good_picture_stays_where_the_next_cannot_be_drawn(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    try:
        ctx = create_headless_context()
    except ContextError as error:
        pytest.skip(str(error))
    with ctx:
        viewport = Viewport(ctx, lambda: None)
        viewport.size = SIZE
        viewer = Viewer(Options(model=folder / "sphere.obj", texels=2), lambda: None, viewport.upload)
        settle(viewer)
        draw_with_all_tiles(viewport, viewer)
        before = viewport.picture()
        assert before is not None
        with monkeypatch.context() as patch:
            patch.setattr("renderer.allocation._read_errors", lambda ctx: ["GL_OUT_OF_MEMORY"])
            for size in ((500, 400), (1, 1), (8192, 8192)):
                viewport.size = size
                assert viewport.is_stale(viewer)
                with pytest.raises(GraphicsError, match="does not hold a picture"):
                    viewport.draw(viewer)
                # It is not tried again and again.
                assert not viewport.is_stale(viewer)
                assert np.array_equal(viewport.picture(), before)
            # A model that does not fit leaves the old one there.
            viewer.open_path(folder / "other.obj")
            settle(viewer)
            assert "does not hold the model" in viewer.state.messages[0].text
        viewport.size = SIZE
        draw_with_all_tiles(viewport, viewer)
        assert np.array_equal(viewport.picture(), before)
        viewer.close()
        viewport.release()
    ctx.release()


# The real window.


class Program:
    """A program with a window, on a display of its own that can be killed."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        reader, writer = os.pipe()
        screen = "{}x{}x24".format(*SCREEN)
        self.server = subprocess.Popen(
            ["Xvfb", "-displayfd", str(writer), "-screen", "0", screen, "-nolisten", "tcp"],
            pass_fds=[writer],
            stderr=subprocess.DEVNULL,
        )
        os.close(writer)
        with os.fdopen(reader) as number:
            display = f":{number.readline().strip()}"
        self.environment = {**os.environ, "DISPLAY": display, "PYTHONPATH": str(HERE)}
        self.process = subprocess.Popen(
            [sys.executable, "-m", "app.cli", *arguments],
            cwd=folder, env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip

    def __enter__(self) -> Program:
        return self

    def __exit__(self, *_: object) -> None:
        for each in (self.process, self.server):
            each.kill()
            each.wait()
        for pipe in (self.process.stdout, self.process.stderr):
            assert pipe is not None
            pipe.close()

    def xdotool(self, *arguments: object) -> str:
        command = ["xdotool", *map(str, arguments)]
        return subprocess.run(command, check=False, env=self.environment, capture_output=True, text=True).stdout

    def wait_for_window(self) -> str:
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            found = self.xdotool("search", "--onlyvisible", "--name", "Surfelscope").split()
            if found:
                return found[-1]
            time.sleep(0.05)
        raise AssertionError("no window")

    def wait_for_start(self) -> None:
        """Wait until the program handles signals: its thread for interrupts is there."""
        tasks, end = Path(f"/proc/{self.process.pid}/task"), time.monotonic() + PATIENCE
        while len(list(tasks.iterdir())) < 2:
            assert time.monotonic() < end
            time.sleep(0.005)

    def wait_for_rest(self) -> None:
        """Wait until the program has done all it can: for two seconds it takes no time of any core."""
        ticks = []
        for _ in range(round(5 * PATIENCE)):
            fields = Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(")", 1)[-1].split()
            if fields[0] == "Z":
                return
            ticks.append(int(fields[11]) + int(fields[12]))
            # A glance at the clock may take a tick.
            if len(ticks) > 2 and ticks[-1] - ticks[-3] <= 1:
                return
            time.sleep(1.0)
        raise AssertionError("never at rest")

    def drop(self, file: Path) -> None:
        # The window may have gone.
        helper = Path(__file__).parents[1] / "app" / "drop_file.py"
        command = [sys.executable, str(helper), self.wait_for_window(), str(file)]
        subprocess.run(command, check=False, env=self.environment)

    def end(self, patience: float) -> tuple[int | None, str]:
        """Return the status and what was said on standard error; None where it did not end by itself."""
        try:
            _, said = self.process.communicate(timeout=patience)
            return self.process.returncode, said
        except subprocess.TimeoutExpired:
            self.process.kill()
            return None, self.process.communicate()[1]


only_whole = pytest.mark.skipif("not config.getoption('--stress')")
needs_screen = pytest.mark.skipif(bool(why_not()), reason=why_not() or "none")

# How long anything may take to end, on a machine that does other things besides (seconds).
PROMPT = 15.0

GONE = (2, "surfelscope: the display has gone\n")


def kill_display(program: Program) -> tuple[int | None, str]:
    program.wait_for_window()
    program.server.kill()
    return GONE


def close_by_key(program: Program) -> tuple[int | None, str]:
    # Without a window manager the keys go to where the cursor is.
    program.wait_for_window()
    program.xdotool("mousemove", 200, 200, "key", "ctrl+q")
    return 0, ""


def close_by_manager(program: Program) -> tuple[int | None, str]:
    helper = Path(__file__).with_name("close_window.py")
    subprocess.run([sys.executable, str(helper), program.wait_for_window()], env=program.environment, check=False)
    return 0, ""


def interrupt(program: Program) -> tuple[int | None, str]:
    program.process.send_signal(signal.SIGINT)
    return 130, ""


def terminate(program: Program) -> tuple[int | None, str]:
    program.process.send_signal(signal.SIGTERM)
    return -signal.SIGTERM, ""


@needs_screen
@only_whole
@pytest.mark.parametrize("how", [kill_display, close_by_key, close_by_manager, interrupt, terminate])
def test_the_window_ends_at_any_moment(
    folder: Path, fine: Path, ledger: Ledger, how: Callable[[Program], tuple[int | None, str]]
) -> None:
    """While it starts, loads, builds, bakes and rests."""
    bad, delays = [], (0.0, 0.5, 1.5, 3.0, 6.0)
    for delay in delays:
        with Program(folder, fine.name, "--w-s", "32", "--no-cache") as program:
            program.wait_for_start()
            if how in (kill_display, close_by_key, close_by_manager):
                program.wait_for_window()
            time.sleep(delay)
            expected = how(program)
            ended = program.end(PROMPT)
        if ended != expected:
            bad.append((delay, ended))
    assert not bad
    ledger.record(
        "faults", f"the window: {how.__name__.replace('_', ' ')}", "at moments from the start to rest",
        cases=len(delays), worst=len(bad), bound=0, unit="bad ends",
    )  # fmt: skip


@needs_screen
@only_whole
def test_a_bad_file_on_the_command_line_is_said_in_the_window_for_as_long_as_it_takes(folder: Path) -> None:
    with Program(folder, "broken.ply", "--resolution", "900,600") as program:
        program.wait_for_window()
        time.sleep(15.0)
        screen = ImageGrab.grab((0, 0, 500, 120), xdisplay=program.environment["DISPLAY"])
    # Bright letters in the corner of an empty picture, without a move of the mouse.
    assert (np.asarray(screen.convert("L")) > 180).sum() > 50


@needs_screen
@only_whole
def test_any_size_of_the_window(folder: Path, ledger: Ledger) -> None:
    sizes = [(1, 1), (1, 4000), (4000, 1), (316, 50), (317, 2), (3000, 3000), (8192, 8192), (1, 1), (960, 720)]
    storm = [(100 + 37 * k % 900, 50 + 53 * k % 700) for k in range(60)]
    with Program(folder, "sphere.obj") as program:
        window = program.wait_for_window()
        time.sleep(2.0)
        for size in sizes:
            program.xdotool("windowsize", window, *size)
            time.sleep(0.5)
        for size in storm:
            program.xdotool("windowsize", window, *size)
        for command in ("windowunmap", "windowmap", "windowminimize", "windowmap"):
            program.xdotool(command, window)
            time.sleep(0.3)
        running = program.process.poll() is None
        close_by_manager(program)
        ended = program.end(2 * PATIENCE)
    assert running, ended
    assert ended == (0, "")
    ledger.record(
        "faults", "the window: sizes", "1 x 1 to 8192 x 8192, a storm of sizes, hidden and shown",
        cases=len(sizes) + len(storm) + 4, worst=0, bound=0, unit="bad ends",
    )  # fmt: skip


@needs_screen
@only_whole
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="prlimit is Linux's")
def test_a_model_too_large_for_the_memory_leaves_the_old_one_there(
    folder: Path, fine: Path, ledger: Ledger, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    import resource

    # Once without a limit: LLVM ends the process where it lacks memory to compile a kernel, and nobody can stop it.
    with Program(folder, "sphere.obj") as program:
        program.wait_for_window()
        program.wait_for_rest()
        program.drop(fine)
        program.wait_for_rest()
    bad, margins = [], (40, 150)
    for megabytes in margins:
        monkeypatch.setenv("SURFELSCOPE_CACHE", str(tmp_path / str(megabytes)))
        with Program(folder, "sphere.obj") as program:
            program.wait_for_window()
            program.wait_for_rest()
            pages = int(Path(f"/proc/{program.process.pid}/statm").read_text().split()[0])
            most = pages * os.sysconf("SC_PAGE_SIZE") + megabytes * 1_000_000
            resource.prlimit(program.process.pid, resource.RLIMIT_AS, (most, most))
            program.drop(fine)
            program.wait_for_rest()
            alive = program.process.poll() is None
            close_by_manager(program)
            status, said = program.end(PROMPT)
        if not alive or status != 0 or "Traceback" in said:
            bad.append((megabytes, alive, status, said[-300:]))
    ledger.record(
        "faults", "the window: little memory", "another model with 40 or 150 MB left", cases=len(margins),
        worst=len(bad), bound=0, unit="bad ends",
    )  # fmt: skip
    assert not bad
