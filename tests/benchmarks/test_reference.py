"""Ray casting of meshes against pictures known in closed form."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.errors import UsageError
from benchmarks import rays
from benchmarks.rays import RayCaster, Sample
from benchmarks.reference import Reference, cast, load_reference, save_reference
from hierarchy.model import Mesh
from hierarchy.view import View, look_at

pytest.importorskip("embreex", reason="embreex casts the reference rays")


def mesh_of(positions: object, faces: object, normals: object) -> Mesh:
    return Mesh(
        "test",
        np.zeros(3),
        np.asarray(positions, np.float32),
        np.asarray(faces, np.int32),
        np.asarray(normals, np.float32),
    )


def square(z: float, half: float = 0.5, centre: tuple[float, float] = (0.0, 0.0), flip: bool = False) -> Mesh:
    x, y = centre
    positions = [(x - half, y - half, z), (x + half, y - half, z), (x + half, y + half, z), (x - half, y + half, z)]
    faces = np.array([(0, 1, 2), (0, 2, 3)])
    normal = (0.0, 0.0, -1.0 if flip else 1.0)
    return mesh_of(positions, faces[:, ::-1] if flip else faces, [normal] * 4)


def sphere(rings: int = 96) -> Mesh:
    """Return a unit sphere of latitudes and longitudes with exact normals."""
    theta, phi = np.meshgrid(np.linspace(0.0, np.pi, rings + 1), np.linspace(0.0, 2.0 * np.pi, 2 * rings + 1))
    points = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], -1)
    index = np.arange(points[..., 0].size).reshape(theta.shape)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    faces = np.concatenate([np.stack([a, c, b], 1), np.stack([a, d, c], 1)])
    return mesh_of(points.reshape(-1, 3), faces, points.reshape(-1, 3))


def front_view(width: int = 40, height: int = 30, distance: float = 2.0) -> View:
    """Look from +z so that a unit length at the origin covers 10 pixels."""
    angle = 2.0 * math.atan(0.5 * height / (10.0 * distance))
    return look_at((0, 0, distance), (0, 0, 0), (0, 1, 0), angle, (width, height), bounds=((0, 0, 0), 2.0))


def test_square_covers_its_pixels_exactly() -> None:
    # Half a width of 0.55 ends 5.5 pixels from the middle of the picture, at (20, 15): in the middle of a pixel.
    picture = cast(square(0.0, half=0.55), front_view(), samples=4)
    expected_x, expected_y = np.zeros(40), np.zeros(30)
    expected_x[15:25], expected_y[10:20] = 1.0, 1.0
    expected_x[[14, 25]] = expected_y[[9, 20]] = 0.5
    assert np.array_equal(picture.coverage, np.outer(expected_y, expected_x).astype(np.float32))
    hit = picture.coverage > 0.0
    assert np.allclose(picture.depth[hit], 2.0, rtol=1e-6)
    assert np.isinf(picture.depth[~hit]).all()
    assert np.allclose(picture.normal[hit], (0.0, 0.0, 1.0))
    assert not picture.normal[~hit].any()
    assert picture.focal_pixels == pytest.approx(20.0)


def parallel_view(distance: float) -> View:
    """Look from +z so that a unit length covers 10 pixels."""
    bounds = ((0, 0, 0), 2.0)
    return look_at((0, 0, distance), (0, 0, 0), (0, 1, 0), 0.7, (40, 30), bounds=bounds, parallel_scale=1.5)


@pytest.mark.parametrize("distance", [0.5, 2.0, 100.0])
def test_parallel_rays_see_a_square_alike_from_anywhere(distance: float) -> None:
    for z in (-1.0, 0.0, 1.0):
        picture = cast(square(z, half=0.55, centre=(0.2, 0.3)), parallel_view(distance), samples=4)
        perspective = cast(square(0.0, half=0.55, centre=(0.2, 0.3)), front_view(), samples=4)
        assert np.array_equal(picture.coverage, perspective.coverage)
        assert np.allclose(picture.depth[picture.coverage > 0.0], distance - z, atol=1e-5)


def test_up_is_row_zero_and_right_is_the_last_column() -> None:
    rows, columns = np.nonzero(cast(square(0.0, 0.2, centre=(1.0, 0.6)), front_view(), 1).coverage)
    assert (rows.min(), rows.max()) == (7, 10)  # 15 - 6 -+ 2
    assert (columns.min(), columns.max()) == (28, 31)  # 20 + 10 -+ 2


def test_depth_is_along_the_axis_not_along_the_ray() -> None:
    picture = cast(square(-1.0, half=3.0), front_view(), 2)
    assert np.allclose(picture.depth, 3.0, rtol=1e-6)


def test_the_nearest_wins_and_back_faces_count() -> None:
    near, far = square(0.5, 0.2, flip=True), square(-0.5, 1.0)
    both = mesh_of(
        np.concatenate([far.positions, near.positions]),
        np.concatenate([far.faces, near.faces + 4]),
        np.concatenate([far.normals, near.normals]),
    )
    picture = cast(both, front_view(), 1)
    assert picture.depth[15, 20] == pytest.approx(1.5)
    assert picture.normal[15, 20, 2] == -1.0  # as the mesh has it, not turned to the eye
    assert picture.depth[15, 14] == pytest.approx(2.5)


def test_normals_of_a_triangle_are_interpolated_linearly_over_it() -> None:
    corners = np.array([(-1.0, -1.0, 0.0), (1.4, -0.8, 0.3), (0.1, 1.2, -0.4)])
    normals = np.array([(0.6, 0.0, 0.8), (0.0, 0.6, 0.8), (0.0, -0.28, 0.96)])
    view = look_at((0.5, -0.3, 3), (0, 0, 0), (0, 1, 0), 0.7, (16, 16), bounds=((0, 0, 0), 2.0))
    picture = cast(mesh_of(corners, [(0, 1, 2)], normals), view, 1)
    rows, columns = np.nonzero(picture.coverage)
    assert rows.size > 30
    eye_points = np.stack(
        [(columns - 7.5) / view.focal_pixels, (7.5 - rows) / view.focal_pixels, -np.ones(rows.size)], -1
    )
    points = (eye_points * picture.depth[rows, columns, None]) @ view.eye_from_model[:3, :3] + view.eye
    weights = np.linalg.solve(corners.T, points.T)  # the corners are independent: points = corners^T weights
    assert np.allclose(weights.sum(axis=0), 1.0, atol=1e-5)
    expected = normals.T @ weights
    assert np.allclose(picture.normal[rows, columns], (expected / np.linalg.norm(expected, axis=0)).T, atol=1e-5)


def test_sphere_from_the_side_agrees_with_its_equation() -> None:
    view = look_at((3, 1, 2), (0.2, 0.1, 0), (0, 1, 0), math.radians(40), (96, 80), bounds=((0, 0, 0), 1.0))
    picture = cast(sphere(), view, 3)
    distance = float(np.linalg.norm(view.eye))
    # Solid angle of a sphere's cone against that of the picture: sum of coverage over pixels weighted by cos^3 / f^2.
    x, y = np.meshgrid(np.arange(96) - 47.5, np.arange(80) - 39.5)
    cosine = view.focal_pixels / np.sqrt(x**2 + y**2 + view.focal_pixels**2)
    solid_angle = float((picture.coverage * cosine**3).sum()) / view.focal_pixels**2
    expected = 2.0 * math.pi * (1.0 - math.sqrt(1.0 - 1.0 / distance**2))
    assert solid_angle == pytest.approx(expected, rel=3e-3)
    full = picture.coverage == 1.0
    directions = np.stack([x, -y, np.full_like(x, -view.focal_pixels)], -1)[full] / view.focal_pixels
    points = (directions * picture.depth[full][:, None]) @ view.eye_from_model[:3, :3] + view.eye
    assert np.median(np.abs(np.linalg.norm(points, axis=1) - 1.0)) < 1e-3
    assert np.quantile(np.linalg.norm(points - picture.normal[full], axis=1), 0.9) < 5e-3


def same(a: Reference, b: Reference) -> bool:
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in ("normal", "depth", "coverage"))


def test_parts_threads_and_the_skipping_of_empty_pixels_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh, view = sphere(12), front_view(distance=3.0)
    once = cast(mesh, view, 2)
    monkeypatch.setattr(rays, "RAYS_PER_CALL", 37)
    monkeypatch.setattr(rays, "pixels_near", lambda *_: np.arange(30 * 40))
    assert same(cast(mesh, view, 2), once)
    monkeypatch.setattr(rays.os, "cpu_count", lambda: 1)
    assert same(cast(mesh, view, 2), once)


def test_one_caster_serves_many_views() -> None:
    mesh = sphere(12)
    caster = RayCaster(mesh)
    for distance in (3.0, 2.0):
        view = front_view(distance=distance)
        assert same(cast(caster, view, 2), cast(mesh, view, 2))


def test_the_mean_is_that_of_the_samples_shown_on_the_way() -> None:
    shown: list[Sample] = []
    picture = cast(square(0.0, half=0.55), front_view(), 2, shown.append)
    assert len(shown) == 4
    hits = np.mean([np.isfinite(sample.depth) for sample in shown], axis=0)
    assert np.array_equal(picture.coverage, hits.astype(np.float32))
    # The points go along the rows first: the right edge, in the middle of column 25, parts the left from the right.
    assert [bool(np.isfinite(sample.depth[15, 25])) for sample in shown] == [True, False, True, False]
    assert [bool(np.isfinite(sample.depth[9, 20])) for sample in shown] == [False, False, True, True]
    assert all(sample.color is None for sample in shown)


def test_colors_are_interpolated_as_the_normals_are_but_not_scaled() -> None:
    corners = np.array([(-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (0.0, 1.0, 0.0)])
    colors = np.array([(255, 0, 0, 255), (0, 255, 0, 255), (0, 0, 255, 9)], np.uint8)
    mesh = replace(mesh_of(corners, [(0, 1, 2)], [(0, 0, 1)] * 3), colors=colors)
    shown: list[Sample] = []
    cast(mesh, front_view(), 1, shown.append)
    color = shown[0].color
    assert color is not None
    hit = np.isfinite(shown[0].depth)
    rows, columns = np.nonzero(hit)
    blue = 0.5 + 0.5 * (14.5 - rows) / 10.0  # the height over the triangle's lower side
    green = 0.5 * (1.0 - blue) + 0.5 * (columns - 19.5) / 10.0
    assert np.allclose(color[hit], np.stack([1.0 - green - blue, green, blue], -1), atol=1e-5)
    assert not color[~hit].any()


def test_an_eye_inside_the_model_sees_it_all_around() -> None:
    view = look_at((0.1, 0, 0), (0, 0, 0.4), (0, 1, 0), 1.5, (12, 12), bounds=((0, 0, 0), 1.0))
    assert (cast(sphere(24), view, 2).coverage == 1.0).all()


def test_a_model_behind_the_eye_is_not_seen() -> None:
    view = look_at((0, 0, 3), (0, 0, 6), (0, 1, 0), 1.5, (12, 12), bounds=((0, 0, 0), 1.0))
    picture = cast(sphere(12), view, 1)
    assert not picture.coverage.any()
    assert np.isinf(picture.depth).all()


def test_no_samples_are_refused() -> None:
    with pytest.raises(ValueError, match="at least one sample"):
        cast(square(0.0), front_view(), 0)


def test_a_saved_reference_comes_back_and_a_damaged_one_does_not(tmp_path: Path) -> None:
    path = tmp_path / "truth.npz"
    assert load_reference(path) is None
    made = cast(sphere(12), front_view(), 2)
    save_reference(path, made)
    loaded = load_reference(path)
    assert loaded is not None
    assert same(loaded, made)
    assert (loaded.focal_pixels, loaded.picture) == (made.focal_pixels, None)
    save_reference(path, replace(made, picture=np.full((30, 40, 3), 7, np.uint8)))
    pictured = load_reference(path)
    assert pictured is not None
    assert pictured.picture is not None
    assert (pictured.picture == 7).all()
    assert [each.name for each in tmp_path.iterdir()] == ["truth.npz"]  # nothing half-written is left

    whole = path.read_bytes()
    damaged = bytearray(whole)
    damaged[len(whole) // 3] ^= 0xFF
    for content in (whole[: len(whole) // 2], bytes(damaged), b"", b"no archive"):
        path.write_bytes(content)
        assert load_reference(path) is None
    np.savez(path, normal=made.normal, depth=made.depth[:-1], coverage=made.coverage, focal_pixels=1.0)
    assert load_reference(path) is None
    np.savez(path, normal=made.normal)
    assert load_reference(path) is None


def test_a_reference_that_cannot_be_written_leaves_the_old_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "truth.npz"
    made = cast(square(0.0), front_view(), 1)
    save_reference(path, made)

    def full_disc(*_: object, **__: object) -> None:
        raise OSError("no space left on device")

    monkeypatch.setattr(np, "savez", full_disc)
    with pytest.raises(OSError, match="no space"):
        save_reference(path, replace(made, focal_pixels=1.0))
    loaded = load_reference(path)
    assert loaded is not None
    assert loaded.focal_pixels == made.focal_pixels
    assert len(list(tmp_path.iterdir())) == 1


def test_without_embreex_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "embreex.mesh_construction", None)
    with pytest.raises(UsageError, match=r"^benchmarks need embreex: pip install 'surfelscope\[bench\]' .*$"):
        cast(square(0.0), front_view())
