import numpy as np
import pytest

from hierarchy.geodesic_sphere import geodesic_sphere
from hierarchy.vertex_normals import corner_group_normals, vertex_normals


def plain_normals(positions, faces):
    """Sum angle times face normal, one corner after another."""
    sums = np.zeros((len(positions), 3))
    for face in faces:
        p = positions[face].astype(float)
        normal = np.cross(p[1] - p[0], p[2] - p[0])
        normal /= np.linalg.norm(normal)
        for i in range(3):
            u, v = p[(i + 1) % 3] - p[i], p[(i + 2) % 3] - p[i]
            sums[face[i]] += np.arccos(u @ v / np.linalg.norm(u) / np.linalg.norm(v)) * normal
    return sums / np.linalg.norm(sums, axis=1, keepdims=True)


def test_normals_are_those_of_the_plain_sum():
    positions, faces = geodesic_sphere(5)
    positions = positions * (1.0 + 0.2 * np.random.default_rng(3).random((len(positions), 1)))
    np.testing.assert_allclose(vertex_normals(positions, faces), plain_normals(positions, faces), atol=1e-6)


def test_many_threads_sum_to_the_same():
    # Above 4096 faces a thread the sum is cut into chunks.
    positions, faces = geodesic_sphere(40)
    normals = vertex_normals(positions, faces)
    assert np.abs(normals - positions).max() < 2e-3


def test_the_weight_does_not_depend_on_how_a_corner_is_cut():
    # A cube's corner: three right angles, whichever diagonals cut the sides.
    corner = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0]], np.float32)
    faces = np.array([[0, 4, 1], [0, 2, 4], [0, 1, 3], [0, 3, 2]])
    np.testing.assert_allclose(vertex_normals(corner, faces)[0], -np.ones(3) / np.sqrt(3), atol=1e-6)


@pytest.mark.parametrize("scale", [1e-20, 1e-3, 1e20])
def test_scale_does_not_matter(scale):
    positions, faces = geodesic_sphere(4)
    scaled = (positions * scale).astype(np.float32)
    np.testing.assert_allclose(vertex_normals(scaled, faces), vertex_normals(positions, faces), atol=1e-5)


def test_vertices_without_a_direction_get_a_valid_one():
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5], [2, 2, 2], [3, 3, 3], [4, 4, 4]], np.float32)
    # The same face from both sides, a vertex of no face, and a face without area.
    faces = np.array([[0, 1, 2], [0, 2, 1], [4, 5, 6]])
    normals = vertex_normals(positions, faces)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-6)
    np.testing.assert_array_equal(np.abs(normals[:3, 2]), 1.0)
    np.testing.assert_array_equal(normals[3:], np.tile([0, 0, 1], (4, 1)))


def test_groups_keep_the_sides_of_a_fold_apart():
    positions = np.array([[0, 0, 0], [0, 1, 0], [1, 0, 0], [0, 0, 1]], np.float32)
    faces = np.array([[0, 2, 1], [0, 1, 3]], np.int32)
    groups = np.arange(6, dtype=np.int32).reshape(2, 3)
    normals = corner_group_normals(positions, faces, groups, 6)
    np.testing.assert_allclose(normals[:3], np.tile([0, 0, 1], (3, 1)), atol=1e-7)
    np.testing.assert_allclose(normals[3:], np.tile([1, 0, 0], (3, 1)), atol=1e-7)


def test_no_vertices():
    assert vertex_normals(np.empty((0, 3), np.float32), np.empty((0, 3), np.int32)).shape == (0, 3)
