import numpy as np
import pytest

from hierarchy.assemble import assemble_mesh, gather_skin, join_parts
from hierarchy.geodesic_sphere import geodesic_sphere
from hierarchy.half_edges import is_closed
from hierarchy.model import Cancelled, in_file_space
from hierarchy.part import Part, UnreadableFile


def sphere(scale=1.0, offset=(0, 0, 0), frequency=6):
    positions, faces = geodesic_sphere(frequency)
    return Part(positions * scale + np.asarray(offset), faces.astype(np.int64))


def assemble(*parts):
    warnings = []
    return assemble_mesh("a", list(parts), warnings)


def test_a_clean_sphere_comes_through_unchanged():
    part = sphere(2.0, (10, 20, 30))
    mesh = assemble(part)
    np.testing.assert_allclose(mesh.origin, [10, 20, 30], atol=1e-12)
    np.testing.assert_allclose(in_file_space(mesh, mesh.positions), part.positions, atol=1e-6)
    np.testing.assert_array_equal(mesh.faces, part.faces)
    np.testing.assert_allclose(mesh.normals, mesh.scale * mesh.positions / 2, atol=0.02)
    assert (mesh.positions.dtype, mesh.faces.dtype, mesh.normals.dtype) == (np.float32, np.int32, np.float32)
    assert mesh.closed
    assert mesh.warnings == ()
    assert mesh.colors is None


@pytest.mark.parametrize("scale", [1e-20, 1e-3, 1e20])
def test_extreme_scales(scale):
    mesh = assemble(sphere(scale))
    assert len(mesh.faces) == 720
    assert mesh.closed
    assert 0.5 < np.abs(mesh.positions).max() <= 1.0
    np.testing.assert_allclose(mesh.normals, in_file_space(mesh, mesh.positions) / scale, atol=0.02)


def test_georeferenced_coordinates():
    mesh = assemble(sphere(0.5, (4.5e6, 5.5e6, 100)))
    assert mesh.closed
    np.testing.assert_allclose(mesh.origin, [4.5e6, 5.5e6, 100], atol=1e-6)
    np.testing.assert_allclose(mesh.scale * np.linalg.norm(mesh.positions, axis=1), 0.5, atol=1e-6)


def test_an_inside_out_surface_is_turned():
    part = sphere()
    part.faces = part.faces[:, ::-1]
    mesh = assemble(part)
    assert np.einsum("ij,ij->i", mesh.normals, mesh.positions).min() > 0.9
    assert mesh.warnings == ("turned all faces round: the closed surface was inside out",)


def test_corners_with_vertices_of_their_own_are_one_surface():
    positions, faces = geodesic_sphere(6)
    mesh = assemble(Part(positions[faces.ravel()], np.arange(faces.size).reshape(-1, 3)))
    assert mesh.closed
    assert len(mesh.positions) == len(positions)


def test_degenerate_faces_go_and_what_they_held_together_stays_closed():
    positions, faces = geodesic_sphere(2)
    # Cut one edge in the middle on one side only, and close the gap with a face that has no area.
    a, b, c = faces[0]
    middle = len(positions)
    # Coordinates on a coarse grid, so that the middle lies exactly on the edge.
    positions = np.concatenate([np.round(positions * 64) / 64, [np.round(positions[[a, b]] * 64).mean(axis=0) / 64]])
    extra = np.array([[a, middle, c], [middle, b, c], [a, b, middle], [a, a, b], [5, 5, 5]])
    mesh = assemble(Part(positions, np.concatenate([faces[1:], extra]).astype(np.int64)))
    assert mesh.closed
    assert not is_closed(mesh.faces, len(mesh.positions))
    assert len(mesh.faces) == len(faces) + 1
    assert mesh.warnings == ("dropped 3 degenerate faces",)


def test_the_box_shrinks_with_what_is_dropped():
    part = sphere()
    part.positions = np.concatenate([part.positions, [[99, 99, 99], [98, 98, 98], [97, 97, 97]]])
    n = len(part.positions)
    part.faces = np.concatenate([part.faces, [[n - 1, n - 2, n - 3]]])
    mesh = assemble(part)
    np.testing.assert_allclose(mesh.origin, 0.0, atol=1e-6)
    assert len(mesh.positions) == n - 3


def test_a_colour_survives_cleaning_at_its_vertex():
    part = sphere()
    part.colors = np.column_stack([(127.5 + 127.5 * part.positions).round(), np.full(len(part.positions), 255)])
    part.colors = part.colors.astype(np.uint8)
    part.faces = part.faces[100:]
    mesh = assemble(part)
    np.testing.assert_allclose(mesh.colors[:, :3], 127.5 + 127.5 * in_file_space(mesh, mesh.positions), atol=0.51)


def test_parts_are_joined_and_an_index_out_of_range_stays_one():
    first, second = sphere(), sphere(1.0, (5, 0, 0))
    first.colors = np.full((len(first.positions), 4), 7, np.uint8)
    second.normals = second.positions - [5, 0, 0]
    first.faces[0, 0] = len(first.positions) + 3
    joined = join_parts([first, second])
    assert joined.colors[0].tolist() == [7] * 4
    assert joined.colors[-1].tolist() == [255] * 4
    assert np.isnan(joined.normals[: len(first.positions)]).all()
    mesh = assemble(first, second)
    assert mesh.warnings[0] == "dropped 1 face with indices out of range"
    positions = in_file_space(mesh, mesh.positions)
    centre = np.where(positions[:, :1] > 2.5, [5.0, 0, 0], [0.0, 0, 0])
    assert np.einsum("ij,ij->i", mesh.normals, positions - centre).min() > 0.9


def test_textures_are_gathered_once():
    image, other = np.zeros((2, 4, 4), np.uint8), np.ones((3, 5, 4), np.uint8)
    parts = [sphere() for _ in range(4)]
    for part, texture in zip(parts, (image, None, other, image), strict=True):
        part.texture, part.texture_coordinates = texture, np.full((len(part.positions), 2), 0.5)
    parts[3].texture_coordinates[0] = np.nan
    skin = gather_skin(parts)
    assert len(skin.textures) == 2
    n = len(parts[0].positions)
    assert skin.texture_of_vertex[::n].tolist() == [0, -1, 1, 0]
    assert skin.texels[::n].tolist() == [[2, 1], [0, 0], [2.5, 1.5], [0, 0]]
    assert gather_skin(parts[1:2]) is None


def test_nothing_left():
    with pytest.raises(UnreadableFile, match="nothing to draw: no face has an area"):
        assemble(Part(np.array([[0, 0, 0], [1, 1, 1], [2, 2, 2]], float), np.array([[0, 1, 2], [0, 0, 1]])))


def test_progress_can_cancel():
    def cancel(stage, fraction):
        raise Cancelled

    with pytest.raises(Cancelled):
        assemble_mesh("a", [sphere()], [], cancel)
