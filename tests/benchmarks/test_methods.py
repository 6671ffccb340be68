"""What each method chooses to draw, and which settings the sweep measures it with."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from small_models import bumpy_sphere, terrain

from benchmarks.methods import METHODS, select_base
from benchmarks.paper_table import PRINTED, normal_map_size
from benchmarks.sweep import is_usual, settings_of, swept_views
from hierarchy.build import build_hierarchy
from hierarchy.lod import Cut, select_cut
from hierarchy.view import look_at

VIEW = look_at((1.0, 2.0, 4.0), (0, 0, 0), (0, 1, 0), math.radians(45.0), (200, 150), bounds=((0, 0, 0), 2.0))
VIEWS = ["front", *(f"orbit {k}" for k in range(12)), "close-up", "far", "inside", "grazing"]


@pytest.fixture(scope="module")
def points():
    return build_hierarchy(bumpy_sphere(10), points=True)


@pytest.fixture(scope="module")
def hybrid():
    return build_hierarchy(bumpy_sphere(10))


def chosen(name: str, hierarchy, r_sil: float, r_inner: float) -> Cut:
    select = METHODS[name].select
    assert select is not None
    return select(hierarchy, VIEW, r_sil, r_inner)


def same(a: Cut, b: Cut) -> bool:
    return np.array_equal(a.splats, b.splats) and np.array_equal(a.indices, b.indices)


def test_base_surfels_of_a_closed_model_are_those_that_face_the_eye(points):
    cut = select_base(points, VIEW)
    leaves = points.splats[points.node_count :].copy()
    towards = VIEW.eye - leaves["centre"].astype(np.float64)
    expected = np.flatnonzero((towards * leaves["normal"]).sum(axis=1) > 0.0) + points.node_count
    assert np.array_equal(cut.splats, expected)
    assert 0.2 < len(expected) / points.leaf_count < 0.8
    assert cut.triangle_count == 0


def test_base_surfels_of_an_open_model_are_all():
    hierarchy = build_hierarchy(terrain(8), points=True)
    cut = select_base(hierarchy, VIEW)
    assert np.array_equal(cut.splats, hierarchy.node_count + np.arange(hierarchy.leaf_count))


def test_the_own_method_and_its_variants_choose_alike(hybrid):
    own = chosen("surfelscope", hybrid, 1.0, 8.0)
    assert same(own, select_cut(hybrid, VIEW, 1.0, 8.0))
    for name in ("no tiles", "point sprites"):
        assert same(own, chosen(name, hybrid, 1.0, 8.0))


def test_the_printed_cone_test_refines_more(hybrid):
    own, printed = chosen("surfelscope", hybrid, 1.0, 8.0), chosen("printed cone test", hybrid, 1.0, 8.0)
    assert printed.splat_count + printed.triangle_count > own.splat_count + own.triangle_count
    assert same(printed, select_cut(hybrid, VIEW, 1.0, 8.0, printed_cone_test=True))


def test_one_radius_draws_surfels_only(points):
    assert METHODS["one radius"].points
    cut = chosen("one radius", points, 4.0, 4.0)
    assert cut.triangle_count == 0
    assert same(cut, select_cut(points, VIEW, 4.0, 4.0))


def test_settings_differ_as_the_names_say():
    settings = {name: method.settings for name, method in METHODS.items()}
    assert settings["surfelscope"].normal_mapping
    assert settings["surfelscope"].splat == "quad"
    assert settings["point sprites"].splat == "sprite"
    assert settings["point sprites"].normal_mapping
    assert not settings["base surfels flat"].blending
    assert settings["base surfels blended"].blending
    assert not any(settings[name].normal_mapping for name in METHODS if not METHODS[name].tiles and name[:4] != "tria")


@pytest.mark.parametrize("quick", [False, True])
@pytest.mark.parametrize("closed", [False, True])
def test_the_sweep_has_every_method_and_no_setting_twice(quick, closed):
    settings = settings_of("m", VIEWS, ["front"], closed=closed, quick=quick, everywhere=False)
    assert len(settings) == len(set(settings))
    assert {setting.view for setting in settings} == {"front"}
    left_out = set() if closed else {"triangles, culled"}
    assert {setting.method for setting in settings} == set(METHODS) - left_out
    for setting in settings:
        method = METHODS[setting.method]
        assert (setting.w_s > 0) == method.tiles
        assert (setting.r_inner > 0.0) == method.radii
        assert setting.r_sil <= setting.r_inner
        assert setting.w_s <= 2.0 * setting.r_inner


def test_what_shares_a_hierarchy_and_tiles_is_measured_together():
    settings = settings_of("m", VIEWS, VIEWS, closed=True, quick=False, everywhere=True)
    groups = [(METHODS[setting.method].points, setting.w_s) for setting in settings]
    changes = sum(a != b for a, b in itertools.pairwise(groups))
    assert changes == len(set(groups)) - 1


def test_the_own_setting_is_measured_everywhere():
    settings = settings_of("m", VIEWS, ["front"], closed=True, quick=True, everywhere=True)
    own = {setting.view for setting in settings if (setting.r_sil, setting.r_inner, setting.w_s) == (2.0, 16.0, 16)}
    assert own == set(VIEWS)


def test_a_quick_sweep_is_part_of_what_a_full_one_measures():
    quick = settings_of("m", VIEWS, ["front"], closed=True, quick=True, everywhere=True)
    full = settings_of("m", VIEWS, VIEWS, closed=True, quick=False, everywhere=True)
    assert set(quick) <= set(full)
    assert len(full) > 4 * len(quick)


def test_one_setting_of_each_method_is_the_usual_one():
    settings = settings_of("m", VIEWS, ["front"], closed=True, quick=True, everywhere=False)
    usual = [setting.method for setting in settings if is_usual(setting)]
    assert set(usual) == set(METHODS)
    # Without tiles the paper's single radius is usual, too.
    assert sorted(usual) == sorted([*METHODS, "no tiles"])


def test_sets_of_views():
    assert swept_views("all", VIEWS) == VIEWS
    assert swept_views("few", VIEWS) == ["front", "orbit 4", "close-up"]
    assert swept_views("one", VIEWS) == ["front"]
    # A model may lack some.
    assert swept_views("few", ["front"]) == ["front"]


def test_normal_map_sizes_are_those_of_the_paper():
    # About 63,000 inner and 90,000 base surfels are what all four of the paper's sizes have in common.
    for row in PRINTED:
        width, height = normal_map_size(63_000, 90_000, row.w_s)
        assert width % row.w_s == 0
        if row.tiles:
            assert 1e-6 * width * height == pytest.approx(row.size, rel=0.03)
