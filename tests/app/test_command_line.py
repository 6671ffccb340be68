"""The command line as a process: what it writes, what it says and how it ends."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app import cli

ROOT = Path(__file__).parents[2]
SIZE = (96, 64)


def start(*arguments, folder=None, **environment):
    variables = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}
    return subprocess.Popen(
        [sys.executable, "-m", "app.cli", *map(str, arguments)],
        cwd=folder or ROOT,
        env={**variables, "PYTHONPATH": str(ROOT), **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def run(*arguments, **keywords):
    process = start(*arguments, **keywords)
    output, complaints = process.communicate(timeout=120)
    return process.returncode, output, complaints


@pytest.fixture(scope="module")
def rendered(torus, tmp_path_factory):
    """One run of render with everything, its files and its statistics."""
    folder = tmp_path_factory.mktemp("rendered")
    png, npz = folder / "torus.png", folder / "torus.NPZ"
    line = ("render", torus, "--output", png, "--output", npz, "--resolution", "96,64", "--frames", "3", "--json")
    status, output, complaints = run(*line)
    assert (status, complaints) == (0, "")
    return png, npz, json.loads(output)


def test_statistics_are_all_that_is_on_standard_output(rendered):
    _, _, statistics = rendered
    promised = {
        "base_primitives", "nodes", "tiles", "tiles_cached", "tile_bytes", "splats", "triangles", "silhouette_splats",
        "visited_nodes", "load_s", "build_s", "bake_s", "select_ms", "draw_ms", "frame_ms", "gl_renderer",
        "peak_memory_mb",
    }  # fmt: skip
    assert promised <= statistics.keys()
    assert statistics["base_primitives"] == 48 * 24 * 2
    assert statistics["frames"] == 3
    assert 0 < statistics["select_ms"] < statistics["frame_ms"]
    assert statistics["silhouette_splats"] + statistics["silhouette_triangles"] > 0
    assert statistics["tiles"] > 0
    # Two bytes a texel, of which the smallest tiles have four, and four bytes more.
    assert (statistics["tile_bytes"] - 4 * statistics["tiles"]) % 8 == 0
    assert 12 * statistics["tiles"] <= statistics["tile_bytes"] < 2 * 16 * 16 * statistics["tiles"]


def test_arrays_are_as_promised(rendered):
    _, npz, _ = rendered
    arrays = np.load(npz)
    width, height = SIZE
    shapes = {
        "normal": (height, width, 3),
        "depth": (height, width),
        "coverage": (height, width),
        "color": (height, width, 4),
    }
    assert {name: arrays[name].shape for name in arrays} == shapes
    assert [arrays[name].dtype for name in shapes] == [np.float32, np.float32, np.float32, np.uint8]
    drawn = np.isfinite(arrays["depth"])
    assert 0.1 < drawn.mean() < 0.9
    # Seen along z, the hole of the torus is in the middle, and nothing is drawn there.
    assert not drawn[height // 2, width // 2]
    assert np.allclose(np.linalg.norm(arrays["normal"][drawn], axis=-1), 1.0, atol=1e-3)
    assert not arrays["normal"][~drawn].any()
    assert np.all(arrays["depth"][drawn] > 0.0)
    assert arrays["coverage"].min() >= 0.0
    assert arrays["coverage"].max() <= 1.0
    # What is seen faces the eye: file space is turned no other way than the camera.
    assert np.median(arrays["normal"][drawn][:, 2]) > 0.3


def test_row_0_is_at_the_top(torus, tmp_path):
    """Looked at from below its middle, the torus stands in the upper half of the picture."""
    npz = tmp_path / "high.npz"
    camera = ("--camera-position=0,-1,8", "--camera-focal-point=0,-1,0")
    status, *_ = run("render", torus, "--output", npz, "--resolution", "96,64", *camera)
    assert status == 0
    rows, _ = np.nonzero(np.isfinite(np.load(npz)["depth"]))
    assert rows.mean() < 28.0


def test_picture_is_the_color_array(rendered):
    png, npz, _ = rendered
    with Image.open(png) as image:
        assert np.array_equal(np.asarray(image), np.load(npz)["color"])


def test_built_in_model_without_normal_mapping(tmp_path):
    npz = tmp_path / "meteoroid.npz"
    status, output, complaints = run(
        "render", "--output", npz, "--resolution", "64,64", "--no-normal-mapping", "--json"
    )
    assert (status, complaints) == (0, "")
    assert json.loads(output)["tiles"] == 0
    assert np.isfinite(np.load(npz)["depth"][32, 32])


def render_statistics(*arguments, warning=""):
    status, output, complaints = run("render", *arguments, "--resolution", "256,256", "--json")
    assert status == 0
    assert complaints.count("\n") == bool(warning)
    assert warning in complaints
    return json.loads(output)


def test_what_was_drawn_with_is_told(rendered):
    _, _, statistics = rendered
    assert (statistics["r_sil"], statistics["r_inner"], statistics["w_s"]) == (2.0, 16.0, 16)
    assert statistics["coarseness"] == 1.0
    assert statistics["promised_degrees"] > 0.0
    assert statistics["promised_pixels"] >= 0.0


def test_error_goal_chooses_what_is_drawn_with(torus):
    strict = render_statistics(torus, "--max-error", "0.5,0.2", warning="can be promised in this view")
    lax = render_statistics(torus, "--max-error", "4,2")
    assert strict["promised_degrees"] < lax["promised_degrees"] <= 4.0
    assert strict["promised_pixels"] <= lax["promised_pixels"] <= 2.0
    assert strict["splats"] + strict["triangles"] > lax["splats"] + lax["triangles"]
    assert lax["w_s"] == lax["tile_texels"]


def test_rate_that_nothing_meets_draws_the_coarsest(torus):
    slow = render_statistics(torus, "--fps", "1")
    assert (slow["coarseness"], slow["r_inner"]) == (1.0, 16.0)
    fast = render_statistics(torus, "--fps", "1000", warning="1000 frames a second are not held")
    assert fast["coarseness"] > 4.0
    assert fast["r_sil"] == pytest.approx(2.0 * fast["coarseness"], rel=1e-3)
    assert fast["splats"] + fast["triangles"] < 0.5 * (slow["splats"] + slow["triangles"])


def test_ways_of_the_papers_draw_other_pictures(torus, tmp_path):
    ways = ((), ("--splat", "sprite"), ("--cone-test", "printed"))
    pictures = []
    for number, way in enumerate(ways):
        npz = tmp_path / f"{number}.npz"
        assert run("render", torus, "--output", npz, "--resolution", "96,64", *way)[0] == 0
        pictures.append(np.load(npz)["color"].astype(int))
    assert np.abs(pictures[0] - pictures[1]).max() > 0
    assert np.abs(pictures[0] - pictures[2]).max() > 0


def test_info_for_people_and_for_programs(torus):
    status, output, _ = run("info", torus, "--json", "--w-s", "4")
    described = json.loads(output)
    assert status == 0
    assert (described["kind"], described["triangles"], described["closed"]) == ("mesh", 2304, True)
    assert np.allclose(described["upper"], (1.3, 1.3, 0.3), atol=0.01)
    status, output, complaints = run("info", torus, "--points")
    assert (status, complaints) == (0, "")
    assert "2,304 triangles" in output
    assert "surfels" in output


def test_verbose_goes_to_standard_error(torus):
    status, output, complaints = run("info", torus, "--json", "--verbose")
    assert status == 0
    json.loads(output)
    assert "Building" in complaints


def test_no_display_gives_a_picture_and_its_name(torus, tmp_path):
    status, output, _ = run(torus, "--w-s", "2", "--resolution", "96,64", folder=tmp_path)
    assert status == 0
    (picture,) = tmp_path.glob("*.png")
    assert picture.name in output
    assert len(output.splitlines()) == 1
    with Image.open(picture) as image:
        assert image.size == SIZE


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="a display by its name is X's way")
def test_display_that_does_not_answer_is_no_display(torus, tmp_path):
    status, output, _ = run(torus, "--w-s", "2", "--resolution", "96,64", folder=tmp_path, DISPLAY=":987")
    assert status == 0
    assert "no display" in output
    assert len(list(tmp_path.glob("*.png"))) == 1


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("render {models}/missing.ply --output {folder}/a.png", "missing.ply"),
        ("render {models}/torus.ply --output {folder}/a.jpg", "a.jpg"),
        ("render {models}/torus.ply --output {folder}/nowhere/a.png", "nowhere"),
        ("render {models}/torus.ply --output {folder}", "neither"),
        ("render {models}/torus.ply --output {folder}/a.png --w-s 5", "--w-s"),
        (
            "render {models}/torus.ply --output {folder}/a.png --camera-position 0,0,1 --camera-focal-point 0,0,1",
            "same point",
        ),
        ("render {models}/torus.ply --output {folder}/a.png --max-error 1 --r-sil 2", "--max-error"),
        ("render --texture {models}/torus.ply --output {folder}/a.png", "texture"),
        ("info {folder}", "{folder_name}"),
        ("info {models}/torus.ply --nonsense", "--nonsense"),
    ],
)
def test_what_cannot_be_is_one_line_and_status_2(line, told, torus, tmp_path):
    arguments = [part.format(models=torus.parent, folder=tmp_path) for part in line.split()]
    status, output, complaints = run(*arguments)
    assert (status, output) == (2, "")
    assert complaints.startswith("surfelscope: ")
    assert len(complaints.splitlines()) == 1
    assert told.format(folder_name=tmp_path.name) in complaints
    assert list(tmp_path.iterdir()) == []


def test_full_disk_is_one_line_and_status_2(torus):
    if not Path("/dev/full").exists():
        pytest.skip("no /dev/full here")
    link = torus.parent / "full.png"
    link.unlink(missing_ok=True)
    link.symlink_to("/dev/full")
    status, _, complaints = run("render", torus, "--w-s", "2", "--resolution", "96,64", "--output", link)
    assert status == 2
    assert len(complaints.splitlines()) == 1
    assert "full.png" in complaints


@pytest.mark.parametrize("options", [[], ["--verbose"]])
def test_defect_is_one_line_with_a_status_of_its_own(options, monkeypatch, capsys):
    def fail(_):
        raise ZeroDivisionError("by\nzero")

    monkeypatch.setattr("app.info_command.run_info", fail)
    assert cli.main(["info", *options]) == 70
    complaints = capsys.readouterr().err
    assert "please report it: ZeroDivisionError: by zero (--verbose shows where)" in complaints.splitlines()[-1]
    assert ("Traceback" in complaints) == bool(options)
    assert bool(options) or complaints.count("\n") == 1


def test_interrupt_is_quiet():
    process = start("render", "--json", "--frames", "100000", "--verbose")
    assert process.stderr is not None
    for line in process.stderr:
        if "Drawing" in line:
            break
    time.sleep(0.2)
    process.send_signal(signal.SIGINT)
    output, complaints = process.communicate(timeout=30)
    assert process.returncode == 130
    assert output == ""
    assert "Traceback" not in complaints
