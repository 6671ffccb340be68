"""Tiles of as few texels as will do, against the tiles that they stand for."""

from dataclasses import replace

import numpy as np
import pytest
from small_models import bumpy_sphere, cloud_of, grid, mesh_of, surfel_sphere, terrain

from hierarchy.build import build_hierarchy
from hierarchy.encoding import decode_hemisphere
from hierarchy.frames import tangents
from hierarchy.meteoroid import make_meteoroid
from hierarchy.normal_tiles import TileBaker, bake_tiles
from hierarchy.tile_errors import LEVEL, WORST
from hierarchy.tile_fits import PRICE
from hierarchy.tile_sizes import TEXEL_PIXELS, sides_of, texels_seen
from hierarchy.view import look_at

# What rounding the tile that it is compared with adds: at most half a byte in both components, 0.57 degrees.
ROUNDING = np.radians(0.57)


def fit_all(hierarchy, texels, **how):
    nodes = np.arange(hierarchy.node_count, dtype=np.uint32)
    return TileBaker(hierarchy, texels).fitted(nodes, np.full(len(nodes), texels, np.int32), **how)


def look_up(tiles, texels):
    """Return tiles (N, m, m, C) looked up bilinearly at the texels of larger ones, float64 (N, texels, texels, C)."""
    side = tiles.shape[1]
    place = np.linspace(0.0, side - 1.0, texels)
    low = np.minimum(place.astype(int), side - 2)
    share = (place - low)[:, None]
    rows = tiles[:, low] * (1.0 - share[:, None]) + tiles[:, low + 1] * share[:, None]
    return rows[:, :, low] * (1.0 - share) + rows[:, :, low + 1] * share


def in_disc(texels):
    at = np.linspace(-1.0, 1.0, texels)
    return at[:, None] ** 2 + at[None, :] ** 2 <= max(1.0, 3.0 - texels / 2.0)


def bytes_of(tiles, side):
    """Return the bytes, not rounded, that the normals of all tiles of a side stand for, float64 (N, side, side, 2)."""
    spread = tiles.spreads[tiles.sides == side].astype(float)[:, None, None]
    return spread[..., :2] + tiles.normals[side] * spread[..., 2:] / 255.0


def angles(a, b):
    return 2.0 * np.arcsin(np.minimum(0.5 * np.linalg.norm(a - b, axis=-1), 1.0))


def bent_sheet(count, bend):
    """Return a flat sheet whose normals turn along x by `bend` radians."""
    positions, faces = grid(count)
    across = positions[:, 0] - positions[:, 0].mean()
    turn = bend * across / np.ptp(across)
    normals = np.stack([np.sin(turn), np.zeros(len(turn)), np.cos(turn)], axis=1)
    return mesh_of(positions, faces, normals=normals)


@pytest.mark.parametrize("texels", [2, 4, 8, 16, 32, 24])
@pytest.mark.parametrize(
    "model", [lambda: make_meteoroid(4_000), lambda: bumpy_sphere(4), lambda: terrain(20), lambda: surfel_sphere(600)]
)
def test_what_is_left_out_is_worth_what_it_saves(model, texels):
    hierarchy = build_hierarchy(replace(model(), colors=None))
    tiles, whole = fit_all(hierarchy, texels), bake_tiles(hierarchy, texels)
    expected = np.stack([decode_hemisphere(whole.normal_codes(node)) for node in range(hierarchy.node_count)])
    assert set(np.unique(tiles.sides)) <= {0, *sides_of(texels)}
    inside = in_disc(texels)
    # The texels around the rim count, too, which weigh most where there are few.
    share = inside.mean() / min(1.0, np.pi / 4 * (1.0 + 2.0 / (texels - 1)) ** 2)
    for side in np.unique(tiles.sides).tolist():
        nodes = np.flatnonzero(tiles.sides == side)
        if side == texels:
            codes = np.stack([whole.normal_codes(node) for node in nodes])
            assert np.abs(bytes_of(tiles, side) - codes).max() <= 1.01
            continue
        found = np.broadcast_to([0.0, 0.0, 1.0], (len(nodes), texels, texels, 3))
        if side > 0:
            found = decode_hemisphere(look_up(bytes_of(tiles, side), texels))
        off = angles(found, expected[nodes])[:, inside]
        saved = PRICE * (texels**2 - side**2) / (texels - 1) ** 2
        assert np.sqrt((off**2).mean(axis=1)).max() <= (saved + ROUNDING) / np.sqrt(share)
        assert off.max() <= WORST + 2.0 * ROUNDING


def test_one_normal_takes_no_texels_and_a_linear_field_takes_four():
    flat = fit_all(build_hierarchy(bent_sheet(40, 0.0)), 16)
    assert not flat.sides.any()
    assert flat.nbytes == 0
    hierarchy = build_hierarchy(bent_sheet(40, 0.3))
    bent = fit_all(hierarchy, 16)
    # Beyond the edge of the sheet texels hit nothing and keep the disc's own normal.
    positions = hierarchy.leaves.positions
    discs = hierarchy.splats[: hierarchy.node_count]
    room = np.minimum(discs["centre"] - positions.min(axis=0), positions.max(axis=0) - discs["centre"])[:, :2]
    inner = room.min(axis=1) > 1.2 * discs["radius"]
    assert inner.sum() > 100
    assert (bent.sides[inner] <= 2).mean() > 0.9
    assert bent.sides[inner].max() <= 4
    assert 2 in bent.normals


def test_smooth_surfaces_take_a_part_of_the_texels():
    hierarchy = build_hierarchy(make_meteoroid(60_000))
    share = [fit_all(hierarchy, texels).nbytes / (2 * texels**2 * hierarchy.node_count) for texels in (16, 32)]
    assert share[0] < 0.65
    assert share[1] < 0.4


def test_rough_normals_keep_all_texels():
    model = bumpy_sphere(4)
    normals = model.normals + 0.3 * np.random.default_rng(4).normal(size=model.normals.shape)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    tiles = fit_all(build_hierarchy(mesh_of(model.positions, model.faces, normals=normals, closed=True)), 8)
    assert (tiles.sides[:50] == 8).all()


def test_a_crease_is_not_smoothed_away():
    """Few texels are off, but by much: their mean alone would pass for smooth."""
    positions, faces = grid(30)
    across = positions[:, 0] - positions[:, 0].mean()
    turn = np.where(across > 0.35 * np.ptp(across), 0.3, 0.0)
    normals = np.stack([np.sin(turn), 0.0 * turn, np.cos(turn)], axis=1)
    tiles = fit_all(build_hierarchy(mesh_of(positions, faces, normals=normals)), 32)
    assert tiles.sides[0] >= 16


def test_colours_count_like_normals():
    positions, faces = grid(24)
    rng = np.random.default_rng(3)
    plain, ramp, rough = (np.full((len(positions), 4), 255, np.uint8) for _ in range(3))
    across = (positions[:, 0] - positions[:, 0].min()) / np.ptp(positions[:, 0])
    plain[:, :3] = 100, 150, 200
    ramp[:, 0] = 40 + 100 * across
    rough[:, :3] = rng.integers(0, 256, (len(positions), 3))
    found = []
    for colors in (plain, ramp, rough):
        hierarchy = build_hierarchy(replace(mesh_of(positions, faces), colors=colors))
        tiles, whole = fit_all(hierarchy, 16), bake_tiles(hierarchy, 16)
        found.append(tiles)
        own = hierarchy.colors[:, :3].astype(float)
        for side in np.unique(tiles.sides[tiles.sides < 16]).tolist():
            nodes = np.flatnonzero(tiles.sides == side)
            rows = [whole.corner(node) for node in nodes]
            expected = np.stack([whole.colors[layer, y : y + 16, x : x + 16] for layer, y, x in rows]).astype(float)
            got = np.zeros_like(expected) if side == 0 else look_up(tiles.colors[side].astype(float), 16)
            shown = [c[..., :3] + own[nodes][:, None, None] * (1.0 - c[..., 3:] / 255.0) for c in (got, expected)]
            off = np.abs(shown[0] - shown[1]).max(axis=-1)[:, in_disc(16)]
            # A texel of normal and colour has three times the bytes.
            assert np.sqrt((off**2).mean(axis=1)).max() * LEVEL <= 3.0 * 1.2 * PRICE + ROUNDING
    flat, linear, noisy = found
    assert not flat.sides[1:].any()
    assert (linear.sides[1:] <= 2).mean() > 0.7
    assert noisy.sides[0] == 16
    assert all(len(noisy.colors[side]) == len(noisy.normals[side]) for side in noisy.normals)


@pytest.mark.parametrize("texels", [1, 2, 3])
def test_smallest_tiles(texels):
    hierarchy = build_hierarchy(make_meteoroid(2_000))
    tiles = fit_all(hierarchy, texels)
    assert set(np.unique(tiles.sides)) <= {0, 1, 2, 3}
    assert tiles.sides.max() == texels


def test_the_same_on_all_cores_as_on_one():
    model = make_meteoroid(4_000)
    colors = np.random.default_rng(5).integers(0, 256, (len(model.positions), 4)).astype(np.uint8)
    hierarchy = build_hierarchy(replace(model, colors=colors))
    one, all_ = fit_all(hierarchy, 16), fit_all(hierarchy, 16, at_once=True)
    np.testing.assert_array_equal(one.sides, all_.sides)
    for side, normals in one.normals.items():
        np.testing.assert_array_equal(normals, all_.normals[side])
        np.testing.assert_array_equal(one.colors[side], all_.colors[side])
    none = TileBaker(hierarchy, 16).fitted(np.empty(0, np.uint32), np.empty(0, np.int32))
    assert none.nbytes == 0


def test_surfels_without_normals_and_single_points():
    for positions in ([[0, 0, 0]], [[0, 0, 0], [1, 0, 0]]):
        count = len(positions)
        hierarchy = build_hierarchy(cloud_of(positions, np.tile([0.0, 0.0, 1.0], (count, 1)), 0.5))
        assert not fit_all(hierarchy, 16).sides.any()


def test_texels_that_a_view_shows_are_no_further_apart_than_promised():
    hierarchy = build_hierarchy(make_meteoroid(4_000))
    nodes = np.arange(hierarchy.node_count, dtype=np.uint32)
    for distance in (1.5, 4.0, 20.0, 400.0):
        view = look_at((0.0, 0.0, distance), (0, 0, 0), (0, 1, 0), 0.8, (400, 300), bounds=hierarchy.bounds)
        most = texels_seen(hierarchy, view, nodes, 32)
        centres = hierarchy.splats["centre"][: len(nodes)].astype(float)
        depth = -(centres @ view.eye_from_model[2, :3] + view.eye_from_model[2, 3])
        pixels = 2.0 * view.focal_pixels * hierarchy.splats["radius"][: len(nodes)] / depth
        assert set(np.unique(most)) <= {2, 4, 8, 16, 32}
        assert (pixels / (most - 1) <= 1.0001 * TEXEL_PIXELS)[most < 32].all()
        # None is larger than it has to be.
        assert (pixels > 0.9999 * TEXEL_PIXELS * (most / 2 - 1))[most > 2].all()


def test_normals_that_vary_little_are_kept_more_finely():
    """A tile's bytes are spread over the normals that it has: a flat one's are not rounded to half a degree."""
    positions, faces = grid(24)
    across = positions - positions.mean(axis=0)
    turn = 0.02 * np.sin(4.0 * across[:, 0] / np.ptp(across[:, 0])) * np.cos(3.0 * across[:, 1] / np.ptp(across[:, 1]))
    normals = np.stack([np.sin(turn), np.sin(turn), np.cos(turn)], axis=1)
    hierarchy = build_hierarchy(mesh_of(positions, faces, normals=normals))
    tiles = fit_all(hierarchy, 32)
    assert 1 <= tiles.spreads[tiles.sides > 0][:, 2:].max() < 24
    found = decode_hemisphere(look_up(bytes_of(tiles, int(tiles.sides[0]))[:1], 32))[0]
    disc, at = hierarchy.splats[0], np.linspace(-1.0, 1.0, 32)
    o1, o2 = np.array(tangents(*disc["normal"].astype(float))).reshape(2, 3)
    points = disc["centre"] + disc["radius"] * (at[None, :, None] * o1 + at[:, None, None] * o2)
    middle = positions.mean(axis=0)
    around = points - middle
    turn = (
        0.02 * np.sin(4.0 * around[..., 0] / np.ptp(across[:, 0])) * np.cos(3.0 * around[..., 1] / np.ptp(across[:, 1]))
    )
    expected = np.stack([np.sin(turn), np.sin(turn), np.cos(turn)], axis=-1)
    expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
    off = angles(found @ np.stack([o1, o2, disc["normal"]]), expected)
    inside = (np.abs(around) < 0.45 * np.ptp(positions, axis=0).max()).all(axis=-1)
    # A byte over the whole hemisphere is off by 0.24 degrees on average.
    assert np.degrees(off[inside].mean()) < 0.1
