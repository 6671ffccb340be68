"""The footprint of a disc against looking at every primitive of the model."""

import math

import numpy as np
import pytest
from small_models import (
    box,
    bumpy_sphere,
    cloud_of,
    grid,
    icosphere,
    mesh_of,
    sorted_leaves,
    surfel_sphere,
    terrain,
    thin_sheet,
)

from hierarchy.assemble import assemble_mesh
from hierarchy.build import build_hierarchy
from hierarchy.cones import EVERYTHING, balls_of_chunks, bounding_cap, unit_vectors
from hierarchy.footprints import BORDER, FAR_SIDE, RIM_POINTS
from hierarchy.frames import tangents
from hierarchy.part import Part

MODELS = {
    "icosphere": lambda: icosphere(4),
    "bumpy sphere": lambda: bumpy_sphere(5),
    "box": box,
    "terrain": terrain,
    "thin sheet": thin_sheet,
    "one triangle": lambda: mesh_of([[0, 0, 0], [1, 0, 0], [0, 2, 1]], [[0, 1, 2]]),
    "two opposite triangles": lambda: mesh_of([[0, 0, 0], [1, 0, 0], [0, 2, 1]], [[0, 1, 2], [0, 2, 1]]),
    "surfel sphere": surfel_sphere,
    "two surfels": lambda: cloud_of([[0, 0, 0], [1, 0, 0]], [[0, 0, 1], [0.6, 0, 0.8]], [0.5, 0.2]),
    "all in one cell": lambda: cloud_of(np.zeros((50, 3)), surfel_sphere(50).normals, 0.1),
}

# What a comparison with single-precision numbers leaves open, relative.
OPEN = 1e-5


def measured(model):
    _, shapes, _ = sorted_leaves(model)
    return build_hierarchy(model, min_leaves=2), shapes


def distances(shapes, centre):
    """Return how far every leaf is from a point: the nearest of its centre and corners, or its rim."""
    to_centre = np.linalg.norm(shapes.centres - centre, axis=1)
    if not len(shapes.indices):
        return np.maximum(to_centre - shapes.radii, 0.0)
    to_corners = np.linalg.norm(shapes.positions[shapes.indices] - centre, axis=2)
    return np.minimum(to_centre, to_corners.min(axis=1))


def footprint(hierarchy, shapes, node, scale):
    """Return which leaves are in a node's footprint, with its radius scaled; and which of them are its own."""
    me, normal = hierarchy.nodes[node], hierarchy.splats["normal"][node].astype(float)
    centre = np.array([me["x"], me["y"], me["z"]], float)
    leaf = np.arange(hierarchy.leaf_count)
    own = (me["leaf_begin"] <= leaf) & (leaf < me["leaf_end"])
    near = distances(shapes, centre) <= scale * float(me["radius"])
    return own | (near & (shapes.normals @ normal >= FAR_SIDE)), own, centre, normal


def cap_cosine(normals):
    cap = np.empty(4)
    vectors = unit_vectors(normals)
    bounding_cap(vectors, balls_of_chunks(vectors), 0, len(normals), cap, np.empty((4, 3)))
    return cap[3]


def overhang(shapes, inside, centre, normal, radius):
    """Return how far the disc's rim is from the bounding spheres of a footprint's leaves, the radius at most."""
    o1, o2 = np.array(tangents(*normal)).reshape(2, 3)
    angle = np.arange(RIM_POINTS) * 2.0 * math.pi / RIM_POINTS
    rim = centre + radius * (np.cos(angle)[:, None] * o1 + np.sin(angle)[:, None] * o2)
    spheres = shapes.centres[inside].astype(float)
    if len(shapes.indices):
        corners = shapes.positions[shapes.indices[inside]].astype(float)
        extents = np.linalg.norm(corners - spheres[:, None], axis=2).max(axis=1)
    else:
        extents = shapes.radii[inside].astype(float)
    gaps = np.maximum(np.linalg.norm(rim[:, None] - spheres, axis=2) - extents, 0.0).min(axis=1)
    return min(gaps.max(), radius)


def expected(hierarchy, shapes, node, scale):
    """Return cosine and relief of a node's footprint, its radius scaled, and the overhang over the radius."""
    inside, own, centre, normal = footprint(hierarchy, shapes, node, scale)
    heights = np.abs((shapes.centres[inside & ~own] - centre) @ normal)
    relief = max(heights.max(initial=0.0), float(hierarchy.splats["thickness"][node]))
    radius = float(hierarchy.nodes["radius"][node])
    gap = 0.0 if hierarchy.closed else overhang(shapes, inside, centre, normal, radius)
    if gap > BORDER * radius:
        return EVERYTHING, max(relief, gap), gap / radius
    return cap_cosine(shapes.normals[inside]), relief, gap / radius


@pytest.mark.parametrize("name", MODELS)
def test_cones_hold_every_normal_of_the_footprint(name):
    hierarchy, shapes = measured(MODELS[name]())
    for node, me in enumerate(hierarchy.nodes):
        inside, own, _, _ = footprint(hierarchy, shapes, node, 1.0 - OPEN)
        assert inside[own].all()
        if me["print_cos"] == EVERYTHING:
            continue
        axis = np.array([me["print_x"], me["print_y"], me["print_z"]], float)
        normals = shapes.normals[inside].astype(float)
        angles = np.arctan2(np.linalg.norm(np.cross(normals, axis), axis=1), normals @ axis)
        assert angles.max() <= math.acos(me["print_cos"]) + 1e-6


@pytest.mark.parametrize("name", MODELS)
def test_cones_and_reliefs_are_little_more_than_those_of_the_footprint(name):
    hierarchy, shapes = measured(MODELS[name]())
    compared = everything = 0
    wider, higher = [], []
    for node, me in enumerate(hierarchy.nodes):
        # The larger the footprint, the smaller the cosine and the larger the relief.
        small, large = (expected(hierarchy, shapes, node, scale) for scale in (1.0 - OPEN, 1.0 + OPEN))
        if abs(small[2] - BORDER) < 1e-4 or small[2] != large[2]:
            continue
        compared += 1
        assert me["print_cos"] <= small[0] + 1e-6
        slack = 1e-6 * float(me["sphere"])
        assert me["relief"] >= small[1] - slack
        if large[0] != EVERYTHING and me["print_cos"] != EVERYTHING:
            wider.append((math.acos(me["print_cos"]) + 0.01) / (math.acos(large[0]) + 0.01))
        higher.append((me["relief"] + slack) / (large[1] + slack))
        everything += int(me["print_cos"] == EVERYTHING) - int(large[0] < 1e-6)
    assert compared >= 0.9 * hierarchy.node_count
    assert np.mean(wider or 1.0) < 1.06
    assert np.mean(higher) < 1.1
    assert everything <= 0.03 * compared


@pytest.mark.parametrize("name", MODELS)
def test_footprints_are_never_narrower_than_their_nodes(name):
    nodes = measured(MODELS[name]())[0].nodes
    assert (nodes["print_cos"] <= nodes["cone_cos"] + 1e-6).all()
    np.testing.assert_allclose(
        np.linalg.norm(np.stack([nodes["print_x"], nodes["print_y"], nodes["print_z"]]), axis=0), 1.0, atol=1e-6
    )
    # Sine and cosine belong together; that of everything is -1.
    squares = nodes["print_sin"].astype(float) ** 2 + nodes["print_cos"].astype(float) ** 2
    np.testing.assert_allclose(squares, 1.0, atol=1e-6)
    assert not nodes["print_sin"][nodes["print_cos"] == EVERYTHING].any()


@pytest.mark.parametrize("scale", [1e-3, 0.7, 3.0, 1e3])
def test_corners_on_a_rim_are_under_a_disc_or_not_whatever_the_scale(scale):
    """As far from the centre as the disc reaches, they were on either side of it by rounding."""
    mesh = bumpy_sphere(12)
    parts = [Part(mesh.positions * np.float64(each), mesh.faces.astype(np.int64)) for each in (1.0, scale)]
    one, other = (build_hierarchy(assemble_mesh("bumpy sphere", [part], [])) for part in parts)
    ratio = float(one.nodes["radius"][0] / other.nodes["radius"][0])
    np.testing.assert_allclose(other.nodes["relief"] * ratio, one.nodes["relief"], rtol=1e-4)
    np.testing.assert_allclose(other.nodes["print_cos"], one.nodes["print_cos"], atol=1e-4)


def test_a_border_is_silhouette_and_the_inside_is_not():
    hierarchy, _ = measured(mesh_of(*grid(32)))
    nodes = hierarchy.nodes
    radius = nodes["radius"].astype(float)
    to_border = 1.0 - np.maximum(np.abs(nodes["x"]), np.abs(nodes["y"])).astype(float)
    everywhere = nodes["print_cos"] == EVERYTHING
    # Discs that stay within the square lie on the surface all over.
    assert (to_border > 1.01 * radius).sum() > 300
    assert not everywhere[to_border > 1.01 * radius].any()
    assert not nodes["relief"][to_border > 1.01 * radius].any()
    # Big discs of which a third of the radius hangs over the border do not.
    hanging = (to_border < 0.67 * radius) & (radius > 0.2)
    assert hanging.sum() > 10
    assert everywhere[hanging].all()
    assert (nodes["relief"][hanging] > BORDER * radius[hanging]).all()
    assert (nodes["relief"] <= radius).all()


def test_a_closed_surface_has_no_borders():
    positions, faces = grid(8)
    assert not build_hierarchy(mesh_of(positions, faces, closed=True)).nodes["relief"].any()
    assert build_hierarchy(mesh_of(positions, faces)).nodes["relief"].any()


def two_patches(height, normals):
    """Return two strips of surfels side by side, `height` apart along z, with a normal each."""
    x, y = (part.ravel() for part in np.meshgrid(np.linspace(-1.0, -0.05, 20), np.linspace(-1.0, 1.0, 40)))
    patch = np.stack([x, y, np.zeros(len(x))], 1)
    positions = np.concatenate([patch, patch * [-1, 1, 1] + [0.0, 0.0, height]])
    return cloud_of(positions, np.repeat(np.array(normals, float), len(x), axis=0), 0.06)


def in_the_middle_of_the_left(hierarchy):
    """Return the nodes of the left strip whose discs reach over to the right one, but over no border."""
    nodes = hierarchy.nodes
    left, right = nodes["x"] - nodes["radius"], nodes["x"] + nodes["radius"]
    found = nodes[(nodes["x"] < -0.05) & (left > -0.95) & (right > 0.0) & (np.abs(nodes["y"]) < 0.6)]
    assert len(found) > 3
    return found[found["cone_cos"] > 1.0 - 1e-6]


def test_a_patch_beside_a_crease_knows_what_its_disc_overhangs():
    slope = math.radians(50.0)
    hierarchy = build_hierarchy(two_patches(0.0, [[0, 0, 1], [math.sin(slope), 0, math.cos(slope)]]))
    flat = in_the_middle_of_the_left(hierarchy)
    assert len(flat) > 3
    np.testing.assert_allclose(np.degrees(np.arccos(flat["print_cos"])), 25.0, atol=0.1)


def test_a_step_under_the_rim_is_relief():
    flat = in_the_middle_of_the_left(build_hierarchy(two_patches(0.02, [[0, 0, 1], [0, 0, 1]])))
    assert len(flat) > 3
    np.testing.assert_allclose(flat["relief"], 0.02, atol=1e-6)
    assert (flat["print_cos"] > 1.0 - 1e-6).all()
    level = in_the_middle_of_the_left(build_hierarchy(two_patches(0.0, [[0, 0, 1], [0, 0, 1]])))
    np.testing.assert_allclose(level["relief"], 0.0, atol=1e-6)


def test_the_far_side_of_a_thin_sheet_does_not_count():
    # Two triangles far above and below make z = 0 a border of cells, so that nodes hold one side each.
    sheet = thin_sheet(16, 0.02)
    far = np.array([[0, 0, 1], [0.1, 0, 1], [0, 0.1, 1], [0, 0, -1], [0, 0.1, -1], [0.1, 0, -1]])
    positions = np.concatenate([sheet.positions + np.array([0, 0, 0.01]), far])
    faces = np.concatenate([sheet.faces, len(sheet.positions) + np.arange(6).reshape(2, 3)])
    hierarchy, _ = measured(mesh_of(positions, faces, closed=True))
    nodes = hierarchy.nodes
    one_sided = (nodes["sphere"] < 0.9) & (np.abs(nodes["z"]) < 0.02) & (nodes["cone_cos"] > 0.9)
    assert one_sided.sum() > 500
    assert nodes["radius"][one_sided].max() > 0.5
    assert (nodes["print_cos"][one_sided] > 1.0 - 1e-6).all()
    assert nodes["relief"][one_sided].max() < 1e-6
