from collections import defaultdict

import numpy as np
import pytest

from hierarchy.geodesic_sphere import geodesic_sphere
from hierarchy.half_edges import is_closed, number_edges, twin_half_edges

TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], np.int32)


def brute_twins(faces):
    """Look every half-edge's edge up in a dictionary."""
    of_edge = defaultdict(list)
    for t, face in enumerate(faces):
        for i in range(3):
            a, b = int(face[i]), int(face[(i + 1) % 3])
            of_edge[frozenset((a, b))].append((3 * t + i, a))
    twins = np.full(faces.size, -1)
    for halves in of_edge.values():
        if len(halves) == 2 and halves[0][1] != halves[1][1]:
            (first, _), (second, _) = halves
            twins[first], twins[second] = second, first
    return twins.reshape(faces.shape), len(of_edge)


def random_faces(seed, count, vertices):
    faces = np.random.default_rng(seed).integers(0, vertices, (4 * count, 3)).astype(np.int32)
    a, b, c = faces.T
    return faces[(a != b) & (b != c) & (c != a)][:count]


@pytest.mark.parametrize("faces", [TETRAHEDRON, random_faces(1, 40, 12), random_faces(2, 2000, 90), TETRAHEDRON[:1]])
def test_twins_are_those_of_a_dictionary(faces):
    vertices = int(faces.max()) + 1
    edges, count = number_edges(faces, vertices)
    twins, brute_count = brute_twins(faces)
    assert count == brute_count
    np.testing.assert_array_equal(twin_half_edges(faces, edges, count), twins)


def test_a_fan_of_a_thousand_faces_around_one_vertex():
    n = 1000
    rim = np.arange(1, n + 1)
    faces = np.stack([np.zeros(n, int), rim, np.roll(rim, -1)], 1).astype(np.int32)
    edges, count = number_edges(faces, n + 1)
    assert count == 2 * n
    np.testing.assert_array_equal(twin_half_edges(faces, edges, count), brute_twins(faces)[0])


def test_euler_on_a_geodesic_sphere():
    positions, faces = geodesic_sphere(7)
    _, edges = number_edges(faces, len(positions))
    assert len(positions) - edges + len(faces) == 2
    assert is_closed(faces, len(positions))


def test_closed_breaks_with_a_hole_a_turned_face_and_a_third_wing():
    assert is_closed(TETRAHEDRON, 4)
    assert not is_closed(TETRAHEDRON[:3], 4)
    turned = TETRAHEDRON.copy()
    turned[0] = turned[0, ::-1]
    assert not is_closed(turned, 4)
    assert not is_closed(np.concatenate([TETRAHEDRON, [[0, 1, 4]]]).astype(np.int32), 5)
    assert not is_closed(TETRAHEDRON[:0], 0)


def test_two_closed_bodies_that_share_an_edge_are_not_closed():
    # Four faces at one edge: no telling which two belong together.
    other = np.array([0, 1, 4, 5])[TETRAHEDRON].astype(np.int32)
    assert not is_closed(np.concatenate([TETRAHEDRON, other]), 6)
