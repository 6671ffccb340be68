"""Small pictures against the plain numpy renderer with the same equations."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import pytest
from frame_in_numpy import DEPTH_RELATIVE, compare, numpy_picture
from numpy_renderer import Picture

from hierarchy.boxes import TURN_STEP, TURNS, WHOLE_DISC
from hierarchy.build import build_hierarchy
from hierarchy.hierarchy import SPLAT, Hierarchy
from hierarchy.lod import Cut
from hierarchy.model import PointCloud
from hierarchy.normal_tiles import NormalTiles, bake_tiles
from hierarchy.tile_kernels import LAYER_SIZE
from hierarchy.view import View, look_at
from renderer.frame import Frame
from renderer.settings import Settings

Draw = Callable[..., tuple[Frame, Cut]]

# Bounds. Of sums of float32; what a corner on the grid of 1/256 pixel changes counts, too.
NORMAL_DEGREES = 0.1
# Texture filters may have no more than 8 bits between two texels.
TILE_MEAN_DEGREES, TILE_P95_DEGREES, TILE_MAX_DEGREES = 0.1, 0.25, 0.5
# Pixels of a picture that may differ all the same: rims that none of four shifts crosses. There are none today.
OUTLIERS = 2


def assert_same(
    frame: Frame,
    hierarchy: Hierarchy,
    tiles: NormalTiles | None,
    cut: Cut,
    view: View,
    compared: float = 0.9,
    *,
    whole: bool = False,
) -> Picture:
    """Compare a frame with numpy's at the pixels where rounding decides nothing; at least this share of them all."""
    found = compare(frame, hierarchy, tiles, cut, view, whole=whole)
    drawn, stable = found.drawn, found.stable
    assert drawn.sum() > 40
    assert stable[drawn].mean() > compared
    assert found.miscovered.sum() <= OUTLIERS
    if tiles is not None:
        degrees = found.degrees[stable & drawn & (frame.coverage > 0.0)]
        assert degrees.mean() < TILE_MEAN_DEGREES
        assert np.percentile(degrees, 95) < TILE_P95_DEGREES
    assert (found.degrees > (NORMAL_DEGREES if tiles is None else TILE_MAX_DEGREES)).sum() <= OUTLIERS
    assert (found.depth_excess > DEPTH_RELATIVE).sum() <= OUTLIERS
    return found.picture


def around(
    direction: tuple[float, float, float], hierarchy: Hierarchy, distance: float = 3.2, scale: float | None = None
) -> View:
    """Look at the middle from a distance in radii; scale : of parallel view rays, in radii."""
    centre, radius = hierarchy.bounds
    eye = centre + distance * radius * np.asarray(direction) / np.linalg.norm(direction)
    parallel_scale = None if scale is None else scale * radius
    return look_at(eye, centre, (0.1, 1, 0), 0.7, (56, 52), bounds=hierarchy.bounds, parallel_scale=parallel_scale)


@pytest.mark.parametrize("tiled", [True, False], ids=["tiles", "no tiles"])
@pytest.mark.parametrize("radii", [(1.0, 4.0), (2.0, 6.0)], ids=["fine", "coarse"])
def test_a_hybrid_hierarchy(
    draw: Draw, meteoroid: tuple[Hierarchy, NormalTiles], radii: tuple[float, float], tiled: bool
) -> None:
    hierarchy, tiles = meteoroid[0], meteoroid[1] if tiled else None
    view = around((1, 2, 3), hierarchy)
    frame, cut = draw(view, hierarchy, tiles, None, *radii)
    assert min(cut.silhouette_splats, cut.splat_count - cut.silhouette_splats, cut.triangle_count) > 10
    assert_same(frame, hierarchy, tiles, cut, view)


# Sprites whose middle is beyond the edge of the window are lost: they show a part of a model with gaps at its edges.
@pytest.mark.parametrize(
    ("scale", "distance", "splat"),
    [(1.1, 2.0, "quad"), (0.6, 0.3, "quad"), (1.1, 1e4, "quad"), (1.1, 2.0, "sprite"), (1.1, 1e4, "sprite")],
)
def test_parallel_rays(
    draw: Draw, meteoroid: tuple[Hierarchy, NormalTiles], scale: float, distance: float, splat: str
) -> None:
    hierarchy, tiles = meteoroid
    view = around((1, 2, 3), hierarchy, distance, scale)
    frame, cut = draw(view, hierarchy, tiles, Settings(splat=splat), 2.0, 6.0)
    assert min(cut.splat_count, cut.triangle_count) > 10
    if distance > 1e3:
        # float32 depths from so far away are coarse; the picture is not.
        frame = dataclasses.replace(frame, depth=frame.depth - np.float32(view.depth_of_eye))
        near_by = around((1, 2, 3), hierarchy, 2.0, scale)
        again, _ = draw(near_by, hierarchy, tiles, Settings(splat=splat), 2.0, 6.0)
        assert np.array_equal(again.coverage, frame.coverage)
        assert np.abs(again.color.astype(int) - frame.color).max() <= 1
        return
    assert_same(frame, hierarchy, tiles, cut, view, whole=splat == "sprite")


@pytest.fixture(scope="module")
def torus() -> tuple[Hierarchy, NormalTiles]:
    """A point hierarchy over a torus, whose far side is seen through the hole and drawn from behind."""
    u, v = (part.ravel() for part in np.meshgrid(np.arange(48) / 48, np.arange(18) / 18, indexing="ij"))
    u, v = 2.0 * np.pi * (u + 0.02 * np.sin(40 * v)), 2.0 * np.pi * v
    normals = np.stack([np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v)], axis=1)
    positions = 0.4 * normals + np.stack([np.cos(u), np.sin(u), np.zeros_like(u)], axis=1)
    cloud = PointCloud(
        "torus",
        np.zeros(3),
        positions.astype(np.float32),
        normals.astype(np.float32),
        np.full(len(u), 0.12, np.float32),
    )
    hierarchy = build_hierarchy(cloud)
    return hierarchy, bake_tiles(hierarchy, 16)


@pytest.mark.parametrize("tiled", [True, False], ids=["tiles", "no tiles"])
@pytest.mark.parametrize("direction", [(0, 0.2, 1), (0, 1, 0.3)], ids=["through", "across"])
def test_a_point_hierarchy(
    draw: Draw, torus: tuple[Hierarchy, NormalTiles], direction: tuple[float, float, float], tiled: bool
) -> None:
    hierarchy, tiles = torus[0], torus[1] if tiled else None
    view = around(direction, hierarchy, 2.5)
    frame, cut = draw(view, hierarchy, tiles, None, 2.5, 8.0)
    leaf_splats = int((cut.splats >= hierarchy.node_count).sum())
    assert min(leaf_splats, cut.splat_count - leaf_splats) > 10
    assert_same(frame, hierarchy, tiles, cut, view)


@pytest.mark.parametrize("tiled", [True, False], ids=["tiles", "no tiles"])
def test_point_sprites(draw: Draw, meteoroid: tuple[Hierarchy, NormalTiles], tiled: bool) -> None:
    hierarchy, tiles = meteoroid[0], meteoroid[1] if tiled else None
    view = around((1, 2, 3), hierarchy)
    frame, cut = draw(view, hierarchy, tiles, Settings(splat="sprite"), 2.0, 6.0)
    assert_same(frame, hierarchy, tiles, cut, view, whole=True)


@pytest.mark.parametrize("degrees", [0, 30, 60, 75])
def test_tilted_point_sprites_in_perspective(draw: Draw, degrees: float) -> None:
    tilt = math.radians(degrees)
    normals = [[0, math.sin(tilt), math.cos(tilt)], [0.7 * math.sin(tilt), -0.7 * math.sin(tilt), math.cos(tilt)]]
    centres = [[-0.5, 0.7, 0], [-0.4, -0.6, 0.2], [0.8, 0.1, -0.3]]
    hierarchy, tiles = by_hand(centres, [*normals, normals[0]], 0.6, 0.02)
    view = look_at((0.1, 0.05, 2.2), (0.1, 0, 0), (0, 1, 0), 1.1, (64, 64), bounds=hierarchy.bounds)
    frame, cut = draw(view, hierarchy, tiles, Settings(splat="sprite"), cut=cut_of(hierarchy, 1))
    assert_same(frame, hierarchy, tiles, cut, view, whole=True)


def test_without_blending_the_nearest_shows(draw: Draw, meteoroid: tuple[Hierarchy, NormalTiles]) -> None:
    hierarchy, tiles = meteoroid
    view = around((1, 2, 3), hierarchy)
    blended, cut = draw(view, hierarchy, tiles, None, 2.0, 6.0)
    nearest, _ = draw(view, hierarchy, tiles, Settings(blending=False), 2.0, 6.0)
    assert np.array_equal(nearest.coverage, blended.coverage)
    # Not where a crack was closed with the mean of what is around it.
    drawn = (blended.coverage > 0.0) & np.isfinite(numpy_picture(hierarchy, tiles, cut, view).visibility)
    assert (nearest.depth[drawn] <= blended.depth[drawn] * (1.0 + DEPTH_RELATIVE)).all()
    assert (nearest.depth[drawn] < blended.depth[drawn]).mean() > 0.5


def test_normal_mapping_can_be_switched_off(draw: Draw, meteoroid: tuple[Hierarchy, NormalTiles]) -> None:
    hierarchy, tiles = meteoroid
    view = around((-1, 0.5, 1), hierarchy)
    frame, cut = draw(view, hierarchy, tiles, Settings(normal_mapping=False), 2.0, 6.0)
    assert_same(frame, hierarchy, None, cut, view)


def by_hand(
    centres: object, normals: object, radii: object, thickness: object = 0.0, *, boxed: bool = False
) -> tuple[Hierarchy, NormalTiles]:
    """Return a hierarchy whose splats are these, and random tiles for all but the last.

    boxed : of every third disc only a turned rectangle is drawn
    """
    centres, normals = np.asarray(centres, np.float32), np.asarray(normals, np.float64)
    normals = (normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32)
    radii = np.broadcast_to(np.asarray(radii, np.float32), len(centres)).copy()
    cloud = PointCloud("by hand", np.zeros(3), centres, normals, radii)
    splats = np.zeros(len(centres), SPLAT)
    splats["centre"], splats["normal"], splats["radius"], splats["thickness"] = centres, normals, radii, thickness
    splats["box"] = WHOLE_DISC
    # A rectangle inside of the disc, turned by a quarter of a right angle.
    splats["box"][::3] = [-0.9, 0.4, -0.5, 0.6 + TURN_STEP * (TURNS // 4)] if boxed else WHOLE_DISC
    count = len(splats) - 1
    tile_of_node = np.arange(count, dtype=np.int32)
    tiles = NormalTiles(4, count, tile_of_node, np.zeros((1, LAYER_SIZE, LAYER_SIZE, 2), np.uint8), None)
    tiles.normals[:] = np.random.default_rng(7).integers(48, 208, tiles.normals.shape)
    built = build_hierarchy(cloud)
    # As many nodes as have tiles.
    return dataclasses.replace(built, splats=splats, nodes=np.resize(built.nodes, count)), tiles


def cut_of(hierarchy: Hierarchy, silhouette: int = 0) -> Cut:
    count = len(hierarchy.splats)
    return Cut(np.arange(count, dtype=np.uint32), np.empty((0, 3), np.uint32), silhouette, 0, count)


@pytest.mark.parametrize("tiled", [True, False], ids=["tiles", "no tiles"])
@pytest.mark.parametrize("degrees", [0, 30, 60, 75, 85, 89, 90])
def test_tilted_discs_in_perspective(draw: Draw, degrees: float, tiled: bool) -> None:
    tilt = math.radians(degrees)
    # Tilted about x, as tilted about a diagonal, and aside, where perspective turns it back.
    normals = [[0, math.sin(tilt), math.cos(tilt)], [0.7 * math.sin(tilt), -0.7 * math.sin(tilt), math.cos(tilt)]]
    hierarchy, tiles = by_hand(
        [[-0.5, 0.7, 0], [-0.4, -0.6, 0.2], [0.8, 0.1, -0.3]], [*normals, normals[0]], 0.6, 0.02, boxed=True
    )
    view = look_at((0.1, 0.05, 2.2), (0.1, 0, 0), (0, 1, 0), 1.1, (64, 64), bounds=hierarchy.bounds)
    frame, cut = draw(view, hierarchy, tiles if tiled else None, cut=cut_of(hierarchy, 1))
    # Edge-on a disc is thinner than a pixel, and its tile runs past in a fraction of one.
    assert_same(frame, hierarchy, tiles if tiled else None, cut, view, 0.9 if degrees < 80 else 0.4)


@pytest.mark.parametrize("splat", ["quad", "sprite"])
@pytest.mark.parametrize("degrees", [0, 30, 60, 75, 85])
def test_tilted_discs_in_parallel_rays(draw: Draw, degrees: float, splat: str) -> None:
    tilt = math.radians(degrees)
    normals = [[0, math.sin(tilt), math.cos(tilt)], [0.7 * math.sin(tilt), -0.7 * math.sin(tilt), math.cos(tilt)]]
    centres = [[-0.5, 0.7, 0], [-0.4, -0.6, 0.2], [0.8, 0.1, -0.3]]
    hierarchy, tiles = by_hand(centres, [*normals, normals[0]], 0.6, 0.02, boxed=splat == "quad")
    view = look_at(
        (0.1, 0.05, 2.2), (0.1, 0, 0), (0.3, 1, 0), 1.1, (64, 64), bounds=hierarchy.bounds, parallel_scale=1.2
    )
    frame, cut = draw(view, hierarchy, tiles, Settings(splat=splat), cut=cut_of(hierarchy, 1))
    assert_same(frame, hierarchy, tiles, cut, view, 0.9 if degrees < 80 else 0.4, whole=splat == "sprite")


def test_discs_that_cross_the_near_plane_and_the_eye(draw: Draw) -> None:
    # A floor that reaches behind the eye, a wall through the near plane, and a disc beside it.
    centres, normals = [[0, -0.4, 0], [0.5, 0, 1.4], [-0.6, 0.3, 0]], [[0, 1, 0], [1, 0.2, 0.1], [0, 0, 1]]
    hierarchy, tiles = by_hand(centres, normals, [3.0, 0.7, 0.4])
    view = look_at((0, 0, 2), (0, 0, 0), (0, 1, 0), 1.6, (64, 64), bounds=hierarchy.bounds)
    view = dataclasses.replace(view, near=0.5, far=8.0)
    frame, cut = draw(view, hierarchy, tiles, cut=cut_of(hierarchy))
    picture = assert_same(frame, hierarchy, tiles, cut, view)
    assert picture.depth.min() < 0.55


@pytest.mark.parametrize("thickness", [0.0, 0.03])
def test_overlapping_sheets_are_kept_apart_by_epsilon(draw: Draw, thickness: float) -> None:
    rng = np.random.default_rng(11)
    x, y = (part.ravel() for part in np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-1, 1, 9)))
    # Sheets 0.02 (always blended), 0.1 (blended with thickness) and 0.5 apart.
    centres = np.concatenate([np.stack([x, y, z + 0.01 * rng.normal(size=81)], 1) for z in (0, -0.02, -0.1, -0.6)])
    normals = rng.normal(size=(324, 3)) * 0.15 + [0, 0, 1]
    hierarchy, tiles = by_hand(centres, normals, 0.22, thickness)
    view = look_at((0.8, 0.6, 3), (0, 0, -0.2), (0, 1, 0), 0.8, (64, 64), bounds=hierarchy.bounds)
    frame, cut = draw(view, hierarchy, tiles, cut=cut_of(hierarchy, 160))
    picture = assert_same(frame, hierarchy, tiles, cut, view, 0.6)
    front = (picture.coverage > 0.0) & (picture.visibility < 3.3)
    assert front.sum() > 500


def test_cracks_are_closed(draw: Draw) -> None:
    # Rows of discs that leave gaps of about a pixel between them.
    x, y = (part.ravel() for part in np.meshgrid(np.linspace(-1, 1, 12), np.linspace(-1, 1, 12)))
    normals = np.stack([0.4 * x, 0.4 * y, np.ones_like(x)], axis=1)
    hierarchy, tiles = by_hand(np.stack([x, y, 0 * x], 1), normals, 0.112)
    # Rolled, so that no crack runs along the pixels.
    view = look_at((0.2, 0.1, 3), (0, 0, 0), (0.6, 1, 0), 0.75, (64, 64), bounds=hierarchy.bounds)
    frame, cut = draw(view, hierarchy, tiles, cut=cut_of(hierarchy))
    picture = assert_same(frame, hierarchy, tiles, cut, view)
    filled = (picture.coverage > 0.0) & np.isinf(picture.visibility)
    assert filled.sum() > 30
    assert np.isfinite(frame.depth[filled]).all()
    # The picture shows what the arrays hold.
    nothing = dataclasses.replace(cut, splats=cut.splats[:0])
    background, _ = draw(view, hierarchy, tiles, cut=nothing)
    assert np.array_equal((frame.color != background.color).any(axis=-1), frame.coverage > 0.0)
