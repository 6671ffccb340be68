"""A stand-in looks like its model from afar: it covers it, stays close to it and faces the same way."""

import numpy as np
import pytest
from small_models import bumpy_sphere, icosphere, mesh_of, surfel_sphere

from hierarchy.build import build_hierarchy
from hierarchy.stand_in import WIDEST, stand_in


def test_the_surface_is_covered_but_for_a_hundredth():
    sphere = icosphere(60)
    cloud = stand_in(sphere, 2_000)
    assert 0.9 * 2_000 < len(cloud.positions) <= 2_000
    np.testing.assert_allclose(np.einsum("ij,ij->i", cloud.normals, cloud.positions), 1.0, atol=1e-2)
    directions = np.random.default_rng(3).normal(size=(5_000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    apart = np.linalg.norm(directions[:, None] - cloud.positions, axis=2)
    assert (apart > cloud.radii).all(axis=1).mean() < 0.02
    assert cloud.radii.max() < 0.2


def test_place_scale_and_colours_are_the_models():
    mesh = bumpy_sphere(20)
    mesh = mesh_of(mesh.positions, mesh.faces, colors=np.tile(np.uint8([9, 8, 7, 255]), (len(mesh.positions), 1)))
    cloud = stand_in(mesh, 500)
    assert (cloud.scale, cloud.name) == (mesh.scale, mesh.name)
    np.testing.assert_array_equal(cloud.origin, mesh.origin)
    assert np.unique(cloud.colors, axis=0).tolist() == [[9, 8, 7, 255]]
    assert build_hierarchy(cloud).leaf_count == len(cloud.positions)


def test_a_cloud_keeps_its_normals_and_gets_wider_surfels():
    cloud = surfel_sphere(4_000)
    coarse = stand_in(cloud, 400)
    assert 300 < len(coarse.positions) <= 400
    assert coarse.radii.mean() > 2.0 * cloud.radii.mean()
    assert coarse.radii.max() <= WIDEST * np.abs(cloud.positions).max() / len(coarse.positions) ** 0.5


@pytest.mark.parametrize("faces", [[[0, 1, 2], [0, 1, 1]], [[0, 1, 2]] * 50])
def test_triangles_without_an_area_are_left_out(faces):
    cloud = stand_in(mesh_of([[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces), 40)
    assert len(cloud.positions) > 0
    assert np.isfinite(cloud.normals).all()
    assert np.isfinite(cloud.radii).all()
