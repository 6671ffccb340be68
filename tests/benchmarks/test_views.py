"""The views are the same every time, and each stands where its name says."""

from __future__ import annotations

import math

import numpy as np
import pytest
from small_models import box, bumpy_sphere, icosphere, terrain, turned

from benchmarks.views import GRAZING_DEGREES, views_of
from hierarchy.model import Mesh, in_file_space

pytest.importorskip("embreex", reason="embreex casts the rays that choose the views")

RESOLUTION = (96, 64)
MESHES = {"bumpy": bumpy_sphere(12), "sphere": icosphere(8), "terrain": terrain(20)}


@pytest.fixture(params=list(MESHES))
def mesh(request) -> Mesh:
    return MESHES[request.param]


def diagonal_of(mesh: Mesh) -> float:
    return float(np.linalg.norm(mesh.positions.max(axis=0) - mesh.positions.min(axis=0)))


def winding_number(mesh: Mesh, point: np.ndarray) -> float:
    """Return the solid angle that the mesh covers, seen from a point, over 4 pi (van Oosterom and Strackee 1983)."""
    a, b, c = np.moveaxis(mesh.positions[mesh.faces].astype(np.float64) - point, 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    dots = [np.einsum("ij,ij->i", *pair) for pair in ((a, b), (b, c), (c, a))]
    below = la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb
    return float(np.arctan2(volume, below).sum() / (2.0 * np.pi))


def test_all_views_are_there_and_the_same_every_time(mesh):
    views, again = views_of(mesh, RESOLUTION), views_of(mesh, RESOLUTION)
    assert list(views) == ["front", *(f"orbit {k}" for k in range(12)), "close-up", "far", "inside", "grazing"]
    for name, view in views.items():
        assert np.array_equal(view.eye_from_model, again[name].eye_from_model)
        assert (view.width, view.height) == RESOLUTION
        assert view.view_angle == math.radians(45.0)


def test_orbit_goes_round_at_one_distance(mesh):
    views = views_of(mesh, RESOLUTION)
    centre = 0.5 * (mesh.positions.min(axis=0).astype(np.float64) + mesh.positions.max(axis=0))
    eyes = np.array([views[f"orbit {k}"].eye for k in range(12)]) - centre
    assert np.allclose(np.linalg.norm(eyes, axis=1), 1.1 * diagonal_of(mesh))
    assert np.allclose(np.degrees(np.arcsin(eyes[:, 1] / np.linalg.norm(eyes, axis=1))), [20.0, -10.0] * 6)
    steps = np.diff(np.unwrap(np.arctan2(eyes[:, 0], eyes[:, 2])))
    assert np.allclose(np.degrees(steps), 30.0)


@pytest.mark.parametrize("name", ["bumpy", "sphere"])
def test_inside_is_in_the_box_and_out_of_the_surface(name):
    mesh = MESHES[name]
    eye = views_of(mesh, RESOLUTION)["inside"].eye
    assert np.all(eye > mesh.positions.min(axis=0))
    assert np.all(eye < mesh.positions.max(axis=0))
    assert abs(winding_number(mesh, eye)) < 0.01
    assert abs(winding_number(mesh, np.zeros(3))) == pytest.approx(1.0)


def test_no_view_from_inside_where_the_surface_fills_its_box():
    views = views_of(box(), RESOLUTION)
    assert "inside" not in views
    assert "grazing" in views


def test_close_up_and_grazing_see_the_surface_they_look_at(mesh):
    views = views_of(mesh, RESOLUTION)
    for name, distance in (("close-up", 0.25), ("grazing", 0.5), ("inside", None)):
        view = views[name]
        triangle, along = brute_first_hit(mesh, view.eye, -view.eye_from_model[2, :3])
        corners = mesh.positions[mesh.faces[triangle]].astype(np.float64)
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        facing = float(view.eye_from_model[2, :3] @ normal / np.linalg.norm(normal))
        assert facing > 0.0, "it is seen from outside"
        if distance is not None:
            assert along == pytest.approx(distance * diagonal_of(mesh), rel=1e-3)
        if name == "grazing":
            assert np.degrees(np.arcsin(facing)) == pytest.approx(GRAZING_DEGREES, abs=0.05)


def brute_first_hit(mesh: Mesh, eye: np.ndarray, direction: np.ndarray) -> tuple[int, float]:
    """Return the triangle that a ray meets first and the distance (Moeller and Trumbore 1997, all triangles)."""
    a, b, c = np.moveaxis(mesh.positions[mesh.faces].astype(np.float64), 1, 0)
    ab, ac = b - a, c - a
    across = np.cross(direction, ac)
    volume = np.einsum("ij,ij->i", ab, across)
    # A triangle along the ray is not hit.
    scale = np.divide(1.0, volume, out=np.full_like(volume, -1e12), where=volume != 0.0)
    u = np.einsum("ij,ij->i", eye - a, across) * scale
    turned_over = np.cross(eye - a, ab)
    v = turned_over @ direction * scale
    along = np.einsum("ij,ij->i", ac, turned_over) * scale
    slack = -1e-6
    hit = (u >= slack) & (v >= slack) & (u + v <= 1.0 - slack) & (along > 0.0)
    along = np.where(hit, along, np.inf)
    return int(np.argmin(along)), float(along.min())


def test_a_mesh_far_from_its_origin_and_turned_has_views_of_itself():
    mesh = bumpy_sphere(8)
    moved = Mesh("moved", mesh.origin, (turned(mesh.positions) + 40.0).astype(np.float32), mesh.faces, mesh.normals)
    views = views_of(moved, RESOLUTION)
    for view in views.values():
        _, distance = brute_first_hit(moved, view.eye, -view.eye_from_model[2, :3])
        assert view.near < distance < view.far


def test_igea_has_its_view_of_record():
    mesh = icosphere(3)
    igea = Mesh("igea.ply", np.array([0.0, 0.0, 0.1]), mesh.positions, mesh.faces, mesh.normals, closed=True)
    view = views_of(igea, RESOLUTION)["front 0.165"]
    assert np.allclose(in_file_space(igea, view.eye), (0.0, 0.0, 0.165))
