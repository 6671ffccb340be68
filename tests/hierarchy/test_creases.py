import numpy as np
import pytest

from hierarchy.creases import smooth_groups
from hierarchy.geodesic_sphere import geodesic_sphere
from hierarchy.load import load_model

# Two triangles a side, counter-clockwise seen from outside.
CUBE = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], np.float32)
CUBE_FACES = np.array(
    [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4], [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6],
     [1, 3, 5], [3, 7, 5]], np.int32)  # fmt: skip


def test_a_cube_has_three_groups_at_a_corner():
    groups, count = smooth_groups(CUBE, CUBE_FACES)
    assert count == 24
    for corner in range(8):
        assert len(np.unique(groups[np.equal(CUBE_FACES, corner)])) == 3
    # Both triangles of a side share the two corners of its diagonal.
    assert len(np.unique(groups[:2])) == 4


def test_a_sphere_has_none():
    positions, faces = geodesic_sphere(6)
    assert smooth_groups(positions.astype(np.float32), faces) is None


def test_a_rough_scan_has_none_although_many_of_its_edges_are_sharp():
    positions, faces = geodesic_sphere(40)
    noise = np.random.default_rng(1).normal(1.0, 0.008, (len(positions), 1))
    assert smooth_groups((positions * noise).astype(np.float32), faces) is None


def test_a_cylinder_is_smooth_around_and_sharp_at_its_rims():
    n = 32
    angles = np.arange(n) * 2 * np.pi / n
    ring = np.stack([np.cos(angles), np.sin(angles)], 1)
    rings = [np.column_stack([ring, np.full(n, z)]) for z in (0, 1)]
    positions = np.concatenate([*rings, [[0, 0, 0], [0, 0, 1]]])
    a, b = np.arange(n), (np.arange(n) + 1) % n
    faces = [np.stack(t, 1) for t in ([a, b, b + n], [a, b + n, a + n], [np.full(n, 2 * n), b, a],
                                      [np.full(n, 2 * n + 1), a + n, b + n])]  # fmt: skip
    groups, count = smooth_groups(positions.astype(np.float32), np.concatenate(faces).astype(np.int32))
    # One vertex of the side and one of the lid at each place of a rim, and the two centres.
    assert count == 4 * n + 2
    assert len(np.unique(groups[: 2 * n])) == 2 * n


def test_a_crease_that_ends_inside_a_surface_leaves_its_end_whole():
    # A fan folded along one spoke only.
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0.0], [1, -0.2, 1.5]], np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5], [0, 5, 1]], np.int32)
    result = smooth_groups(positions, faces)
    assert result is not None
    groups, _ = result
    assert len(np.unique(groups[faces == 1])) == 2


@pytest.mark.parametrize(
    ("name", "sharp"),
    [
        ("igea.ply", False),
        ("rangemap.ply", False),
        ("stanford-bunny.obj", False),
        ("spot.obj", False),
        ("fandisk.obj", True),
    ],
)
def test_real_models(shared_models, name, sharp):
    mesh = load_model(shared_models / name)
    places = len(np.unique(mesh.positions, axis=0))
    assert (len(mesh.positions) > places) == sharp
