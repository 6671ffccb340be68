"""Fronts, interpolation and means over views, on points whose answers are known."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic_run import VIEWS, synthetic_run

from benchmarks.findings import (
    Point,
    main_model,
    of_method,
    pareto_front,
    points_of,
    savings,
    swept_views,
    triangles_time,
    with_refinement,
    without_refinement,
    x_at,
)
from benchmarks.run_file import Run, Setting

SETTING = Setting("model", "front", "surfelscope", 2.0, 16.0, 16)


def point(x: float, y: float) -> Point:
    return Point(SETTING, x, 1.0, y, 3.0 * y, 0.2, x, 0.0, 0.0, 0.0, ())


def ms(p: Point) -> float:
    return p.ms


def error(p: Point) -> float:
    return p.error


COORDINATES = st.lists(st.tuples(st.floats(0.1, 100.0), st.floats(0.1, 100.0)), max_size=30)


@given(COORDINATES)
def test_no_point_is_better_in_both_than_one_of_the_front(coordinates):
    points = [point(*c) for c in coordinates]
    front = pareto_front(points, ms, error)
    for chosen in front:
        assert not any(
            p.ms <= chosen.ms and p.error <= chosen.error and (p.ms, p.error) != (chosen.ms, chosen.error)
            for p in points
        )
    for p in points:
        assert any(f.ms <= p.ms and f.error <= p.error for f in front)
    assert all(a.ms < b.ms and a.error > b.error for a, b in itertools.pairwise(front))


def test_a_front_leaves_out_what_is_no_number():
    points = [point(math.nan, 1.0), point(1.0, math.nan), point(math.inf, 0.0), point(2.0, 2.0)]
    assert [p.ms for p in pareto_front(points, ms, error)] == [2.0]


def test_between_two_points_a_power_law_is_met_exactly():
    # error = 8 / sqrt(x)
    front = [point(x, 8.0 / math.sqrt(x)) for x in (1.0, 16.0, 64.0)]
    for x in (1.0, 3.0, 16.0, 50.0, 64.0):
        assert x_at(front, ms, error, 8.0 / math.sqrt(x)) == pytest.approx(x)
    assert x_at(front, ms, error, 8.1) is None
    assert x_at(front, ms, error, 0.9) is None
    assert x_at([], ms, error, 1.0) is None


def test_an_error_of_zero_ends_a_front():
    assert x_at([point(1.0, 2.0), point(3.0, 0.0)], ms, error, 1.0) == pytest.approx(2.0)


def test_savings_are_the_ratio_at_the_same_error_and_none_where_one_does_not_reach_it():
    using = [point(10.0, 1.0), point(40.0, 0.5)]
    without = [point(70.0, 1.0), point(280.0, 0.5), point(9.0, 3.0)]
    found = savings(using, without, ms, error, (0.4, 0.5, 0.7, 1.0, 2.0))
    assert [s.error for s in found] == [0.5, 0.7, 1.0]
    assert [s.factor for s in found] == pytest.approx([7.0, 7.0, 7.0])


def test_igea_is_drawn_where_it_was_measured():
    run = synthetic_run()
    assert main_model(run) == "igea.ply"
    run.records = [record for record in run.records if record.setting.model != "igea.ply"]
    assert main_model(run) == "bunny.obj"
    assert main_model(Run({}, {})) is None


def test_points_are_means_over_the_views_that_the_whole_sweep_has():
    run = synthetic_run()
    far = next(r for r in run.records if r.setting.method == "triangles")
    run.records.append(replace(far, setting=replace(far.setting, view="far")))
    assert swept_views(run, "igea.ply") == list(VIEWS)
    points = points_of(run, "igea.ply")
    records = [r for r in run.records if r.setting.model == "igea.ply"]
    assert len(points) == (len(records) - 1) / len(VIEWS)
    chosen = points[5]
    s = chosen.setting
    own = [r for r in records if replace(r.setting, view=s.view) == s]
    assert len(own) == len(chosen.records) == len(VIEWS)
    assert chosen.error == pytest.approx(sum(r.value("error.normal_degrees.mean") for r in own) / len(VIEWS))
    assert chosen.ms == pytest.approx(chosen.ratio * triangles_time(run, "igea.ply"))
    assert chosen.mean("cost.splats") == pytest.approx(chosen.splats)
    assert math.isnan(chosen.mean("cost.nothing"))


def test_refined_and_unrefined_share_no_setting():
    points = points_of(synthetic_run(), "igea.ply")
    refined, one = with_refinement(points), without_refinement(points)
    assert refined
    assert one
    assert not {p.setting for p in refined} & {p.setting for p in one}
    assert {p.setting.method for p in refined + one} == {"surfelscope"}
    assert of_method(points, "surfelscope", r_sil=2.0, r_inner=24.0, w_s=8)
