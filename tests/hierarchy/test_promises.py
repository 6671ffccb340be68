"""What is promised of a cut: laws. On pictures promises are tested in tests/renderer/test_promised_errors.py."""

import math
from itertools import pairwise

import numpy as np
import pytest
from small_models import icosphere, surfel_sphere

from hierarchy.build import build_hierarchy
from hierarchy.goals import INNER_RADII, SILHOUETTE_RADII, WORTH, Detail, ErrorGoal, detail_for_goal, promise_of_cut
from hierarchy.lod import Cut, select_cut
from hierarchy.meteoroid import make_meteoroid
from hierarchy.promises import LEAST_DEGREES, LEAST_PIXELS, promised_errors
from hierarchy.view import look_at

TEXELS = (2, 4, 8, 16, 32)


@pytest.fixture(scope="module")
def rock():
    return build_hierarchy(make_meteoroid(40_000))


def view_of(hierarchy, distance=3.0, size=512):
    centre, radius = hierarchy.bounds
    eye = centre + distance * radius * np.array([0.36, 0.48, 0.8])
    return look_at(eye, centre, (0, 1, 0), math.radians(45), (size, size), bounds=hierarchy.bounds)


def primitives(hierarchy, view, detail):
    cut = select_cut(hierarchy, view, detail.r_sil, detail.r_inner)
    return cut.splat_count + cut.triangle_count


def test_larger_tiles_promise_less_error(rock):
    view = view_of(rock)
    degrees, _ = promised_errors(rock, view, select_cut(rock, view, 2.0, 16.0), TEXELS)
    assert list(degrees) == sorted(degrees, reverse=True)
    assert degrees[0] > 1.5 * degrees[3]


def test_larger_radii_promise_more_error(rock):
    view = view_of(rock)
    inner = [promise_of_cut(rock, view, select_cut(rock, view, 2.0, r), 8).degrees for r in (2.0, 6.0, 12.0, 24.0)]
    outer = [promise_of_cut(rock, view, select_cut(rock, view, r, 16.0), 8).pixels for r in (1.0, 2.0, 4.0, 8.0)]
    assert inner == sorted(inner)
    assert outer == sorted(outer)


def test_leaf_triangles_alone_promise_the_least(rock):
    view = view_of(rock)
    cut = select_cut(rock, view, 0.0, 0.0)
    assert cut.splat_count == 0
    promise = promise_of_cut(rock, view, cut, 16)
    assert promise.pixels == LEAST_PIXELS
    assert LEAST_DEGREES < promise.degrees < 1.0


def test_the_same_picture_at_another_scale_promises_the_same(rock):
    mesh = make_meteoroid(10_000)
    small = build_hierarchy(mesh)
    large = build_hierarchy(
        type(mesh)(mesh.name, mesh.origin, mesh.positions * 1024, mesh.faces, mesh.normals, closed=True)
    )
    for texels in (4, 16):
        promises = [promise_of_cut(h, view_of(h), select_cut(h, view_of(h), 2.0, 16.0), texels) for h in (small, large)]
        assert promises[0].degrees == pytest.approx(promises[1].degrees, rel=1e-3)
        assert promises[0].pixels == pytest.approx(promises[1].pixels, rel=1e-3)


def test_a_cut_that_draws_nothing_promises_no_error(rock):
    nothing = Cut(np.empty(0, np.uint32), np.empty((0, 3), np.uint32), 0, 0, 1)
    assert promised_errors(rock, view_of(rock), nothing, (4, 8)) == ((0.0, 0.0), 0.0)


def test_leaf_surfels_count_by_their_area():
    hierarchy = build_hierarchy(surfel_sphere())
    view = view_of(hierarchy)
    cut = select_cut(hierarchy, view, 0.0, 0.0)
    assert (cut.splats >= hierarchy.node_count).all()
    assert math.isfinite(promise_of_cut(hierarchy, view, cut, 4).degrees)


@pytest.mark.parametrize("goal", [ErrorGoal(1.0, 0.5), ErrorGoal(2.0, 0.4), ErrorGoal(4.0, 1.5)])
def test_the_detail_promises_what_is_asked_for(rock, goal):
    view = view_of(rock, size=1024)
    detail, promise = detail_for_goal(rock, view, goal, texels=TEXELS)
    assert promise.degrees <= goal.degrees
    assert promise.pixels <= goal.pixels
    cut = select_cut(rock, view, detail.r_sil, detail.r_inner)
    assert promise_of_cut(rock, view, cut, detail.texels) == promise


def test_who_allows_more_draws_less(rock):
    view = view_of(rock, size=1024)
    goals = [ErrorGoal(degrees, pixels) for degrees, pixels in ((0.7, 0.3), (1.0, 0.4), (2.0, 0.6), (4.0, 1.0))]
    counts = [primitives(rock, view, detail_for_goal(rock, view, goal, texels=TEXELS)[0]) for goal in goals]
    # A smaller tile may be worth a few more splats.
    assert all(fewer <= WORTH * more for more, fewer in pairwise(counts))
    assert counts[0] > 1.2 * counts[-1]


def test_a_fixed_size_of_tiles_is_kept(rock):
    view = view_of(rock, size=1024)
    assert detail_for_goal(rock, view, ErrorGoal(2.0, 0.6), texels=(8,))[0].texels == 8


def test_what_cannot_be_kept_gets_the_finest(rock):
    detail, promise = detail_for_goal(rock, view_of(rock), ErrorGoal(0.001, 0.001), texels=TEXELS)
    assert (detail.r_sil, detail.r_inner) == (SILHOUETTE_RADII[-1], INNER_RADII[-1])
    assert promise.degrees > 0.001


def test_no_goal_worth_the_name_gets_the_coarsest():
    hierarchy = build_hierarchy(icosphere(8))
    detail, _ = detail_for_goal(hierarchy, view_of(hierarchy), ErrorGoal(1e3, 1e3), texels=TEXELS)
    assert detail == Detail(SILHOUETTE_RADII[0], INNER_RADII[0], TEXELS[0])


def test_no_size_of_tiles_is_an_error(rock):
    with pytest.raises(ValueError, match="no size"):
        detail_for_goal(rock, view_of(rock), ErrorGoal(1.0, 1.0), texels=())
