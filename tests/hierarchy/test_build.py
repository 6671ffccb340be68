"""From models to hierarchies, end to end."""

import dataclasses
import math

import numpy as np
import pytest
from small_models import (
    beside_a_far_triangle,
    box,
    bumpy_sphere,
    cloud_of,
    icosphere,
    mesh_of,
    surfel_sphere,
    terrain,
    thin_sheet,
)

from hierarchy.build import build_hierarchy
from hierarchy.cones import EVERYTHING
from hierarchy.hierarchy import NODE, SPLAT
from hierarchy.leaves import Surfels, Triangles
from hierarchy.model import Cancelled, Mesh
from hierarchy.surfels import surfels_of_mesh

MODELS = {
    "icosphere": icosphere,
    "bumpy sphere": lambda: bumpy_sphere(6),
    "box": box,
    "terrain": terrain,
    "thin sheet": thin_sheet,
    "one triangle": lambda: mesh_of([[0, 0, 0], [1, 0, 0], [0, 2, 1]], [[0, 1, 2]]),
    "two identical triangles": lambda: mesh_of([[0, 0, 0], [1, 0, 0], [0, 2, 1]], [[0, 1, 2]] * 2),
    "surfel sphere": surfel_sphere,
    "one point": lambda: cloud_of([[1, 2, 3]], [[0, 0, 1]], 0.5),
    "two points": lambda: cloud_of([[0, 0, 0], [1, 0, 0]], [[0, 0, 1]] * 2, 0.6),
    "two points 1e-6 apart": lambda: cloud_of([[0, 0, 0], [1e-6, 0, 0]], [[0, 0, 1]] * 2, 0.6),
    "collinear points": lambda: cloud_of(np.linspace(0, 1, 50)[:, None] * [1, 2, 3], [[0, 0, 1]] * 50, 0.05),
    "flat": lambda: mesh_of(terrain().positions * [1, 1, 0], terrain().faces),
}


def centres(nodes):
    return np.stack([nodes["x"], nodes["y"], nodes["z"]], 1).astype(float)


@pytest.mark.parametrize("name", MODELS)
def test_hierarchies_are_well_formed(name):
    model = MODELS[name]()
    hierarchy = build_hierarchy(model)
    nodes = hierarchy.nodes
    assert (nodes.dtype, hierarchy.splats.dtype) == (NODE, SPLAT)
    assert hierarchy.leaf_count == len(model.faces if isinstance(model, Mesh) else model.positions)
    assert (nodes[0]["leaf_begin"], nodes[0]["leaf_end"]) == (0, hierarchy.leaf_count)
    for field in NODE.names:
        assert np.isfinite(nodes[field]).all()
    for node in nodes:
        children = nodes[node["first_child"] : node["first_child"] + node["child_count"]]
        assert len(children) == node["child_count"]
        assert (children["leaf_begin"] >= node["leaf_begin"]).all()
        assert (children["leaf_end"] <= node["leaf_end"]).all()
    # A parent's cone is no narrower than its children's, which hold fewer normals.
    for node in nodes:
        children = nodes[node["first_child"] : node["first_child"] + node["child_count"]]
        assert (children["cone_cos"] >= node["cone_cos"] - 1e-6).all()


@pytest.mark.parametrize("name", MODELS)
def test_nodes_and_splats_agree(name):
    hierarchy = build_hierarchy(MODELS[name]())
    nodes, splats = hierarchy.nodes, hierarchy.splats[: hierarchy.node_count]
    np.testing.assert_array_equal(centres(nodes), splats["centre"])
    np.testing.assert_array_equal(nodes["radius"], splats["radius"])
    assert (nodes["sphere"] >= nodes["radius"]).all()
    assert (nodes["relief"] >= splats["thickness"]).all()
    np.testing.assert_allclose(np.linalg.norm(splats["normal"], axis=1), 1.0, atol=1e-6)
    for cone in ("cone", "print"):
        whole = nodes[f"{cone}_cos"] == EVERYTHING
        assert (nodes[f"{cone}_cos"][~whole] >= 0.0).all()
        squares = nodes[f"{cone}_cos"].astype(float) ** 2 + nodes[f"{cone}_sin"].astype(float) ** 2
        np.testing.assert_allclose(squares, 1.0, atol=1e-6)


def test_spheres_hold_the_spheres_leaves():
    hierarchy = build_hierarchy(icosphere(8))
    leaves, nodes = hierarchy.leaves, hierarchy.nodes
    corners = leaves.positions[leaves.indices].astype(float)
    for node, centre in zip(nodes, centres(nodes), strict=True):
        below = corners[node["leaf_begin"] : node["leaf_end"]].reshape(-1, 3)
        assert np.linalg.norm(below - centre, axis=1).max() <= node["sphere"] * (1 + 1e-6)
    # Small discs of a sphere lie just below its surface and face outwards.
    small = nodes["radius"] < 0.3
    out = centres(nodes)[small]
    assert (np.linalg.norm(out, axis=1) > 0.95).all()
    facing = (hierarchy.splats["normal"][small] * out).sum(axis=1)
    assert facing.min() > 0.9


def test_one_triangle_has_one_node():
    hierarchy = build_hierarchy(MODELS["one triangle"]())
    assert hierarchy.node_count == 1
    assert hierarchy.leaf_kind == "triangles"
    assert hierarchy.nodes[0]["child_count"] == 0
    np.testing.assert_allclose(abs(hierarchy.splats["normal"][0]), np.array([0, 1, 2]) / 5**0.5, atol=1e-6)
    # The right angle's hypotenuse is a diameter.
    assert hierarchy.splats["radius"][0] == pytest.approx(0.5 * math.sqrt(6.0), rel=1e-5)


def test_two_points_share_a_disc():
    hierarchy = build_hierarchy(MODELS["two points"]())
    np.testing.assert_allclose(hierarchy.splats["centre"][0], [0.5, 0, 0], atol=1e-6)
    assert 1.1 <= hierarchy.splats["radius"][0] <= 0.5 + 0.6 * 1.083
    np.testing.assert_allclose(hierarchy.splats["normal"][:, 2], 1.0)
    assert len(hierarchy.splats) == 3


def test_points_all_in_one_cell():
    # 100,000 of them are left to the parts whose work does not grow with the square: octree and cones.
    count = 2000
    cloud = cloud_of(np.zeros((count, 3)), np.tile([0.0, 0.0, 1.0], (count, 1)), 0.1)
    hierarchy = build_hierarchy(cloud)
    assert hierarchy.leaf_count == count
    assert hierarchy.node_count < count
    assert np.abs(centres(hierarchy.nodes)).max() < 1e-6
    assert (hierarchy.nodes["radius"] < 0.11).all()
    assert (hierarchy.nodes["cone_cos"] > 1.0 - 1e-6).all()


def test_kinds_of_leaves():
    mesh = beside_a_far_triangle(bumpy_sphere())
    hybrid, points, cloud = build_hierarchy(mesh), build_hierarchy(mesh, points=True), build_hierarchy(surfel_sphere())
    assert isinstance(hybrid.leaves, Triangles)
    assert isinstance(points.leaves, Surfels)
    assert isinstance(cloud.leaves, Surfels)
    assert (hybrid.closed, points.closed, cloud.closed) == (True, True, False)
    assert not build_hierarchy(terrain()).closed
    assert not build_hierarchy(beside_a_far_triangle(terrain()), points=True).closed
    assert build_hierarchy(surfel_sphere(), points=True).leaf_count == 300


def test_a_point_hierarchy_of_a_mesh_has_its_base_surfels():
    mesh = beside_a_far_triangle(bumpy_sphere())
    points, surfels = build_hierarchy(mesh, points=True), surfels_of_mesh(mesh)
    assert points.leaf_count == len(surfels.positions) == len(mesh.faces)
    for name in ("positions", "normals", "radii"):
        sorted_rows = [np.sort(getattr(cloud, name), axis=0) for cloud in (points.leaves, surfels)]
        np.testing.assert_array_equal(*sorted_rows)
    leaves = points.splats[points.node_count :]
    for field, array in (("centre", "positions"), ("normal", "normals"), ("radius", "radii")):
        np.testing.assert_array_equal(leaves[field], getattr(points.leaves, array))
    assert not leaves["thickness"].any()


def test_min_leaves_thins_the_hierarchy_out():
    counts = [build_hierarchy(bumpy_sphere(8), min_leaves=n).node_count for n in (2, 4, 8)]
    assert counts == sorted(counts, reverse=True)
    assert counts[2] < counts[0] / 2


def test_colours_average_over_the_leaves():
    mesh = icosphere(8)
    # Red where x > 0, blue elsewhere.
    red = mesh.positions[:, 0] > 0
    colors = np.where(red[:, None], [255, 0, 0, 255], [0, 0, 255, 255]).astype(np.uint8)
    colored = mesh_of(mesh.positions, mesh.faces, colors=colors, closed=True)
    for model, points in ((colored, False), (beside_a_far_triangle(colored), True)):
        hierarchy = build_hierarchy(model, points=points)
        assert len(hierarchy.colors) == len(hierarchy.splats)
        np.testing.assert_allclose(hierarchy.colors[0], [127, 0, 127, 255], atol=8)
        # Whole red nodes of the sphere.
        far = (hierarchy.nodes["x"] - hierarchy.nodes["radius"] > 0.1) & (hierarchy.nodes["x"] < 2.0)
        assert far.sum() > 50
        assert (hierarchy.colors[: hierarchy.node_count][far] == [255, 0, 0, 255]).all()
    assert build_hierarchy(mesh).colors is None


def test_names_origins_and_warnings_are_kept():
    origin = np.array([4e5, 5e6, 7.0])
    model = dataclasses.replace(beside_a_far_triangle(icosphere(2)), name="name", origin=origin, warnings=("careful",))
    for points in (False, True):
        hierarchy = build_hierarchy(model, points=points)
        assert (hierarchy.name, hierarchy.warnings) == ("name", ("careful",))
        np.testing.assert_array_equal(hierarchy.origin, origin)


def test_the_same_model_gives_the_same_hierarchy():
    first, again = build_hierarchy(bumpy_sphere()), build_hierarchy(bumpy_sphere())
    np.testing.assert_array_equal(first.nodes, again.nodes)
    np.testing.assert_array_equal(first.splats, again.splats)
    np.testing.assert_array_equal(first.leaves.indices, again.leaves.indices)


def test_a_scaled_model_gives_the_scaled_hierarchy():
    mesh = bumpy_sphere()
    small, large = (build_hierarchy(mesh_of(mesh.positions * np.float32(s), mesh.faces)) for s in (1.0, 1024.0))
    np.testing.assert_array_equal(small.nodes["leaf_begin"], large.nodes["leaf_begin"])
    for field in ("x", "y", "z", "radius", "sphere", "relief"):
        np.testing.assert_allclose(large.nodes[field], 1024.0 * small.nodes[field], rtol=1e-5, atol=1e-3)


def test_progress_is_reported_and_can_cancel():
    calls = []
    build_hierarchy(bumpy_sphere(), progress=lambda stage, fraction: calls.append((stage, fraction)))
    fractions = [fraction for _, fraction in calls]
    assert len(calls) > 3
    assert fractions == sorted(fractions)
    assert 0.0 <= fractions[0] <= fractions[-1] <= 1.0

    def cancel(stage, fraction):
        if fraction > 0.3:
            raise Cancelled

    with pytest.raises(Cancelled):
        build_hierarchy(bumpy_sphere(), progress=cancel)
