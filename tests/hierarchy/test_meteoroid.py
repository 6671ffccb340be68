import numpy as np
import pytest

import hierarchy.meteoroid as meteoroid_module
from hierarchy.geodesic_sphere import geodesic_sphere
from hierarchy.half_edges import is_closed
from hierarchy.meteoroid import make_meteoroid
from hierarchy.sides import signed_volume
from hierarchy.vertex_normals import vertex_normals


@pytest.fixture(scope="module")
def meteoroid():
    return make_meteoroid(40_000)


def test_size_and_topology(meteoroid):
    assert abs(len(meteoroid.faces) - 40_000) < 1000
    assert meteoroid.closed
    assert is_closed(meteoroid.faces, len(meteoroid.positions))
    assert signed_volume(meteoroid.positions, meteoroid.faces) > 0.0
    radii = np.linalg.norm(meteoroid.positions, axis=1)
    assert 0.6 < radii.min() < 0.95 < radii.max() < 1.2


def test_origin_is_the_centre_of_the_bounding_box(meteoroid):
    lowest, highest = meteoroid.positions.min(axis=0), meteoroid.positions.max(axis=0)
    np.testing.assert_allclose(lowest + highest, 0.0, atol=1e-6)


def mean_angle_to_normals_of_faces(model):
    from_faces = vertex_normals(model.positions, model.faces)
    return np.degrees(np.arccos(np.clip((from_faces * model.normals).sum(axis=1), -1, 1))).mean()


def test_normals_are_those_of_the_surface(meteoroid):
    np.testing.assert_allclose(np.linalg.norm(meteoroid.normals, axis=1), 1.0, atol=1e-6)
    # Half the edge length with the same octaves: the normals of faces converge to these, with the square of it.
    coarse = mean_angle_to_normals_of_faces(meteoroid)
    fine = mean_angle_to_normals_of_faces(make_meteoroid(150_000))
    assert coarse < 5.0
    assert fine < 0.4 * coarse


def test_it_is_rough_at_every_scale(meteoroid):
    # A bare lump would have no spread of normals within a patch of a tenth of a radius.
    directions = meteoroid.positions / np.linalg.norm(meteoroid.positions, axis=1, keepdims=True)
    patch = directions @ directions[0] > np.cos(0.1)
    mean = meteoroid.normals[patch].mean(axis=0)
    angles = np.degrees(np.arccos(np.clip(meteoroid.normals[patch] @ (mean / np.linalg.norm(mean)), -1, 1)))
    assert 5.0 < angles.mean() < 45.0


def test_it_is_the_same_every_time(meteoroid):
    np.testing.assert_array_equal(make_meteoroid(40_000).positions, meteoroid.positions)


def test_detail_of_keeps_the_surface_while_the_triangles_change(meteoroid):
    # The vertices of a sphere cut half as finely are among those of the finer one: same octaves, same places.
    coarse = make_meteoroid(500, detail_of=40_000)
    fine = make_meteoroid(2_000, detail_of=40_000)
    fine_places = {tuple(np.round(p + fine.origin, 6)) for p in fine.positions.astype(np.float64)}
    shared = [tuple(np.round(p + coarse.origin, 6)) in fine_places for p in coarse.positions.astype(np.float64)]
    assert np.mean(shared) > 0.9
    bare = make_meteoroid(500)
    assert np.abs(bare.positions - coarse.positions).max() > 1e-3
    np.testing.assert_array_equal(make_meteoroid(40_000, detail_of=40_000).positions, meteoroid.positions)


@pytest.mark.parametrize("triangles", [20, 500, 20_000])
def test_every_crater_in_reach_is_found(triangles):
    # One block that holds the whole sphere keeps every crater.
    blocks = make_meteoroid(triangles)
    directions, _ = geodesic_sphere(round((triangles / 20) ** 0.5))
    craters = meteoroid_module._craters()
    assert len(meteoroid_module._craters_near(directions, craters)) == len(craters)
    octaves = meteoroid_module._octaves(round((triangles / 20) ** 0.5))
    heights = [meteoroid_module._height(*direction, craters, octaves) for direction in directions]
    positions = np.asarray(heights)[:, None] * directions
    np.testing.assert_allclose(blocks.positions, positions - blocks.origin, atol=1e-6)


def test_the_smallest_and_the_impossible():
    assert len(make_meteoroid(20).faces) == 20
    with pytest.raises(ValueError, match="triangles"):
        make_meteoroid(19)
