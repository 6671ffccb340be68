"""The brute-force visibility on scenes of a few triangles and discs, and against embree on a mesh."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from brute_visibility import ray_directions, visible_discs, visible_triangles

from hierarchy.view import View, look_at

VIEW = look_at((0, 0, 5), (0, 0, 0), (0, 1, 0), math.radians(40), (24, 16), bounds=((0, 0, 0), 4.0))


def quad(z: float, half: float) -> np.ndarray:
    a, b, c, d = ([x, y, z] for x, y in ((-half, -half), (half, -half), (half, half), (-half, half)))
    return np.array([[a, b, c], [a, c, d]])


def test_rays_go_through_the_pixels_centres_row_zero_at_the_top() -> None:
    rays = ray_directions(VIEW).reshape(16, 24, 3)
    assert np.allclose(rays[..., 2], -1.0)
    edge = math.tan(math.radians(20))
    assert rays[0, 0, 1] == pytest.approx(edge * 15 / 16)
    assert rays[0, 0, 0] == pytest.approx(-edge * 1.5 * 23 / 24)
    assert len(ray_directions(VIEW, 3)) == 9 * 16 * 24


def test_what_is_wholly_behind_another_is_hidden() -> None:
    corners = np.concatenate([quad(0.0, 0.3), quad(1.0, 0.5), quad(-1.0, 1.5)])
    assert visible_triangles(corners, VIEW).tolist() == [False, False, True, True, True, True]
    assert visible_triangles(corners[:2], VIEW).all()


def test_both_sides_are_seen_and_copies_tie() -> None:
    corners = np.concatenate([quad(0.0, 1.0), quad(0.0, 1.0)[:, ::-1]])
    assert visible_triangles(corners, VIEW).all()


def test_clip_planes_and_the_space_behind_the_eye_hide() -> None:
    corners = np.concatenate([quad(3.0, 3.0), quad(0.0, 1.0), quad(-3.0, 9.0), quad(7.0, 3.0)])
    view = dataclasses.replace(VIEW, near=2.5, far=7.0)
    assert visible_triangles(corners, view).tolist() == [False, False, True, True, False, False, False, False]


def test_what_lies_between_the_rays_takes_more_of_them() -> None:
    speck = np.array([[[0.01, 0.01, 0.0], [0.07, 0.02, 0.0], [0.02, 0.07, 0.0]]])
    assert not visible_triangles(speck, VIEW).any()
    assert visible_triangles(speck, VIEW, samples=9).all()


def test_what_a_ray_meets_at_a_corner_hides_but_is_not_counted() -> None:
    view = look_at((0, 0, 5), (0, 0, 0), (0, 1, 0), math.radians(40), (1, 1), bounds=((0, 0, 0), 4.0))
    touching = np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]])
    behind = np.array([[[-1.0, -1.0, -1.0], [3.0, -1.0, -1.0], [-1.0, 3.0, -1.0]]])
    assert visible_triangles(np.concatenate([touching, behind]), view).tolist() == [False, False]
    assert visible_triangles(behind, view).all()


def test_discs_hide_each_other() -> None:
    centres = np.array([[0.0, 0, 0], [0, 0, 1], [0, 0, -1], [0, 2.5, 0]])
    normals = np.array([[0.0, 0, 1], [0, 0, -1], [0, 0.6, 0.8], [0, 0, 1]])
    radii = np.array([0.4, 0.6, 1.5, 0.3])
    assert visible_discs(centres, normals, radii, VIEW).tolist() == [False, True, True, False]
    assert visible_discs(centres[:1], normals[:1], radii[:1], VIEW).all()


def test_a_disc_seen_edge_on_is_not_seen() -> None:
    view = look_at((0, 0, 5), (0, 0, 0), (0, 1, 0), math.radians(40), (24, 15), bounds=((0, 0, 0), 4.0))
    assert not visible_discs([[0, 0, 0]], [[0, 1, 0]], [1.0], view).any()


@pytest.mark.parametrize("eye", [(3.0, 1.0, 2.0), (0.1, -2.8, 0.3), (0.2, 0.1, 0.0)], ids=["side", "below", "inside"])
def test_a_bumpy_sphere_agrees_with_embree(eye: tuple[float, float, float]) -> None:
    rtcore_scene = pytest.importorskip("embreex.rtcore_scene", reason="embreex casts the rays to compare with")
    from embreex.mesh_construction import TriangleMesh

    positions, faces = bumpy_sphere()
    view: View = look_at(eye, (0, 0, 0), (0, 1, 0), math.radians(50), (40, 40), bounds=((0, 0, 0), 1.4))
    directions = ray_directions(view).astype(np.float32)
    scene = rtcore_scene.EmbreeScene()
    TriangleMesh(scene, positions.astype(np.float32), faces.astype(np.int32))
    origins = np.tile(view.eye.astype(np.float32), (len(directions), 1))
    met = scene.run(origins, directions, output=True)["primID"]
    seen_by_embree = np.zeros(len(faces), np.bool_)
    seen_by_embree[met[met >= 0]] = True
    seen = visible_triangles(positions[faces], view)
    assert seen.sum() > 50
    # In single precision a hit next to an edge may fall to the neighbour.
    assert (seen != seen_by_embree).sum() <= 2


def bumpy_sphere(rings: int = 14) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and faces of a sphere with lobes that hide each other."""
    theta, phi = np.meshgrid(np.linspace(0.03, math.pi - 0.03, rings), np.linspace(0.0, 2.0 * math.pi, 2 * rings))
    radius = 1.0 + 0.35 * np.sin(5.0 * theta) * np.cos(4.0 * phi)
    shape = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], -1)
    index = np.arange(theta.size).reshape(theta.shape)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    faces = np.concatenate([np.stack([a, c, b], 1), np.stack([a, d, c], 1)])
    return (shape * radius[..., None]).reshape(-1, 3), faces
