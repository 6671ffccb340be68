"""The growing surface is one surface, its sizes are measured apart, and its figures are read off rightly."""

from __future__ import annotations

import math
import os
from types import SimpleNamespace

import numpy as np
import other_process
import pytest
from synthetic_run import synthetic_size

from benchmarks import scaling
from benchmarks.scaling import ScalingError, growth, measure_apart, missing_sizes, overtaking
from benchmarks.surface import make_surface, surface_view
from hierarchy import lod
from hierarchy.model import in_file_space


def sized(size: int, ratio: float) -> dict[str, object]:
    entry = synthetic_size(size)
    entry["cost"] |= {"frame_over_triangles": ratio, "frame_over_yardstick": ratio}
    return entry


def test_the_view_is_the_same_at_every_size():
    eyes = []
    for triangles in (500, 20_000):
        mesh = make_surface(triangles)
        view = surface_view(mesh, (64, 48))
        eyes.append(in_file_space(mesh, view.eye))
        assert (view.width, view.height) == (64, 48)
        # All of the surface lies between the clip planes and in the picture.
        points = mesh.positions @ view.eye_from_model[:3, :3].T + view.eye_from_model[:3, 3]
        assert view.near < -points[:, 2].max()
        assert -points[:, 2].min() < view.far
        pixels = points[:, :2] / -points[:, 2:] * view.focal_pixels
        assert (np.abs(pixels) < (32, 24)).all()
    np.testing.assert_allclose(eyes[0], eyes[1], atol=1e-12)


def test_finer_triangles_come_nearer_to_the_same_surface():
    # The middles of a coarse mesh's triangles lie off the surface by an amount that falls with the edge's square.
    fine = make_surface(80_000)
    directions = in_file_space(fine, fine.positions)
    heights = np.linalg.norm(directions, axis=1)
    directions /= heights[:, None]

    def off(triangles: int) -> float:
        mesh = make_surface(triangles)
        places = in_file_space(mesh, mesh.positions)[mesh.faces].mean(axis=1)[:300]
        height = np.linalg.norm(places, axis=1)
        nearest = (places @ directions.T).argmax(axis=1)
        return float(np.abs(heights[nearest] - height).mean())

    assert off(20_000) < 0.4 * off(2_000)


def test_splats_overtake_where_the_ratio_falls_below_one_for_good():
    entries = [sized(100, 4.0), sized(10_000, 0.25), sized(1_000_000, 0.01)]
    assert overtaking(entries) == pytest.approx(1_000.0)
    # A dip that is not kept does not count.
    assert overtaking([sized(10, 0.9), *entries]) == pytest.approx(1_000.0)
    assert overtaking([sized(100, 4.0), sized(1_000, 1.0)]) is None
    assert overtaking([sized(100, 0.5)]) is None
    assert overtaking([]) is None


def test_growth_is_from_the_yardsticks_size_to_the_largest():
    entries = [sized(10_000, 0.7), sized(270_000, 1.0), sized(17_000_000, 1.1)]
    assert growth(entries) == pytest.approx(1.1)
    assert growth(entries[:2]) is None


def test_sizes_that_are_measured_are_not_measured_again():
    assert missing_sizes([synthetic_size(100_000)], (10_000, 100_000, 1_000_000)) == [10_000, 1_000_000]


def test_a_size_is_measured_in_a_process_of_its_own(monkeypatch):
    monkeypatch.setattr(scaling, "_work", other_process.answer)
    entry = measure_apart(1_000, (32, 32), 1, 1)
    assert entry["size"] == 1_000
    assert entry["process"] != os.getpid()


@pytest.mark.parametrize(("work", "message"), [(other_process.end, "status 9"), (other_process.fail, "no memory")])
def test_a_process_that_fails_or_is_killed_is_one_line(monkeypatch, work, message):
    monkeypatch.setattr(scaling, "_work", work)
    with pytest.raises(ScalingError, match=rf"^surface of 1000 triangles: .*{message}.*$"):
        measure_apart(1_000, (32, 32), 1, 1)


@pytest.mark.parametrize(
    ("error", "line"),
    [(ValueError("two\nlines"), "two lines"), (KeyError(), "KeyError"), (MemoryError(), "there is not enough memory")],
)
def test_the_other_process_sends_errors_as_one_line(monkeypatch, error, line):
    def measure_size(*_):
        raise error

    sent = []
    monkeypatch.setattr("benchmarks.surface_cost.measure_size", measure_size)
    monkeypatch.setattr(scaling.signal, "signal", lambda *_: None)
    scaling._work(SimpleNamespace(send=sent.append), 1_000, (32, 32), 1, 1)
    ((kind, text),) = sent
    assert kind == "error"
    assert text.startswith(line)


def test_a_small_size_is_measured_as_a_whole(monkeypatch):
    pytest.importorskip("embreex")
    from benchmarks import surface_cost
    from renderer.context import ContextError

    monkeypatch.setattr(surface_cost, "YARDSTICK", 2_000)
    selected = []

    def select_cut(hierarchy, view, r_sil, r_inner):
        selected.append(r_inner)
        return lod.select_cut(hierarchy, view, r_sil, r_inner)

    monkeypatch.setattr(surface_cost, "select_cut", select_cut)
    try:
        entry = surface_cost.measure_size(1_000, (64, 64), rounds=2, samples=2)
    except ContextError as error:
        pytest.skip(str(error))
    cost = entry["cost"]
    assert entry["size"] == 1_000
    assert abs(entry["triangles"] - 1_000) < 100
    assert entry["rounds"] == 2
    assert cost["splats"] + cost["triangles"] > 0
    for name in ("select_ms", "visibility_ms", "attributes_ms", "resolve_ms", "frame_ms", "triangles_ms"):
        assert 0.0 < cost[name]["min"] <= cost[name]["median"]
    assert cost["frame_over_triangles"] > 0.0
    assert cost["frame_over_yardstick"] > 0.0
    for other in (entry["moving"], entry["coarser"]):
        assert other["cost"]["frame_over_triangles"] > 0.0
        assert 0.0 < other["error"]["normal_degrees"]["mean"] < 10.0
    # A surface of 1,000 triangles has nothing coarser to draw.
    assert selected.count(entry["coarser"]["r_inner"]) >= 2 * surface_cost.IN_A_ROW
    assert entry["moving"]["error"] != entry["error"]
    assert entry["moving"]["r_inner"] == entry["r_inner"] < entry["coarser"]["r_inner"]
    assert 0.0 < entry["error"]["normal_degrees"]["mean"] < 10.0
    assert math.isfinite(entry["error"]["silhouette"]["mean"])
    assert entry["build_peak_mb"] <= cost["peak_memory_mb"]
