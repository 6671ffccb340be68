"""The spreads of normals: what they are at a node's own size, and how they fall with the size of the patches."""

import numpy as np
import pytest
from small_models import bumpy_sphere, cloud_of, icosphere, mesh_of, surfel_sphere, terrain, thin_sheet

from hierarchy.build import build_hierarchy
from hierarchy.leaves import Triangles
from hierarchy.spreads import SCALES, UNIT


def angles(hierarchy):
    return UNIT * hierarchy.spreads.astype(float)


def own_spread(hierarchy, node):
    """Return the root mean square chord between the normals below a node and their mean, by dense sampling."""
    begin, end = hierarchy.nodes[["leaf_begin", "leaf_end"]][node].item()
    leaves = hierarchy.leaves
    if not isinstance(leaves, Triangles):
        normals, weights = leaves.normals[begin:end].astype(float), leaves.radii[begin:end].astype(float) ** 2
    else:
        # The centroid and the corners of every triangle's halves: exact for what varies linearly.
        corners = leaves.normals[leaves.indices[begin:end]].astype(float)
        points = leaves.positions[leaves.indices[begin:end]].astype(float)
        areas = 0.5 * np.linalg.norm(np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]), axis=1)
        normals = np.concatenate([0.5 * (corners[:, k] + corners[:, (k + 1) % 3]) for k in range(3)])
        weights = np.tile(areas / 3.0, 3)
    mean = (weights[:, None] * normals).sum(axis=0) / weights.sum()
    return np.sqrt(2.0 * (1.0 - np.linalg.norm(mean)))


@pytest.mark.parametrize("model", [lambda: bumpy_sphere(4), terrain, surfel_sphere], ids=["mesh", "open", "surfels"])
def test_the_spread_at_the_own_size_is_that_of_the_normals_below(model):
    hierarchy = build_hierarchy(model())
    expected = [own_spread(hierarchy, node) for node in range(hierarchy.node_count)]
    assert np.abs(angles(hierarchy)[:, 0] - expected).max() < 1e-3


@pytest.mark.parametrize(
    "model", [lambda: icosphere(16), lambda: bumpy_sphere(8), terrain], ids=["sphere", "bumpy", "open"]
)
def test_smaller_patches_have_smaller_spreads(model):
    spreads = angles(build_hierarchy(model()))
    # A patch's normals vary less around its own mean than around that of what it is a part of.
    assert (np.diff(spreads, axis=1) <= 2.0 * UNIT).all()


def test_on_a_sphere_half_the_size_has_about_half_the_spread():
    spreads = angles(build_hierarchy(icosphere(48)))
    # A little more: cells that cut the sphere slantwise are collapsed, and then two levels are less than half.
    ratios = np.median(spreads[30:400, 1:] / spreads[30:400, :-1], axis=0)
    assert ratios.min() > 0.45
    assert ratios.max() < 0.62


def test_a_plane_has_no_spread():
    model = terrain()
    flat = mesh_of(model.positions * [1, 1, 0], model.faces)
    assert build_hierarchy(flat).spreads.max() == 0


def test_the_sides_of_a_thin_sheet_spread_as_far_as_normals_can():
    spreads = angles(build_hierarchy(thin_sheet()))
    assert spreads[0, 0] == pytest.approx(np.sqrt(2.0), abs=0.05)


def test_the_parts_of_a_single_triangle_vary_by_half_for_half_the_size():
    normals = np.array([[0, 0, 1], [0.1, 0, 1], [0, 0.1, 1]])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    mesh = mesh_of([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], normals=normals)
    spreads = angles(build_hierarchy(mesh))[0]
    assert spreads[0] > 0.0
    # The triangle itself is one level below its node, and its halves two levels.
    assert spreads[2:] / spreads[1:-1] == pytest.approx([0.5] * (SCALES - 2), abs=0.02)


def test_a_single_surfel_has_no_spread():
    assert build_hierarchy(cloud_of([[0, 0, 0]], [[0, 0, 1]], [1.0])).spreads.max() == 0
