"""Bounded footprints hold the exact ones, and models too large to count are refused."""

import numpy as np
import pytest
from small_models import bumpy_sphere, surfel_sphere, terrain, thin_sheet

from hierarchy import clean
from hierarchy.build import build_hierarchy
from hierarchy.coarse_footprints import coarse_footprint, join_cone
from hierarchy.cones import EVERYTHING
from hierarchy.leaves import sort_surfels, sort_triangles
from hierarchy.model import Mesh
from hierarchy.part import UnreadableFile
from hierarchy.under_discs import rim_of


@pytest.mark.parametrize("make", [lambda: bumpy_sphere(5), terrain, thin_sheet, surfel_sphere])
def test_a_coarse_footprint_is_never_smaller_than_the_exact_one(make):
    model = make()
    _, shapes, _ = sort_triangles(model) if isinstance(model, Mesh) else sort_surfels(model)
    hierarchy = build_hierarchy(model, min_leaves=2)
    arrays = (shapes.positions, shapes.indices, shapes.normals, shapes.centres, shapes.extents)
    narrow = 0
    for node, me in enumerate(hierarchy.nodes):
        normal = hierarchy.splats["normal"][node]
        thickness = hierarchy.splats["thickness"][node]
        rim = rim_of(float(me["x"]), float(me["y"]), float(me["z"]), float(me["radius"]), *normal.astype(float))
        cap = np.empty(4)
        relief = coarse_footprint(hierarchy.nodes, node, normal, thickness, arrays, rim, hierarchy.closed, cap)
        assert relief >= me["relief"] - 1e-6 * me["radius"]
        assert cap[3] <= me["print_cos"] + 1e-6
        narrow += cap[3] > 0.0
    # Most are bounds that say something.
    assert narrow > 0 or not hierarchy.closed


def test_a_joined_cone_holds_both():
    rng = np.random.default_rng(5)
    for _ in range(300):
        axes = rng.normal(size=(2, 3))
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        halves = rng.uniform(0.0, 0.7, 2)
        cap = np.array([*axes[0], np.cos(halves[0])])
        join_cone(cap, *(2.0 * axes[1]), np.cos(halves[1]), np.sin(halves[1]))
        if cap[3] == EVERYTHING:
            between = np.arccos(np.clip(axes[0] @ axes[1], -1.0, 1.0))
            assert between + halves.sum() >= np.pi - 1e-6
            continue
        assert np.linalg.norm(cap[:3]) == pytest.approx(1.0)
        for axis, half in zip(axes, halves, strict=True):
            assert np.arccos(np.clip(cap[:3] @ axis, -1.0, 1.0)) + half <= np.arccos(cap[3]) + 1e-7


def test_models_too_large_to_count_are_refused(monkeypatch):
    monkeypatch.setattr(clean, "MOST_FACES", 1)
    monkeypatch.setattr(clean, "MOST_POINTS", 2)
    with pytest.raises(UnreadableFile, match="too large: 2 faces"):
        clean.clean_faces(np.zeros((3, 3)), np.array([[0, 1, 2], [0, 2, 1]]), 0, [])
    with pytest.raises(UnreadableFile, match="too large: 3 points"):
        clean.clean_points(np.zeros((3, 3)), [])
