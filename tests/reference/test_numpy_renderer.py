"""The plain renderer on scenes that can be worked out by hand, and its triangles against rays."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from numpy_renderer import Discs, Picture, Triangles, bilinear_tile, cracks, pixel_rays, render

from hierarchy.view import look_at

# A unit length at the origin covers 20 pixels.
VIEW = look_at((0, 0, 4), (0, 0, 0), (0, 1, 0), 2.0 * math.atan(32 / 80), (64, 64), bounds=((0, 0, 0), 3.0))
OBLIQUE = look_at((2, 1.5, 3), (0.1, 0, 0), (0, 1, 0), 0.7, (48, 40), bounds=((0, 0, 0), 2.0))


def bell(rho2: np.ndarray) -> np.ndarray:
    return np.exp(-2.0 * rho2)


def constant(rho2: np.ndarray) -> np.ndarray:
    return np.ones_like(rho2)


def discs(centres: object, normals: object, radii: object, epsilon: float = 0.1, **more: object) -> Discs:
    centres, normals, radii = (np.asarray(array, np.float64) for array in (centres, normals, radii))
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    o1 = np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)])
    o1 /= np.linalg.norm(o1, axis=1, keepdims=True)
    base = Discs(centres, normals, radii, np.full(len(radii), epsilon), o1, np.cross(normals, o1))
    return dataclasses.replace(base, **more)  # type: ignore[arg-type]


def test_a_disc_facing_the_eye_is_a_disc_of_its_size_in_pixels() -> None:
    picture = render(VIEW, discs([[0.3, -0.2, 0]], [[0, 0, 1]], [1.1]), None, bell)
    x, y = np.meshgrid(np.arange(64) + 0.5, np.arange(64) + 0.5)
    rho2 = ((x - 38.0) ** 2 + (y - 36.0) ** 2) / 22.0**2
    assert np.array_equal(picture.coverage, (rho2 <= 1.0).astype(np.float64))
    drawn = picture.coverage == 1.0
    assert np.allclose(picture.depth[drawn], 4.0)
    assert np.isinf(picture.depth[~drawn]).all()
    assert np.isinf(picture.visibility[~drawn]).all()
    assert np.allclose(picture.normal[drawn], [0, 0, 1])
    assert not picture.normal[~drawn].any()
    assert np.allclose(picture.weight[drawn], np.exp(-2.0 * rho2[drawn]))


def test_hits_of_a_tilted_disc_lie_on_it_and_fill_its_solid_angle() -> None:
    normal = np.array([0.48, -0.6, 0.64])
    picture = render(OBLIQUE, discs([[0.2, 0.1, -0.1]], [normal], [0.7]), None, bell)
    drawn = picture.coverage == 1.0
    points = (
        pixel_rays(OBLIQUE).directions[drawn] * picture.depth[drawn][:, None] @ OBLIQUE.eye_from_model[:3, :3]
        + OBLIQUE.eye
    )
    offset = points - [0.2, 0.1, -0.1]
    assert np.allclose(offset @ normal, 0.0, atol=1e-12)
    distance = np.linalg.norm(offset, axis=1)
    assert distance.max() <= 0.7
    assert np.allclose(picture.weight[drawn], np.exp(-2.0 * (distance / 0.7) ** 2))
    # Pixels are equal patches of the image plane: their pre-images on the disc add up to its area.
    depth, slope = (
        picture.depth[drawn],
        np.abs(pixel_rays(OBLIQUE).directions[drawn] @ (OBLIQUE.eye_from_model[:3, :3] @ normal)),
    )
    assert (depth**2 / slope).sum() / OBLIQUE.focal_pixels**2 == pytest.approx(math.pi * 0.49, rel=0.02)


def test_epsilon_moves_the_centre_by_its_length_and_keeps_the_disc_plane() -> None:
    picture = render(OBLIQUE, discs([[0, 0, 0]], [[0.3, 0.2, 1]], [0.8], epsilon=0.25), None, bell)
    drawn = picture.coverage == 1.0
    distance = np.linalg.norm(OBLIQUE.eye)
    assert np.allclose(picture.visibility[drawn], picture.depth[drawn] * (distance + 0.25) / distance)
    assert np.allclose(picture.margin[drawn], picture.depth[drawn] * 0.25 / distance)


def test_what_only_the_pushed_disc_shows_hides_but_is_not_drawn() -> None:
    near = dataclasses.replace(VIEW, near=3.95)
    # 4 - 0.1 lies before the near plane, pushed by 0.1 beyond it; the disc behind has no epsilon.
    pair = discs([[0, 0, 0.1], [0, 0, -1]], [[0, 0, 1], [0, 0, 1]], [1.0, 1.0])
    assert not render(near, pair, None, bell).coverage[32, 32]
    assert render(near, dataclasses.replace(pair, epsilons=np.array([0.0, 0.1])), None, bell).coverage[32, 32] == 1.0


def test_overlapping_discs_are_blended_by_their_kernels() -> None:
    a, b = np.array([0.6, 0.0, 0.8]), np.array([0.0, -0.28, 0.96])
    pair = discs([[-0.2, 0, 0], [0.3, 0, 0]], [a, b], [1.0, 0.8], epsilon=1.0)
    picture = render(VIEW, pair, None, bell)
    single = [
        render(VIEW, discs(pair.centres[i : i + 1], [n], [r]), None, bell) for i, n, r in ((0, a, 1.0), (1, b, 0.8))
    ]
    both = (single[0].weight > 0.0) & (single[1].weight > 0.0)
    assert both.sum() > 300
    weights = [part.weight[both][:, None] for part in single]
    expected = weights[0] * a + weights[1] * b
    assert np.allclose(picture.normal[both], expected / np.linalg.norm(expected, axis=1, keepdims=True))
    assert np.allclose(picture.weight[both][:, None], weights[0] + weights[1])
    depth = (weights[0][:, 0] * single[0].depth[both] + weights[1][:, 0] * single[1].depth[both]) / sum(weights)[:, 0]
    assert np.allclose(picture.depth[both], depth)


@pytest.mark.parametrize(("gap", "blended"), [(0.09, True), (0.11, False)])
def test_only_what_is_within_epsilon_behind_the_front_is_blended(gap: float, blended: bool) -> None:
    # The eye is on the axis of both: where the ray is nearly the axis, epsilon is nearly a depth.
    pair = discs([[0, 0, 0], [0, 0, -gap]], [[0.6, 0, 0.8], [-0.6, 0, 0.8]], [1.0, 1.0], epsilon=0.1)
    flat = dataclasses.replace(pair, normals=np.array([[0.0, 0, 1], [0, 0, 1]]))
    shaded = dataclasses.replace(flat, tile_normals=lambda i, u, _: np.broadcast_to(pair.normals[i], (len(u), 3)))
    normal = render(VIEW, shaded, None, constant).normal[32, 32]
    assert np.allclose(normal, [0, 0, 1] if blended else [0.6, 0, 0.8])


def test_the_epsilon_of_the_disc_in_front_decides() -> None:
    pair = discs([[0, 0, 0], [0, 0, -0.2]], [[0, 0, 1], [0, 0, 1]], [1.0, 1.0])
    generous = dataclasses.replace(pair, epsilons=np.array([0.3, 0.0]))
    mean = dataclasses.replace(pair, epsilons=np.array([0.0, 0.3]))
    assert render(VIEW, generous, None, constant).weight[32, 32] == 2.0
    assert render(VIEW, mean, None, constant).weight[32, 32] == 1.0


def test_tile_coordinates_run_along_the_tangents() -> None:
    rotation = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    centre, radius = np.array([0.1, -0.2, 0.3]), 0.9
    seen: dict[str, np.ndarray] = {}

    def remember(i: int, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        seen["points"] = centre + radius * (u[:, None] * rotation[0] + v[:, None] * rotation[1])
        return np.broadcast_to(rotation[2], (len(u), 3))

    one = discs([centre], [rotation[2]], [radius], o1=rotation[:1], o2=rotation[1:2], tile_normals=remember)
    picture = render(OBLIQUE, one, None, bell)
    drawn = picture.coverage == 1.0
    points = (
        pixel_rays(OBLIQUE).directions[drawn] * picture.depth[drawn][:, None] @ OBLIQUE.eye_from_model[:3, :3]
        + OBLIQUE.eye
    )
    assert drawn.sum() > 50
    assert np.allclose(seen["points"], points)


def test_bilinear_tile_meets_its_texels_and_is_linear_between_them() -> None:
    rng = np.random.default_rng(5)
    tile = rng.normal(size=(4, 4, 3))
    steps = 2.0 * np.arange(4) / 3 - 1.0
    v, u = (grid.ravel() for grid in np.meshgrid(steps, steps, indexing="ij"))
    assert np.allclose(bilinear_tile(tile, u, v).reshape(4, 4, 3), tile)
    between = bilinear_tile(tile, np.array([0.0]), np.array([1.0]))[0]
    assert np.allclose(between, 0.5 * (tile[3, 1] + tile[3, 2]))
    only = rng.normal(size=(1, 1, 3))
    assert np.array_equal(bilinear_tile(only, u, v), np.broadcast_to(only[0], (16, 3)))


def test_culling_leaves_out_what_is_turned_away_from_the_eye_itself() -> None:
    # Turned away from the view axis, yet the eye sees its front: in perspective the ray decides.
    aside = discs([[1.4, 0, 0]], [[-1.0, 0, -0.1]], [0.3])
    behind = discs([[1.4, 0, 0]], [[1.0, 0, 0.1]], [0.3])
    assert render(VIEW, aside, None, bell, cull_back_faces=True).coverage.any()
    assert not render(VIEW, behind, None, bell, cull_back_faces=True).coverage.any()
    assert render(VIEW, behind, None, bell).coverage.any()


def test_edge_on_and_clipped_discs_draw_nothing() -> None:
    odd = look_at((0, 0, 4), (0, 0, 0), (0, 1, 0), 0.7, (31, 31), bounds=((0, 0, 0), 3.0))
    edge_on = discs([[0, 0, 0]], [[0, 1, 0]], [1.0])
    assert not render(odd, edge_on, None, bell).coverage.any()
    floor = discs([[0, -0.5, 0]], [[0, 1, 0]], [3.5])
    near = dataclasses.replace(VIEW, near=3.0, far=5.0)
    depth = render(near, floor, None, bell).depth
    assert depth.min() >= 3.0
    assert depth[np.isfinite(depth)].max() <= 5.0
    assert render(VIEW, floor, None, bell).depth.min() < 2.9


def test_a_crack_takes_the_mean_of_what_is_beside_it() -> None:
    sums = np.ones((9, 9, 2)) * [3.0, 1.0]
    sums[:, 4] = 0.0
    sums[:, 5:, 0] = 5.0
    crack, around = cracks(sums)
    # A column one pixel wide: across it and on both diagonals it is closed. At its ends the diagonals are open.
    assert crack[1:-1, 4].all()
    assert crack.sum() == 7
    assert np.allclose(around[1:-1, 4, 0] / around[1:-1, 4, 1], 4.0)


def test_what_is_wide_or_open_is_no_crack() -> None:
    wide = np.ones((9, 9, 1))
    wide[:, 3:6] = 0.0
    assert not cracks(wide)[0].any()
    bay = np.ones((9, 9, 1))
    bay[:4, 4] = 0.0
    bay[:3, 3] = bay[:3, 5] = 0.0
    assert not cracks(bay)[0][:2].any()
    hole = np.ones((9, 9, 1))
    hole[4, 4] = hole[4, 5] = 0.0
    assert np.argwhere(cracks(hole)[0]).tolist() == [[4, 4], [4, 5]]


@pytest.mark.parametrize(("height", "width", "closed"), [(1, 3, 3), (2, 2, 4), (2, 3, 6), (3, 3, 0), (2, 5, 4)])
def test_small_holes_are_closed_and_large_ones_are_not(height: int, width: int, closed: int) -> None:
    sums = np.ones((12, 12, 1))
    sums[4 : 4 + height, 4 : 4 + width] = 0.0
    assert cracks(sums)[0].sum() == closed


def test_a_crack_between_discs_is_closed_in_the_picture() -> None:
    # A gap from pixel 32.1 to 32.9: one column is open.
    pair = discs([[0.005 - 1, 0, 0], [0.045 + 1, 0, 0]], [[-0.6, 0, 0.8], [0.6, 0, 0.8]], [1.0, 1.0])
    flat = dataclasses.replace(pair, normals=np.array([[0.0, 0, 1], [0, 0, 1]]))
    shaded = dataclasses.replace(flat, tile_normals=lambda i, u, _: np.broadcast_to(pair.normals[i], (len(u), 3)))
    open_picture, closed = (render(VIEW, shaded, None, constant, close_cracks=close) for close in (False, True))
    filled = (closed.coverage == 1.0) & (open_picture.coverage == 0.0)
    assert filled.any()
    assert np.allclose(closed.depth[filled], 4.0)
    assert (np.abs(closed.normal[filled, 0]) < 0.59).any()  # blended, not one side's own
    assert np.array_equal(closed.normal[~filled], open_picture.normal[~filled])


def test_an_offset_moves_where_pixels_are_sampled() -> None:
    one = discs([[0.3, -0.2, 0]], [[0.2, 0.1, 1]], [1.1])
    centred, moved = render(VIEW, one, None, bell), render(VIEW, one, None, bell, offset=(1.0, -2.0))
    assert np.allclose(moved.weight[2:, :-1], centred.weight[:-2, 1:])


def test_coverage_is_what_the_caller_makes_of_the_weights() -> None:
    one = discs([[0, 0, 0]], [[0, 0, 1]], [1.0])
    picture = render(VIEW, one, None, bell, coverage=lambda weight: np.minimum(weight, 1.0))
    assert np.array_equal(picture.coverage, np.minimum(picture.weight, 1.0))


def test_nothing_to_draw_is_an_empty_picture() -> None:
    picture: Picture = render(VIEW, None, None, bell)
    assert not picture.coverage.any()
    assert np.isinf(picture.depth).all()


@pytest.fixture(scope="module")
def terrain() -> Triangles:
    """Two waves of triangles in front of each other, with normals that are not their faces'."""
    rng = np.random.default_rng(9)
    x, y = np.meshgrid(np.linspace(-1.2, 1.2, 9), np.linspace(-1.2, 1.2, 9))
    index = np.arange(81).reshape(9, 9)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    far = np.stack([x, y, 0.3 * np.sin(3 * x) - 0.6], -1).reshape(-1, 3)
    close = np.stack([0.5 * x, 0.5 * y, 0.2 * np.cos(4 * y) + 0.3], -1).reshape(-1, 3)
    positions = np.concatenate([far, close])
    normals = rng.normal(size=(162, 3)) * 0.4 + [0, 0, 1]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    faces = np.concatenate([faces, faces + 81])
    return Triangles(positions[faces], normals[faces], np.full(len(faces), 0.003))


def test_triangles_agree_with_rays(terrain: Triangles) -> None:
    pytest.importorskip("embreex", reason="embreex casts the rays to compare with")
    from benchmarks.reference import cast
    from hierarchy.model import Mesh

    corners = len(terrain.corners) * 3
    mesh = Mesh(
        "terrain",
        np.zeros(3),
        terrain.corners.reshape(-1, 3).astype(np.float32),
        np.arange(corners, dtype=np.int32).reshape(-1, 3),
        terrain.corner_normals.reshape(-1, 3).astype(np.float32),
    )
    picture, rays = render(OBLIQUE, None, terrain, bell), cast(mesh, OBLIQUE, 1)
    assert (picture.coverage != rays.coverage).sum() <= 2
    # Pixels that an edge crosses within epsilon of what it hides are blended: they have a weight of 2.
    same = (picture.weight == 1.0) & (rays.coverage == 1.0)
    assert same.sum() > 0.95 * (rays.coverage == 1.0).sum()
    assert np.allclose(picture.depth[same], rays.depth[same], rtol=1e-5)
    assert np.allclose(picture.normal[same], rays.normal[same], atol=1e-4)


def test_triangles_and_discs_share_the_passes(terrain: Triangles) -> None:
    # A disc halfway between the waves: behind the close one, before the far one.
    screen = discs([[0, 0, -0.15]], [[0, 0, 1]], [1.0], epsilon=0.01)
    alone, both = render(VIEW, None, terrain, bell), render(VIEW, screen, terrain, bell)
    disc = render(VIEW, screen, None, bell)
    front = np.where(disc.depth < alone.depth, disc.depth, alone.depth)
    # Where the two are about as deep they are blended.
    meeting = np.isclose(disc.depth, alone.depth, rtol=0.0, atol=0.05)
    drawn = ~meeting & (both.weight > 0.0)
    close = (alone.depth < disc.depth) & (disc.coverage > 0.0) & drawn
    assert close.sum() > 100
    assert ((disc.depth < alone.depth) & drawn).sum() > 100
    assert np.allclose(both.depth[drawn], front[drawn], atol=0.02)
    assert np.allclose(both.normal[close], alone.normal[close])


def test_the_weight_of_triangles_is_theirs(terrain: Triangles) -> None:
    picture = render(VIEW, None, dataclasses.replace(terrain, weight=0.25), bell)
    assert picture.weight.max() == pytest.approx(0.25 * render(VIEW, None, terrain, bell).weight.max())


def test_back_faces_of_triangles_can_be_left_out(terrain: Triangles) -> None:
    flipped = dataclasses.replace(
        terrain, corners=terrain.corners[:, ::-1], corner_normals=terrain.corner_normals[:, ::-1]
    )
    assert not render(VIEW, None, flipped, bell, cull_back_faces=True).coverage.any()
    front = render(VIEW, None, terrain, bell, cull_back_faces=True)
    assert front.coverage.sum() > 1000
    assert np.allclose(front.depth, render(VIEW, None, flipped, bell).depth)
