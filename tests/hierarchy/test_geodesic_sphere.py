import numpy as np
import pytest

from hierarchy.geodesic_sphere import geodesic_sphere, icosahedron
from hierarchy.half_edges import is_closed


@pytest.mark.parametrize("frequency", [1, 2, 3, 10])
def test_counts_and_closure(frequency):
    positions, faces = geodesic_sphere(frequency)
    assert positions.shape == (10 * frequency**2 + 2, 3)
    assert faces.shape == (20 * frequency**2, 3)
    assert is_closed(faces, len(positions))
    np.testing.assert_array_equal(np.unique(faces), np.arange(len(positions)))


def test_vertices_are_on_the_sphere_and_nowhere_twice():
    positions, _ = geodesic_sphere(9)
    np.testing.assert_allclose(np.linalg.norm(positions, axis=1), 1.0, atol=1e-12)
    assert len(np.unique(positions.round(9), axis=0)) == len(positions)


def test_every_face_looks_outwards_and_none_is_a_needle():
    positions, faces = geodesic_sphere(8)
    a, b, c = (positions[faces[:, i]] for i in range(3))
    areas = 0.5 * np.einsum("ij,ij->i", np.cross(b - a, c - a), (a + b + c) / 3)
    assert areas.min() > 0.4 * areas.max()
    assert 0.97 * 4 * np.pi < areas.sum() < 4 * np.pi


def test_the_icosahedron_has_equal_edges():
    corners, faces = icosahedron()
    assert faces.shape == (20, 3)
    lengths = np.linalg.norm(corners[faces] - corners[np.roll(faces, 1, axis=1)], axis=2)
    np.testing.assert_allclose(lengths, 1.0 / np.sin(0.4 * np.pi), atol=1e-12)
