import numpy as np
import pytest

from hierarchy.geodesic_sphere import geodesic_sphere
from hierarchy.mesh_normals import Surface, check_normals, make_normals, unit_or_bad, weld_equal


def sphere(turned=False):
    positions, faces = geodesic_sphere(6)
    faces = np.ascontiguousarray(faces[:, ::-1]) if turned else faces
    positions = positions.astype(np.float32)
    return Surface(positions, faces, positions, np.arange(len(positions), dtype=np.int32))


def test_good_normals_are_kept_and_made_unit():
    surface, warnings = sphere(), []
    leaning = surface.positions.astype(float) + np.array([0.1, 0, 0])
    normals = check_normals(surface, leaning * 7e20, True, warnings)
    np.testing.assert_allclose(normals, leaning / np.linalg.norm(leaning, axis=1, keepdims=True), atol=1e-6)
    assert warnings == []


def test_bad_normals_are_made_anew():
    surface, warnings = sphere(), []
    normals = surface.positions.astype(float)
    normals[:4] = [[0, 0, 0], [np.nan, 0, 1], [0, np.inf, 0], [1e-300, 0, 0]]
    checked = check_normals(surface, normals, True, warnings)
    assert np.einsum("ij,ij->i", checked, surface.positions).min() > 0.99
    assert warnings == ["recomputed 4 normals without a direction"]


def test_normals_that_point_into_a_closed_surface_are_turned():
    surface, warnings = sphere(), []
    normals = check_normals(surface, -surface.positions.astype(float), True, warnings)
    assert np.einsum("ij,ij->i", normals, surface.positions).min() > 0.99
    assert warnings == ["turned all normals round: they pointed into the closed surface"]


def test_faces_of_an_open_surface_follow_its_normals():
    surface, warnings = sphere(turned=True), []
    surface.faces = surface.faces[1:]
    before = surface.faces.copy()
    normals = check_normals(surface, surface.positions.astype(float), False, warnings)
    assert np.einsum("ij,ij->i", normals, surface.positions).min() > 0.99
    np.testing.assert_array_equal(surface.faces, before[:, ::-1])
    assert warnings == ["turned all faces round: their normals pointed to the other side"]


def test_a_seam_of_attributes_stays_smooth():
    positions, faces = geodesic_sphere(6)
    positions = positions.astype(np.float32)
    # Every face has vertices of its own, with a colour of its own: all seams.
    corners = np.arange(faces.size, dtype=np.int32).reshape(-1, 3)
    colors = np.repeat(np.arange(len(faces)) % 250, 3).astype(np.uint8)[:, None].repeat(4, axis=1)
    surface = Surface(positions[faces.ravel()], corners, positions, faces.ravel())
    out_positions, out_faces, normals, (out_colors,) = make_normals(surface, [colors])
    assert np.einsum("ij,ij->i", normals, out_positions).min() > 0.999
    np.testing.assert_array_equal(out_colors[out_faces], colors[corners])
    _, merged_faces, _, _ = make_normals(surface, [])
    np.testing.assert_array_equal(merged_faces, faces)


def test_weld_equal_keeps_what_differs_in_anything():
    positions = np.zeros((4, 3), np.float32)
    normals = np.array([[0, 0, 1], [0, 0, 1], [0, 1, 0], [0, 0, 1]], np.float32)
    places = np.array([[0.5, 0], [0.5, 0], [0.5, 0], [0.25, 0]])
    faces = np.array([[0, 1, 2], [1, 2, 3]], np.int32)
    p, f, n, (t,) = weld_equal(positions, faces, normals, [places])
    assert len(p) == len(n) == len(t) == 3
    np.testing.assert_array_equal(n[f], normals[faces])
    np.testing.assert_array_equal(t[f], places[faces])


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e30, 1e300])
def test_any_length_is_made_unit(scale):
    unit, bad = unit_or_bad(np.array([[3, 4, 0], [0, 0, -1]]) * scale)
    np.testing.assert_allclose(unit, [[0.6, 0.8, 0], [0, 0, -1]], rtol=1e-6)
    assert not bad.any()
