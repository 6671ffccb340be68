import numpy as np
import pytest

from hierarchy.geodesic_sphere import geodesic_sphere
from hierarchy.half_edges import is_closed
from hierarchy.subdivide import subdivide_edges
from hierarchy.unique_rows import unique_positions


def longer_than(limit):
    def excess(positions, attributes, ends):
        return np.linalg.norm(positions[ends[:, 0]] - positions[ends[:, 1]], axis=1) / limit

    return excess


def edge_lengths(positions, faces):
    return np.linalg.norm(positions[faces] - positions[np.roll(faces, -1, axis=1)], axis=2)


def area_vectors(positions, faces):
    p = positions[faces]
    return np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])


TRIANGLES = [
    [[0, 0, 0], [1, 0, 0], [0, 1, 0]],
    [[0, 0, 0], [10, 0, 0], [5, 0.1, 0]],
    [[0, 0, 0], [0.01, 0, 0], [0, 7, 0]],
    [[0, 0, 0], [1, 0, 1], [0, 1, 1]],
]


@pytest.mark.parametrize("triangle", TRIANGLES)
def test_every_edge_ends_below_the_limit_and_the_area_stays(triangle):
    positions = np.array(triangle, float)
    faces = np.array([[0, 1, 2]], np.int32)
    split = subdivide_edges(positions, faces, [], longer_than(0.3), most_faces=100_000)
    assert edge_lengths(split.positions, split.faces).max() <= 0.3
    np.testing.assert_array_equal(split.positions[:3], positions)
    areas = area_vectors(split.positions, split.faces)
    # Equal sums of vectors and of lengths: nothing overlaps, nothing is turned round.
    np.testing.assert_allclose(areas.sum(axis=0), area_vectors(positions, faces)[0], atol=1e-12)
    assert np.linalg.norm(areas, axis=1).sum() == pytest.approx(np.linalg.norm(areas.sum(axis=0)))


def test_neighbours_agree_whatever_they_want():
    # A wish that differs all over the sphere makes every pattern of one, two and three halved edges.
    positions, faces = geodesic_sphere(4)

    def excess(positions, attributes, ends):
        middle = positions[ends].mean(axis=1)
        return longer_than(0.05 + 0.5 * (middle[:, 0] > 0.1) * middle[:, 1] ** 2)(positions, attributes, ends)

    split = subdivide_edges(positions, faces, [], excess, most_faces=10**6)
    assert len(split.faces) > 3 * len(faces)
    assert is_closed(split.faces, len(split.positions))
    sums = np.zeros((len(faces), 3))
    np.add.at(sums, split.source, area_vectors(split.positions, split.faces))
    np.testing.assert_allclose(sums, area_vectors(positions, faces), atol=1e-12)


def test_both_sides_of_a_seam_agree():
    positions, faces = geodesic_sphere(3)
    # Every face has vertices of its own, and only some faces want to be split.
    corners = np.arange(faces.size, dtype=np.int32).reshape(-1, 3)
    placed = positions[faces.ravel()].astype(np.float32)
    wanted = np.repeat(np.random.default_rng(1).random(len(faces)) < 0.2, 3).astype(np.float32)

    def excess(positions, attributes, ends):
        return attributes[0][ends].min(axis=1) * longer_than(0.2)(positions, attributes, ends)

    points, _ = unique_positions(placed)
    split = subdivide_edges(placed, corners, [wanted], excess, most_faces=10**6, points=points)
    merged, _ = unique_positions(split.positions)
    assert len(split.faces) > len(faces)
    assert is_closed(merged[split.faces], merged.max() + 1)
    alone = subdivide_edges(placed, corners, [wanted], excess, most_faces=10**6)
    merged, _ = unique_positions(alone.positions)
    assert not is_closed(merged[alone.faces], merged.max() + 1)


def test_attributes_are_interpolated_in_their_own_type():
    positions = np.array(TRIANGLES[0], np.float32)
    attributes = [positions * 3 + 1, np.array([[0, 255], [10, 255], [21, 0]], np.uint8), np.full(3, 7, np.int32)]
    split = subdivide_edges(positions, np.array([[0, 1, 2]], np.int32), attributes, longer_than(0.8), most_faces=100)
    linear, colors, numbers = split.attributes
    assert (split.positions.dtype, linear.dtype, colors.dtype) == (np.float32, np.float32, np.uint8)
    np.testing.assert_allclose(linear, split.positions * 3 + 1, rtol=1e-6)
    assert set(numbers.tolist()) == {7}
    middle = np.flatnonzero((np.abs(split.positions - [0.5, 0.5, 0]) < 1e-6).all(axis=1))
    np.testing.assert_allclose(colors[middle[0]], [16, 128], atol=1)


@pytest.mark.parametrize("most", [1, 2, 5, 50, 777])
def test_the_number_of_faces_is_bounded_and_the_longest_edges_go_first(most):
    positions = np.array(TRIANGLES[2], float)
    faces = np.array([[0, 1, 2]], np.int32)
    split = subdivide_edges(positions, faces, [], longer_than(1e-4), most_faces=most)
    assert len(split.faces) <= most
    if most == 50:
        assert edge_lengths(split.positions, split.faces).max() < 1.0


def test_nothing_to_split():
    positions, faces = geodesic_sphere(2)
    split = subdivide_edges(positions, faces, [], longer_than(10.0), most_faces=10**6)
    assert split.positions is positions
    np.testing.assert_array_equal(split.faces, faces)
    np.testing.assert_array_equal(split.source, np.arange(len(faces)))


def test_a_wish_that_is_never_satisfied_comes_to_an_end():
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1e-30, 0]], float)
    split = subdivide_edges(
        positions, np.array([[0, 1, 2]], np.int32), [], lambda p, a, e: np.full(len(e), np.inf), most_faces=10_000
    )
    assert len(split.faces) <= 10_000
