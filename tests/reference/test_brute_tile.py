"""The per-texel tiles on a few surfels and triangles whose answer can be written down."""

from __future__ import annotations

import math

import numpy as np
import pytest
from brute_tile import Disc, bounding_sphere, gaussian, texel_positions, tile_of_surfels, tile_of_triangles

UP = np.array([0.0, 0.0, 1.0])
DISC = Disc(np.array([1.0, 2.0, 3.0]), UP, 2.0, np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))


def tilted(angle: float) -> np.ndarray:
    return np.array([math.sin(angle), 0.0, math.cos(angle)])


def test_texels_reach_from_rim_to_rim_and_the_only_one_is_the_centre() -> None:
    assert np.array_equal(texel_positions(DISC, 1), DISC.centre[None, None])
    corners = texel_positions(DISC, 2) - DISC.centre
    assert np.array_equal(corners[0, 0], [-2.0, -2.0, 0.0])
    assert np.array_equal(corners[0, 1], [2.0, -2.0, 0.0])  # [y, x]
    assert np.array_equal(texel_positions(DISC, 5)[2, 3] - DISC.centre, [1.0, 0.0, 0.0])


def test_a_tilted_base_disc_is_met_within_its_shadow_on_the_surfel() -> None:
    normal = tilted(math.radians(60.0))
    centres = (DISC.centre + 0.7 * UP)[None]
    tile, found = tile_of_surfels(DISC, 9, centres, normal[None], np.array([1.2]), gaussian(0.5))
    offset = texel_positions(DISC, 9) - DISC.centre
    # The shadow is an ellipse of half axes r cos(60 deg) along x and r along y.
    expected = (offset[..., 0] / 0.6) ** 2 + (offset[..., 1] / 1.2) ** 2 < 1.0
    assert np.array_equal(found, expected)
    assert 3 <= expected.sum() < 81
    assert np.allclose(tile[found], normal)
    assert np.array_equal(tile[~found], np.broadcast_to(UP, tile[~found].shape))


def test_two_base_discs_are_weighted_by_the_distances_of_the_hits_to_their_centres() -> None:
    a, b = tilted(0.3), tilted(-0.5)
    centres = DISC.centre + np.array([[-0.4, 0.0, 0.0], [0.5, 0.3, 0.2]])
    radii = np.array([1.5, 1.1])
    tile, _ = tile_of_surfels(DISC, 1, centres, np.stack([a, b]), radii, gaussian(0.7))
    # Along x the slope of a disc tilted by t is -tan(t): a step s in x is s / cos(t) on the disc.
    distance_a, distance_b = 0.4 / math.cos(0.3), math.hypot(0.5 / math.cos(0.5), 0.3)
    total = math.exp(-0.5 * (distance_a / (0.7 * 1.5)) ** 2) * a + math.exp(-0.5 * (distance_b / (0.7 * 1.1)) ** 2) * b
    assert np.allclose(tile[0, 0], total / np.linalg.norm(total))


def test_the_other_side_of_a_thin_sheet_does_not_count() -> None:
    centres = DISC.centre + np.array([[0.0, 0.0, 0.01], [0.0, 0.0, -0.01]])
    normals = np.stack([tilted(0.2), -tilted(0.2)])
    tile, found = tile_of_surfels(DISC, 1, centres, normals, np.ones(2), gaussian(0.5))
    assert found.all()
    assert np.allclose(tile[0, 0], tilted(0.2))


def test_shading_normals_that_cancel_leave_the_normal_of_the_surfel() -> None:
    centres = np.stack([DISC.centre, DISC.centre])
    shading = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    tile, found = tile_of_surfels(
        DISC, 1, centres, np.stack([UP, UP]), np.ones(2), gaussian(0.5), shading_normals=shading
    )
    assert not found.any()
    assert np.array_equal(tile[0, 0], UP)


def test_only_base_discs_whose_spheres_meet_the_surfels_count() -> None:
    # On the line through the centre, but 3.4 away: spheres of 2 and 1.3 stay apart, of 2 and 1.5 meet.
    centres, normals = (DISC.centre + 3.4 * UP)[None], tilted(0.4)[None]
    assert not tile_of_surfels(DISC, 1, centres, normals, np.array([1.3]), gaussian(0.5))[1].any()
    assert tile_of_surfels(DISC, 1, centres, normals, np.array([1.5]), gaussian(0.5))[1].all()
    assert tile_of_surfels(DISC, 1, centres, normals, np.array([1.3]), gaussian(0.5), reach=2.2)[1].all()


def triangle_over_disc(height: float = 0.0, flip: bool = False) -> np.ndarray:
    corners = DISC.centre + np.array([[-3.0, -3.0, height], [8.0, -3.0, height], [-3.0, 8.0, height]])
    return corners[::-1] if flip else corners


def test_normals_of_a_triangle_are_linear_in_the_texels() -> None:
    corner_normals = np.stack([tilted(0.3), tilted(-0.6), UP])
    tile, found = tile_of_triangles(DISC, 5, triangle_over_disc()[None], corner_normals[None])
    offset = texel_positions(DISC, 5) - DISC.centre
    v, w = (offset[..., 0] + 3.0) / 11.0, (offset[..., 1] + 3.0) / 11.0
    expected = np.einsum("yxk,kc->yxc", np.stack([1.0 - v - w, v, w], -1), corner_normals)
    assert found.all()
    assert np.allclose(tile, expected / np.linalg.norm(expected, axis=-1, keepdims=True))


def test_the_triangle_nearest_to_the_plane_among_those_of_its_side_counts() -> None:
    heights, flips = (0.6, -1.0, 0.1), (False, False, True)
    corners = np.stack([triangle_over_disc(h, f) for h, f in zip(heights, flips, strict=True)])
    corner_normals = np.stack([np.stack([tilted(t)] * 3) for t in (0.1, 0.2, 0.3)])
    tile, _ = tile_of_triangles(DISC, 3, corners, corner_normals)
    assert np.allclose(tile, tilted(0.1))
    tile, found = tile_of_triangles(DISC, 3, corners[2:], corner_normals[2:])
    assert not found.any()
    assert np.array_equal(tile[1, 1], UP)


def test_texels_beside_the_triangle_keep_the_normal_of_the_surfel() -> None:
    corners = DISC.centre + np.array([[0.0, -4.0, 0.3], [4.0, 4.0, -0.2], [0.0, 4.0, 0.1]])
    tile, found = tile_of_triangles(DISC, 4, corners[None], np.stack([tilted(0.4)] * 3)[None])
    offset = texel_positions(DISC, 4) - DISC.centre
    expected = (offset[..., 0] >= 0.0) & (offset[..., 0] <= (offset[..., 1] + 4.0) / 2.0)
    assert np.array_equal(found, expected)
    assert 4 <= expected.sum() <= 8
    assert np.allclose(tile[~found], UP)


def test_a_triangle_far_along_the_line_is_not_reached() -> None:
    corners = DISC.centre + np.array([[-1.0, -1.0, 4.0], [1.0, -1.0, 4.0], [0.0, 1.0, 4.0]])
    normals = np.stack([UP] * 3)
    assert not tile_of_triangles(DISC, 1, corners[None], normals[None])[1].any()
    assert tile_of_triangles(DISC, 1, corners[None], normals[None], reach=3.0)[1].all()


@pytest.mark.parametrize(
    ("corners", "centre", "radius"),
    [
        ([[0, 0, 0], [4, 0, 0], [1, 0.5, 0]], (2, 0, 0), 2.0),
        ([[0, 0, 0], [0, 3, 0], [4, 0, 0]], (2, 1.5, 0), 2.5),
        ([[1, 0, 0], [0, 1, 0], [0, 0, 1]], (1 / 3, 1 / 3, 1 / 3), math.sqrt(2.0 / 3.0)),
    ],
    ids=["obtuse", "right", "acute"],
)
def test_bounding_sphere_of_a_triangle(corners: object, centre: object, radius: float) -> None:
    for turn in range(3):
        found_centre, found_radius = bounding_sphere(np.roll(np.asarray(corners, np.float64), turn, axis=0))
        assert np.allclose(found_centre, centre)
        assert found_radius == pytest.approx(radius)
