import numpy as np
import pytest

from hierarchy.cloud_normals import estimate_normals, orient_normals
from hierarchy.neighbours import nearest_neighbours


def sphere(count, centre=(0, 0, 0), radius=1.0, seed=1):
    directions = np.random.default_rng(seed).normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return (np.asarray(centre) + radius * directions).astype(np.float32), directions


def normals_of(points):
    _, neighbours = nearest_neighbours(points, 16)
    return orient_normals(points, estimate_normals(points, neighbours), neighbours)


@pytest.mark.parametrize("scale", [1e-20, 1.0, 1e20])
def test_a_sphere_faces_outwards(scale):
    points, directions = sphere(4000)
    cosines = np.einsum("ij,ij->i", normals_of((points * scale).astype(np.float32)), directions)
    assert cosines.min() > 0.95
    assert cosines.mean() > 0.999


def test_two_spheres_far_apart_both_face_outwards():
    first, first_out = sphere(1500)
    second, second_out = sphere(1000, centre=(50, 0, 0), radius=3, seed=2)
    normals = normals_of(np.concatenate([first, second]))
    assert np.einsum("ij,ij->i", normals, np.concatenate([first_out, second_out])).min() > 0.9


def test_a_torus_faces_outwards_in_its_hole_too():
    u, v = np.random.default_rng(3).uniform(0, 2 * np.pi, (2, 8000))
    out = np.column_stack([np.cos(u) * np.cos(v), np.sin(u) * np.cos(v), np.sin(v)])
    points = np.column_stack([np.cos(u), np.sin(u), 0 * u]) + 0.35 * out
    assert np.einsum("ij,ij->i", normals_of(points.astype(np.float32)), out).min() > 0.8


def test_a_cube_agrees_across_its_edges():
    grid = np.stack(np.meshgrid(np.linspace(-1, 1, 30), np.linspace(-1, 1, 30)), -1).reshape(-1, 2)
    grid += np.random.default_rng(1).uniform(-0.01, 0.01, grid.shape)
    sides, outs = [], []
    for axis in range(3):
        for sign in (-1, 1):
            sides.append(np.insert(grid * 0.99, axis, sign, axis=1))
            outs.append(np.tile(sign * np.eye(3)[axis], (len(grid), 1)))
    cosines = np.einsum("ij,ij->i", normals_of(np.concatenate(sides).astype(np.float32)), np.concatenate(outs))
    assert cosines.min() > 0
    assert np.median(cosines) > 0.999


def test_terrain_faces_up():
    x, y = np.random.default_rng(1).uniform(-3, 3, (2, 4000))
    points = np.column_stack([x, y, 0.3 * np.sin(2 * x) * np.cos(y)]).astype(np.float32)
    assert normals_of(points)[:, 2].min() > 0.5
    flat = points * np.float32([1, 1, 0])
    np.testing.assert_allclose(normals_of(flat)[:, 2], 1.0, atol=1e-6)


def test_the_side_does_not_depend_on_what_comes_in():
    points, directions = sphere(2000)
    _, neighbours = nearest_neighbours(points, 12)
    estimated = estimate_normals(points, neighbours)
    flipped = np.where(np.random.default_rng(1).random(len(points)) < 0.5, -1, 1)[:, None].astype(np.float32)
    for start in (estimated, -estimated, estimated * flipped):
        assert np.einsum("ij,ij->i", orient_normals(points, start, neighbours), directions).min() > 0.9


@pytest.mark.parametrize("count", [1, 2, 3, 50])
def test_points_on_a_line_or_alone_get_unit_normals_across(count):
    points = np.column_stack([np.arange(count), np.zeros(count), np.zeros(count)]).astype(np.float32)
    normals = normals_of(points)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-6)
    if count > 1:
        np.testing.assert_allclose(normals[:, 0], 0.0, atol=1e-6)
