"""Sorting the leaves: nothing is lost, vertices follow their triangles, and corners span the primitive."""

import math

import numpy as np
import pytest
from small_models import box, bumpy_sphere, cloud_of, mesh_of, sorted_leaves, surfel_sphere, terrain
from steps_of_codes import steps_of

from hierarchy.frames import tangents
from hierarchy.leaves import SURFEL_CORNERS, corner
from hierarchy.morton import SAME_PLACE, morton_codes


def rows(array):
    """Return the rows in an order of their own, so that two sets of rows can be compared."""
    array = np.asarray(array).reshape(len(array), -1)
    return array[np.lexsort(array.T)]


def colored(model):
    count = len(model.positions)
    return mesh_of(model.positions, model.faces, colors=np.arange(4 * count, dtype=np.uint8).reshape(count, 4))


@pytest.mark.parametrize("make", [bumpy_sphere, box, terrain])
def test_every_triangle_keeps_its_corners(make):
    model = colored(make())
    triangles, _, _ = sorted_leaves(model)
    for name in ("positions", "normals", "colors"):
        np.testing.assert_array_equal(
            rows(getattr(triangles, name)[triangles.indices]), rows(getattr(model, name)[model.faces])
        )
    assert len(triangles) == len(model.faces)


@pytest.mark.parametrize("make", [bumpy_sphere, box, terrain])
def test_shapes_are_those_of_the_sorted_triangles(make):
    triangles, shapes, steps = sorted_leaves(make())
    corners = triangles.positions[triangles.indices].astype(float)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(cross, axis=1)
    np.testing.assert_allclose(shapes.areas, 0.5 * length, rtol=1e-6)
    np.testing.assert_allclose(shapes.normals, cross / length[:, None], atol=1e-6)
    np.testing.assert_allclose(shapes.centres, corners.mean(axis=1), atol=1e-6)
    np.testing.assert_array_equal(steps, steps_of(np.sort(morton_codes(shapes.centres))))
    assert len(shapes.radii) == 0
    # The spheres around the centres hold the corners, and just so.
    reach = np.linalg.norm(corners - shapes.centres[:, None], axis=2).max(axis=1)
    assert (reach <= shapes.extents).all()
    np.testing.assert_allclose(shapes.extents, reach, rtol=1e-5)
    for leaf in range(0, len(triangles), 7):
        for k in range(3):
            found = corner(shapes.positions, shapes.indices, shapes.radii, shapes.normals, leaf, k)
            np.testing.assert_array_equal(found, corners[leaf, k])


def test_vertices_are_numbered_by_their_first_use():
    triangles, _, _ = sorted_leaves(bumpy_sphere())
    _, first = np.unique(triangles.indices.ravel(), return_index=True)
    assert (np.diff(first) > 0).all()
    assert triangles.indices.max() == len(triangles.positions) - 1


def test_vertices_that_no_triangle_uses_are_left_out():
    model = mesh_of([[9, 9, 9], [0, 0, 0], [1, 0, 0], [8, 8, 8], [0, 1, 0]], [[1, 2, 4]])
    triangles, _, _ = sorted_leaves(model)
    np.testing.assert_array_equal(triangles.positions, [[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    assert triangles.colors is None


def test_a_triangle_whose_area_vanishes_has_some_normal():
    _, shapes, _ = sorted_leaves(mesh_of([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]]))
    assert shapes.areas[0] == 0.0
    assert np.linalg.norm(shapes.normals[0]) == 1.0


def test_surfels_stay_together():
    rng = np.random.default_rng(2)
    sphere = surfel_sphere(200)
    cloud = cloud_of(sphere.positions, sphere.normals, sphere.radii, rng.integers(0, 256, (200, 4)).astype(np.uint8))
    surfels, shapes, steps = sorted_leaves(cloud)
    together = [np.column_stack([c.positions, c.normals, c.radii, c.colors]) for c in (surfels, cloud)]
    np.testing.assert_array_equal(rows(together[0]), rows(together[1]))
    assert len(surfels) == 200
    np.testing.assert_array_equal(steps, steps_of(morton_codes(surfels.positions)))
    assert shapes.indices.shape == (0, 3)
    np.testing.assert_array_equal(shapes.extents, surfels.radii)
    # Weights in proportion to the discs' areas.
    np.testing.assert_allclose(shapes.areas / shapes.areas[0], (surfels.radii / surfels.radii[0]) ** 2, rtol=1e-5)


def test_the_octagon_around_a_surfel_holds_its_rim():
    _, shapes, _ = sorted_leaves(cloud_of([[1, 2, 3]], [[-0.48, 0.6, -0.64]], 0.7))
    corners = np.array(
        [corner(shapes.positions, shapes.indices, shapes.radii, shapes.normals, 0, k) for k in range(SURFEL_CORNERS)]
    )
    normal = shapes.normals[0].astype(float)
    o1, o2 = np.array(tangents(*normal)).reshape(2, 3)
    offset = corners - shapes.positions[0].astype(float)
    np.testing.assert_allclose(offset @ normal, 0.0, atol=1e-6)
    angle = np.linspace(0.0, 2.0 * math.pi, 100)
    rim = 0.7 * np.stack([np.cos(angle), np.sin(angle)], 1)
    flat = np.stack([offset @ o1, offset @ o2], 1)
    for a, b in zip(flat, np.roll(flat, -1, axis=0), strict=True):
        # The rim lies left of every side of the octagon.
        left = (b - a)[0] * (rim - a)[:, 1] - (b - a)[1] * (rim - a)[:, 0]
        assert left.min() >= -1e-6
        assert np.linalg.norm(0.5 * (a + b)) == pytest.approx(0.7, rel=1e-5)


def test_a_thousand_coincident_triangles_stay_in_their_order():
    # Whatever sorts them: a machine's fastest sort may put equal codes into any order.
    colors = np.zeros((3000, 4), np.uint8)
    colors[:, 0], colors[:, 1] = np.arange(3000) // 3 % 256, np.arange(3000) // 768
    corners = np.tile([[0, 0, 0], [1, 0, 0], [0, 1, 0]], (1000, 1))
    model = mesh_of(corners, np.arange(3000).reshape(-1, 3), colors=colors)
    triangles, _, steps = sorted_leaves(model)
    np.testing.assert_array_equal(triangles.colors, colors)
    assert (steps[1:] == SAME_PLACE).all()
