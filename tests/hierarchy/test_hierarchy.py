"""The flat arrays of a hierarchy and what is derived from them."""

import numpy as np
import pytest
from small_models import bumpy_sphere, icosphere, mesh_of, surfel_sphere

from hierarchy.build import build_hierarchy
from hierarchy.hierarchy import NODE, SPLAT
from hierarchy.spreads import SCALES


def test_records_have_no_padding():
    # The GPU reads a splat as three RGBA32F texels; a node is read as 4-byte numbers only.
    assert SPLAT.itemsize == 48
    assert [SPLAT.fields[name][1] for name in ("centre", "radius", "normal", "thickness")] == [0, 12, 16, 28]
    assert NODE.itemsize == 4 * len(NODE.names)
    assert {NODE[name] for name in NODE.names} == {np.dtype("f4"), np.dtype("i4")}


def test_kinds_and_counts():
    hybrid, points = build_hierarchy(bumpy_sphere()), build_hierarchy(surfel_sphere())
    assert (hybrid.leaf_kind, points.leaf_kind) == ("triangles", "surfels")
    assert (hybrid.leaf_count, points.leaf_count) == (320, 300)
    assert hybrid.node_count == len(hybrid.nodes) == len(hybrid.splats)
    assert points.node_count + points.leaf_count == len(points.splats)


@pytest.mark.parametrize("make", [icosphere, bumpy_sphere, surfel_sphere])
def test_bounds_hold_the_model(make):
    model = make()
    centre, radius = build_hierarchy(model).bounds
    reach = getattr(model, "radii", 0.0)
    assert (np.linalg.norm(model.positions - centre, axis=1) + 0.7 * reach).max() <= radius * 1.01
    assert radius < 2.0 * np.linalg.norm(model.positions, axis=1).max()
    assert centre.dtype == np.float64


def test_bytes_are_counted():
    model = mesh_of(
        icosphere(2).positions, icosphere(2).faces, colors=np.zeros((len(icosphere(2).positions), 4), np.uint8)
    )
    hierarchy = build_hierarchy(model)
    vertices, triangles, nodes = len(model.positions), len(model.faces), hierarchy.node_count
    expected = nodes * (NODE.itemsize + SPLAT.itemsize + 2 * SCALES + 4) + vertices * (12 + 12 + 4) + triangles * 12
    assert hierarchy.nbytes == expected
    without = build_hierarchy(mesh_of(model.positions, model.faces))
    assert without.nbytes == expected - 4 * nodes - 4 * vertices
    cloud = build_hierarchy(surfel_sphere(100))
    nodes = cloud.node_count * (NODE.itemsize + 2 * SCALES)
    assert cloud.nbytes == nodes + len(cloud.splats) * SPLAT.itemsize + 100 * 28
