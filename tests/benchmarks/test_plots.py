"""Every plot is drawn from a run, says what the run says, and is the same each time."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from synthetic_run import synthetic_run

from benchmarks.findings import main_model, points_of
from benchmarks.run_file import Run

pytest.importorskip("matplotlib")

from matplotlib.figure import Figure

from benchmarks import plots
from benchmarks.heat_map import draw_heat_map


@pytest.fixture(scope="module")
def run() -> Run:
    return synthetic_run()


@pytest.fixture(scope="module")
def drawn(run: Run, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return plots.draw_plots(run, tmp_path_factory.mktemp("plots") / "deep" / "er")


def texts(axes) -> list[str]:
    return [text.get_text() for text in axes.texts]


def test_all_plots_are_drawn_small_and_without_a_date(drawn):
    names = {path.name for path in drawn}
    assert names == {
        "error-over-time.svg", "error-over-splats.svg", "error-over-tile-bytes.svg",
        "displacement-over-primitives.svg", "time-over-size.svg",
    }  # fmt: skip
    for path in drawn:
        text = path.read_text("utf-8")
        assert text.startswith("<?xml")
        assert "<dc:date>" not in text
        assert len(text) < 200_000


def test_the_same_run_gives_the_same_file(run, drawn, tmp_path):
    again = plots.draw_plots(run, tmp_path)
    assert [path.read_bytes() for path in again] == [path.read_bytes() for path in drawn]


def test_what_was_not_measured_is_not_drawn(tmp_path):
    assert plots.draw_plots(Run({}, {}), tmp_path) == []
    run = synthetic_run()
    run.scaling, run.records = run.scaling[:1], [r for r in run.records if r.setting.method == "triangles"]
    assert [path.name for path in plots.draw_plots(run, tmp_path)] == ["error-over-time.svg"]


def test_every_measured_setting_is_a_mark_over_its_time(run):
    axes = Figure().subplots()
    points = points_of(run, main_model(run))
    assert plots.draw_time(axes, points)
    methods = {point.setting.method for point in points}
    marks = {tuple(np.round(xy, 6)) for line in axes.lines[: len(methods)] for xy in line.get_xydata()}
    assert marks == {(round(p.ms, 6), round(p.error, 6)) for p in points}


def test_the_crossing_is_named(run):
    axes = Figure().subplots()
    assert plots.draw_scaling(axes, run)
    assert any("splats are faster" in text and "k triangles" in text for text in texts(axes))
    (size, low), (_, high) = axes.lines[1].get_xydata()[-1], axes.lines[0].get_xydata()[-1]
    assert size == 17_000_000
    assert low / high == pytest.approx(run.scaling[-1]["cost"]["frame_over_triangles"])


def test_the_saving_is_written_beside_its_arrow(run):
    axes = Figure().subplots()
    assert plots.draw_splats(axes, points_of(run, "igea.ply"))
    assert any("times fewer at" in text for text in texts(axes))


def test_curves_that_end_together_share_their_label(run):
    ends = [replace(p, tile_bytes=8.0) for p in points_of(run, "igea.ply")[:3]]
    named = {n: replace(p, error=e) for n, p, e in zip("abc", ends, (1.0, 1.04, 1.2), strict=True)}
    assert [text for _, text in plots._joined(named)] == ["a, b", "c"]


def test_a_heat_map_shows_where_the_error_is(tmp_path):
    degrees = np.full((80, 100), np.nan, np.float32)
    degrees[20:60, 30:70] = 0.0
    degrees[20:60, 50:70] = 5.0
    shaded = np.full((80, 100, 3), 90, np.uint8)
    draw_heat_map(tmp_path / "map.png", shaded, degrees, "a square")
    with Image.open(tmp_path / "map.png") as image:
        picture = np.asarray(image.convert("RGB")).astype(int)
    rows = slice(int(0.45 * picture.shape[0]), int(0.55 * picture.shape[0]))
    right = picture[rows, picture.shape[1] // 2 : int(0.87 * picture.shape[1])].sum(axis=2)
    # No error is black, the most is nearly white, and what is not compared is neither.
    assert right.min() < 60
    assert right.max() > 620
    # The middle of the left half is the shaded picture.
    assert (np.abs(picture[rows, picture.shape[1] // 4] - 90) < 12).all()
    assert (tmp_path / "map.png").stat().st_size < 60_000


def test_a_heat_map_of_nothing_is_refused(tmp_path):
    nothing = np.full((8, 8), np.nan, np.float32)
    with pytest.raises(ValueError, match="nothing"):
        draw_heat_map(tmp_path / "map.png", np.zeros((8, 8, 3), np.uint8), nothing, "")
    with pytest.raises(ValueError, match="picture is"):
        draw_heat_map(tmp_path / "map.png", np.zeros((8, 9, 3), np.uint8), nothing, "")
