"""Normal tiles against evaluating the papers' sums texel by texel, and against casting rays."""

import math
from dataclasses import replace

import numpy as np
import pytest
from brute_tile import Disc, texel_positions, tile_of_surfels, tile_of_triangles
from small_models import box, bumpy_sphere, cloud_of, grid, mesh_of, surfel_sphere, terrain, thin_sheet, turned

from hierarchy.build import build_hierarchy
from hierarchy.encoding import decode_hemisphere, encode_hemisphere
from hierarchy.frames import tangents
from hierarchy.kernel import SHARPNESS
from hierarchy.leaves import Triangles
from hierarchy.meteoroid import make_meteoroid
from hierarchy.model import Cancelled
from hierarchy.normal_tiles import bake_tiles
from hierarchy.tile_kernels import LAYER_SIZE

OWN = [128, 128]
# Largest error of the encoding, in degrees.
ENCODING = 0.57


def disc_of(hierarchy, node):
    splat = hierarchy.splats[node]
    normal = splat["normal"].astype(float)
    o1, o2 = np.array(tangents(*normal)).reshape(2, 3)
    return Disc(splat["centre"].astype(float), normal, float(splat["radius"]), o1, o2)


def reach_of(hierarchy, node, texels):
    """Return the radius within which base primitives count: all that a lookup inside the disc can touch."""
    me = hierarchy.nodes[node]
    # Bilinear filtering inside the disc reads texels up to a texel's diagonal beyond the rim, and none beyond a corner.
    beyond = min(math.sqrt(2.0), 1.0 + math.sqrt(2.0) * 2.0 / max(texels - 1, 1))
    return max(float(me["sphere"]), float(me["radius"]) * beyond)


def kernel(distance, radius):
    return np.exp(-SHARPNESS * (distance / radius) ** 2)


def expected_tile(hierarchy, node, texels, reach=None):
    """Return the tile (w, w, 3) of a node by brute force, and which texels hit anything."""
    disc, leaves = disc_of(hierarchy, node), hierarchy.leaves
    reach = reach_of(hierarchy, node, texels) if reach is None else reach
    if isinstance(leaves, Triangles):
        corners, normals = leaves.positions[leaves.indices], leaves.normals[leaves.indices]
        return tile_of_triangles(disc, texels, corners.astype(float), normals.astype(float), reach=reach)
    arrays = (leaves.positions.astype(float), leaves.normals.astype(float), leaves.radii.astype(float))
    return tile_of_surfels(disc, texels, *arrays, kernel, reach=reach)


def encode(disc, normals):
    """Return the bytes (w, w, 2) of normals (w, w, 3) of model space in a disc's frame."""
    local = normals @ np.stack([disc.o1, disc.o2, disc.normal], axis=1)
    return np.array([[encode_hemisphere(*v) for v in row] for row in local])


def decode(disc, codes):
    """Return the normals (w, w, 3), in model space, of a tile's bytes."""
    return decode_hemisphere(codes) @ np.stack([disc.o1, disc.o2, disc.normal])


def degrees_between(a, b):
    return np.degrees(2.0 * np.arcsin(np.minimum(0.5 * np.linalg.norm(a - b, axis=-1), 1.0)))


def rough_sphere():
    """Return a bumpy sphere whose vertex normals lean from its faces' by up to 40 degrees."""
    model = bumpy_sphere(3)
    normals = model.normals + 0.3 * np.random.default_rng(4).normal(size=model.normals.shape)
    return mesh_of(
        model.positions, model.faces, normals=normals / np.linalg.norm(normals, axis=1)[:, None], closed=True
    )


def turned_box():
    model = box()
    return mesh_of(turned(model.positions), model.faces, closed=True)


def two_surfels():
    return cloud_of(turned([[0, 0, 0], [1, 0.1, 0.2]]), turned([[0, 0, 1], [0.5, 0, 0.8]]), [0.8, 0.5])


def surfel_sheet():
    positions, _ = grid(6)
    positions = np.concatenate([positions, positions - [0, 0, 0.05]])
    normals = np.repeat([[0, 0, 1], [0, 0, -1]], 49, axis=0) + 0.02 * np.random.default_rng(1).normal(size=(98, 3))
    return cloud_of(turned(positions), turned(normals), 0.3)


MESHES = {"rough sphere": rough_sphere, "box": turned_box, "terrain": lambda: terrain(6), "thin sheet": thin_sheet}
CLOUDS = {"sphere": lambda: surfel_sphere(150), "two surfels": two_surfels, "sheet": surfel_sheet}


def sample_of_nodes(hierarchy, count):
    return np.unique(np.linspace(0, hierarchy.node_count - 1, count).astype(int))


@pytest.mark.parametrize("texels", [1, 2, 4, 16])
@pytest.mark.parametrize("name", CLOUDS)
def test_algorithm_1(name, texels):
    hierarchy = build_hierarchy(CLOUDS[name]())
    tiles = bake_tiles(hierarchy, texels)
    same = total = 0
    for node in sample_of_nodes(hierarchy, 20 // texels + 1):
        expected = encode(disc_of(hierarchy, node), expected_tile(hierarchy, node, texels)[0])
        codes = tiles.normal_codes(node).astype(float)
        # Sums in another order may round to the neighbouring byte.
        assert np.abs(codes - expected).max() <= 1.0
        same += (codes == expected).sum()
        total += codes.size
    assert same >= 0.99 * total


@pytest.mark.parametrize("texels", [1, 2, 4, 16])
@pytest.mark.parametrize("name", MESHES)
def test_algorithm_2(name, texels):
    hierarchy = build_hierarchy(MESHES[name]())
    tiles = bake_tiles(hierarchy, texels)
    same = total = 0
    for node in sample_of_nodes(hierarchy, 20 // texels + 1):
        disc = disc_of(hierarchy, node)
        expected, found = expected_tile(hierarchy, node, texels)
        codes = tiles.normal_codes(node).astype(float)
        right = np.abs(codes - encode(disc, expected)).max(axis=-1) <= 1.0
        assert right[found].all()
        if not right.all():
            # Where nothing within reach is hit, triangles farther away may be found, too.
            anywhere = encode(disc, expected_tile(hierarchy, node, texels, reach=np.inf)[0])
            assert (right | (np.abs(codes - anywhere).max(axis=-1) <= 1.0)).all()
        same += right.sum()
        total += right.size
    assert same >= 0.95 * total


def test_algorithm_2_against_rays():
    pytest.importorskip("embreex", reason="embreex casts the rays to compare with")
    from embreex import rtcore_scene
    from embreex.mesh_construction import TriangleMesh

    hierarchy = build_hierarchy(bumpy_sphere(10))
    leaves, texels = hierarchy.leaves, 16
    tiles = bake_tiles(hierarchy, texels)
    scene = rtcore_scene.EmbreeScene()
    TriangleMesh(scene, leaves.positions, leaves.indices)
    # Discs whose footprint is no crease: first hits up and down the normal then face the disc's side.
    nodes = np.flatnonzero(hierarchy.nodes["print_cos"] > math.cos(math.radians(60.0)))
    assert len(nodes) > 300
    discs = [disc_of(hierarchy, node) for node in nodes]
    origins = np.array([texel_positions(disc, texels) for disc in discs]).reshape(-1, 3)
    normals = np.repeat([disc.normal for disc in discs], texels**2, axis=0)
    heights, hit_normals = np.full(len(origins), np.inf), np.zeros((len(origins), 3))
    for side in (1.0, -1.0):
        hits = scene.run(origins.astype(np.float32), (side * normals).astype(np.float32), output=True)
        met = hits["primID"] >= 0
        v, w = hits["u"][met].astype(float), hits["v"][met].astype(float)
        corners = leaves.normals[leaves.indices[hits["primID"][met]]].astype(float)
        shading = np.einsum("nk,nkx->nx", np.stack([1.0 - v - w, v, w], 1), corners)
        kept = hits["tfar"][met] < heights[met]
        nearer = np.flatnonzero(met)[kept]
        heights[nearer], hit_normals[nearer] = hits["tfar"][nearer], shading[kept]
    hit_normals /= np.maximum(np.linalg.norm(hit_normals, axis=1, keepdims=True), 1e-30)
    # Within the disc; what lies over its rim may hit anything.
    radii = np.repeat([disc.radius for disc in discs], texels**2)
    centres = np.repeat([disc.centre for disc in discs], texels**2, axis=0)
    inside = np.linalg.norm(origins - centres, axis=1) <= radii
    tested = inside & (heights < radii) & ((hit_normals * normals).sum(axis=1) > 0.0)
    assert tested.sum() > 0.95 * inside.sum()
    baked = np.concatenate([decode(disc, tiles.normal_codes(node)) for disc, node in zip(discs, nodes, strict=True)])
    errors = degrees_between(baked.reshape(-1, 3), hit_normals)[tested]
    # Rays in single precision may meet the neighbour of a triangle at its edge, where both have the same normal.
    assert np.quantile(errors, 0.9999) < ENCODING
    assert errors.mean() < 0.25


def test_texels_that_hit_nothing_keep_the_own_normal():
    tile = bake_tiles(build_hierarchy(mesh_of([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])), 16).normal_codes(0)
    assert (tile == OWN).all()
    leaning = mesh_of([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], normals=[[0.6, 0, 0.8]] * 3)
    hierarchy = build_hierarchy(leaning)
    tile = bake_tiles(hierarchy, 17).normal_codes(0)
    expected, found = expected_tile(hierarchy, 0, 17)
    assert (tile[~found] == OWN).all()
    assert (tile[found] != OWN).any(axis=-1).all()
    np.testing.assert_array_equal(tile, encode(disc_of(hierarchy, 0), expected))
    # The triangle takes 1 / (2 * 0.5) of the square around its circle's diameter: a quarter of all texels or so.
    assert 0.2 < found.mean() < 0.35


def test_surfels_leave_texels_beyond_their_rims_alone():
    hierarchy = build_hierarchy(cloud_of([[0, 0, 0]], [[0, 0, 1]], 1.0))
    assert (bake_tiles(hierarchy, 8).normal_codes(0) == OWN).all()
    two = build_hierarchy(two_surfels())
    expected, found = expected_tile(two, 0, 16)
    tile = bake_tiles(two, 16).normal_codes(0)
    assert 0.1 < found.mean() < 0.9
    assert (tile[~found] == OWN).all()
    assert degrees_between(decode(disc_of(two, 0), tile), expected)[found].max() < ENCODING


@pytest.mark.parametrize("make", [thin_sheet, surfel_sheet])
def test_the_sides_of_a_thin_sheet_do_not_cancel(make):
    hierarchy = build_hierarchy(make())
    tiles = bake_tiles(hierarchy, 4)
    for node in range(hierarchy.node_count):
        disc = disc_of(hierarchy, node)
        # Which side a node faces is open, but its tile agrees with it.
        assert (decode(disc, tiles.normal_codes(node)) @ disc.normal).min() > 0.8


def test_normals_below_the_disc_are_kept_on_its_rim():
    # Vertex normals that lean from the face's by more than a right angle.
    model = mesh_of([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], normals=[[0.8, 0, -0.6]] * 3)
    hierarchy = build_hierarchy(model)
    local = decode_hemisphere(bake_tiles(hierarchy, 9).normal_codes(0))
    _, found = expected_tile(hierarchy, 0, 9)
    assert found.any()
    np.testing.assert_allclose(local[found][:, 2], 0.0, atol=1e-12)
    np.testing.assert_allclose(decode(disc_of(hierarchy, 0), bake_tiles(hierarchy, 9).normal_codes(0))[found][:, 0], 1)


def test_a_single_texel_is_the_centre():
    hierarchy = build_hierarchy(rough_sphere())
    one, odd = bake_tiles(hierarchy, 1), bake_tiles(hierarchy, 9)
    same = [np.array_equal(one.normal_codes(k)[0, 0], odd.normal_codes(k)[4, 4]) for k in range(hierarchy.node_count)]
    assert np.mean(same) > 0.95


# --- the atlas


@pytest.mark.parametrize("texels", [1, 2, 3, 16, 100, 512, 1024])
def test_tiles_share_no_texel_and_stay_within_their_layers(texels):
    hierarchy = build_hierarchy(bumpy_sphere(1), min_leaves=6)
    tiles = bake_tiles(hierarchy, texels)
    assert (tiles.texels, tiles.count) == (texels, hierarchy.node_count)
    assert tiles.colors is None
    assert tiles.nbytes == tiles.count * texels**2 * 2
    taken = np.zeros(tiles.normals.shape[:3], bool)
    for tile in range(tiles.count):
        layer, row, column = tiles.corner(tile)
        place = taken[layer, row : row + texels, column : column + texels]
        assert place.shape == (texels, texels)
        assert not place.any()
        place[:] = True
        codes = tiles.normal_codes(tile)
        assert codes.shape == (texels, texels, 2)
        np.testing.assert_array_equal(codes, tiles.normals[layer, row : row + texels, column : column + texels])
    # No layer in vain, and what is in no tile is the own normal.
    assert taken.any(axis=(1, 2)).all()
    assert (tiles.normals[~taken] == 128).all()
    assert taken.sum() == tiles.count * texels**2


def test_every_layer_is_baked():
    # Four tiles a layer. Corner texels lie at the same places whatever the number of texels.
    hierarchy = build_hierarchy(bumpy_sphere(1, height=0.1), min_leaves=3)
    large, small = bake_tiles(hierarchy, LAYER_SIZE // 2), bake_tiles(hierarchy, 2)
    assert hierarchy.node_count > 4
    assert large.normals.shape == (-(-hierarchy.node_count // 4), LAYER_SIZE, LAYER_SIZE, 2)
    for node in range(hierarchy.node_count):
        np.testing.assert_array_equal(
            large.normal_codes(node)[:: LAYER_SIZE // 2 - 1, :: LAYER_SIZE // 2 - 1], small.normal_codes(node)
        )
        assert (large.normal_codes(node) != 128).any()


@pytest.mark.parametrize("texels", [-1, 0, LAYER_SIZE + 1])
def test_a_tile_has_between_1_and_a_layers_texels(texels):
    with pytest.raises(ValueError, match="1 to 1024 texels"):
        bake_tiles(build_hierarchy(box()), texels)


# --- colours


def test_colours_of_triangles_are_interpolated():
    positions, faces = grid(6)
    # A colour that is linear in the position is so in the tiles.
    colors = np.concatenate([np.rint(120 + 100 * positions), np.full((len(positions), 1), 255)], 1).astype(np.uint8)
    hierarchy = build_hierarchy(mesh_of(positions, faces, colors=colors))
    tiles = bake_tiles(hierarchy, 8)
    assert tiles.colors.shape == (*tiles.normals.shape[:3], 4)
    assert tiles.nbytes == tiles.count * 64 * 6
    for node in sample_of_nodes(hierarchy, 12):
        layer, row, column = tiles.corner(node)
        tile = tiles.colors[layer, row : row + 8, column : column + 8].astype(float)
        at = texel_positions(disc_of(hierarchy, node), 8)
        inside = np.abs(at).max(axis=-1) < 1.0 - 1e-6
        assert np.abs(tile[inside][:, :3] - (120 + 100 * at[inside])).max() <= 1.01
        assert (tile[inside][:, 3] == 255).all()
        # Alpha 0 marks texels that hit nothing.
        assert not tile[np.abs(at).max(axis=-1) > 1.0 + 1e-6].any()


def test_colours_of_surfels_are_weighted_like_normals():
    rng = np.random.default_rng(9)
    sphere = surfel_sphere(150)
    colors = rng.integers(0, 256, (150, 4)).astype(np.uint8)
    hierarchy = build_hierarchy(cloud_of(sphere.positions, sphere.normals, sphere.radii, colors))
    leaves, tiles = hierarchy.leaves, bake_tiles(hierarchy, 4)
    arrays = (leaves.positions.astype(float), leaves.normals.astype(float), leaves.radii.astype(float))
    for node in sample_of_nodes(hierarchy, 6):
        # The oracle normalises its sums: with (r, 1), (g, 1), ... for normals the ratio is the weighted mean.
        layer, row, column = tiles.corner(node)
        tile = tiles.colors[layer, row : row + 4, column : column + 4].astype(float)
        for channel in range(4):
            pairs = np.stack([leaves.colors[:, channel], np.ones(150), np.zeros(150)], 1).astype(float)
            sums, found = tile_of_surfels(
                disc_of(hierarchy, node), 4, *arrays, kernel,
                shading_normals=pairs, reach=reach_of(hierarchy, node, 4),
            )  # fmt: skip
            mean = sums[found][:, 0] / sums[found][:, 1]
            assert np.abs(tile[found][:, channel] - mean).max() <= 0.5 + 1e-6
            assert not tile[~found].any()


# --- progress


def test_progress_is_reported_and_can_cancel():
    hierarchy = build_hierarchy(bumpy_sphere(10))
    calls = []
    tiles = bake_tiles(hierarchy, 1, progress=lambda stage, fraction: calls.append((stage, fraction)))
    fractions = [fraction for _, fraction in calls]
    assert fractions == sorted(fractions)
    assert (fractions[0], fractions[-1]) == (0.0, 1.0)
    assert all(stage for stage, _ in calls)
    assert tiles.count == hierarchy.node_count

    def cancel(stage, fraction):
        raise Cancelled

    with pytest.raises(Cancelled):
        bake_tiles(hierarchy, 1, progress=cancel)


def test_tiles_do_not_depend_on_the_blocks_they_are_baked_in(monkeypatch):
    hierarchy = build_hierarchy(rough_sphere())
    whole = bake_tiles(hierarchy, 4)
    monkeypatch.setattr("hierarchy.normal_tiles.BLOCK", 7)
    calls = []
    blocks = bake_tiles(hierarchy, 4, progress=lambda stage, fraction: calls.append(fraction))
    np.testing.assert_array_equal(blocks.normals, whole.normals)
    assert len(calls) == -(-hierarchy.node_count // 7) + 1


def test_only_the_wanted_nodes_are_baked_and_take_room():
    hierarchy = build_hierarchy(bumpy_sphere(4))
    whole = bake_tiles(hierarchy, 8)
    wanted = np.array([7, 0, 3, 7], np.uint32)
    some = bake_tiles(hierarchy, 8, nodes=wanted)
    assert (some.count, whole.count) == (3, hierarchy.node_count)
    assert np.flatnonzero(some.tile_of_node >= 0).tolist() == [0, 3, 7]
    for node in (0, 3, 7):
        tile = some.tile_of_node[node]
        np.testing.assert_array_equal(some.normal_codes(tile), whole.normal_codes(whole.tile_of_node[node]))


def test_no_tile_for_no_node():
    hierarchy = build_hierarchy(bumpy_sphere(4))
    none = bake_tiles(hierarchy, 8, nodes=np.empty(0, np.uint32))
    assert none.count == none.nbytes == 0
    assert (none.tile_of_node == -1).all()
    assert none.as_fitted().nbytes == 0


def test_corner_that_is_farther_away_than_integers_count_texels():
    """Such a texel's number is undefined: a loop up to it did not end."""
    hierarchy = build_hierarchy(make_meteoroid(500))
    positions = hierarchy.leaves.positions.copy()
    positions[[7, 50, 200]] *= np.float32(1e38)
    far = replace(hierarchy, leaves=replace(hierarchy.leaves, positions=positions))
    assert bake_tiles(far, 4).count == hierarchy.node_count
