"""Tiles that have been kept are handed out instead of being baked, and nobody can tell which are which."""

from dataclasses import replace

import numpy as np
import pytest
from same_tiles import assert_same_tiles

from hierarchy import tile_shelf
from hierarchy.build import build_hierarchy
from hierarchy.meteoroid import make_meteoroid
from hierarchy.normal_tiles import TileBaker
from hierarchy.tile_parts import bytes_of_each, chosen, joined
from hierarchy.tile_shelf import ShownTiles, TileShelf
from hierarchy.tile_sizes import sides_of

TEXELS = 16


@pytest.fixture(scope="module", params=["plain", "coloured"])
def hierarchy(request):
    mesh = make_meteoroid(3_000)
    colors = np.random.default_rng(1).integers(0, 256, (len(mesh.positions), 4), dtype=np.uint8)
    return build_hierarchy(replace(mesh, colors=colors if request.param == "coloured" else None))


@pytest.fixture(scope="module")
def wanted(hierarchy):
    """All nodes, and for each some number of texels."""
    nodes = np.arange(hierarchy.node_count, dtype=np.uint32)
    return nodes, np.random.default_rng(2).choice(sides_of(TEXELS), len(nodes)).astype(np.int32)


@pytest.fixture(scope="module")
def baked(hierarchy, wanted):
    return TileBaker(hierarchy, TEXELS).fitted(*wanted)


def no_baking(*_arguments, **_keywords):
    raise AssertionError("a tile was baked that had been kept")


def test_parts_joined_are_the_whole(baked):
    assert len(baked.normals) > 2
    places = np.random.default_rng(3).permutation(len(baked.nodes))
    halves = [chosen(baked, places[:700]), chosen(baked, places[700:])]
    assert_same_tiles(chosen(joined(halves), np.argsort(places)), baked)
    none = chosen(baked, places[:0])
    assert (len(none.nodes), none.normals, none.colors) == (0, {}, {})
    assert_same_tiles(joined([none, baked, none]), baked)


def test_bytes_of_tiles_are_those_of_their_arrays(baked):
    texels = sum(array.nbytes for array in (*baked.normals.values(), *baked.colors.values()))
    assert bytes_of_each(baked).sum() == texels + 16 * len(baked.nodes)


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_kept_and_baked_tiles_together_are_those_that_are_baked(hierarchy, wanted, baked, share, monkeypatch):
    kept = np.flatnonzero(np.random.default_rng(4).random(len(baked.nodes)) < share)
    shelf = TileShelf(hierarchy, TEXELS, ShownTiles(TEXELS, chosen(baked, kept)))
    if share == 1.0:
        monkeypatch.setattr(TileBaker, "fitted", no_baking)
    assert_same_tiles(shelf.fitted(*wanted, at_once=True), baked)
    assert shelf.found == np.count_nonzero(baked.sides[kept])
    taken = shelf.take(*wanted)
    assert taken is None if share == 0.0 else taken.nodes.tolist() == kept.tolist()


def test_tile_that_might_have_had_more_or_fewer_texels_is_baked(hierarchy, wanted, baked):
    """What it looks like would depend on the view that it was kept from."""
    nodes, most = wanted
    other = np.where(most == TEXELS, 2, TEXELS).astype(np.int32)
    shelf = TileShelf(hierarchy, TEXELS, ShownTiles(TEXELS, baked))
    assert shelf.take(nodes, other) is None
    assert_same_tiles(shelf.fitted(nodes, other), TileBaker(hierarchy, TEXELS).fitted(nodes, other))
    assert shelf.found == 0


def test_nothing_is_wanted(hierarchy, wanted, baked):
    none = wanted[0][:0], wanted[1][:0]
    for kept in (None, ShownTiles(TEXELS, baked), ShownTiles(TEXELS, chosen(baked, np.arange(0)))):
        shelf = TileShelf(hierarchy, TEXELS, kept)
        assert shelf.take(*none) is None
        assert len(shelf.fitted(*none).nodes) == 0


def test_what_is_worth_keeping_is_the_picture_s_whatever_it_came_from(hierarchy, wanted, baked):
    nodes, most = wanted
    half = np.arange(len(nodes) // 2)
    shelf = TileShelf(hierarchy, TEXELS, ShownTiles(TEXELS, chosen(baked, half)))
    picture = slice(len(nodes) // 4, None)
    for first in (600, 0, 600):
        shelf.fitted(nodes[first:], most[first:])
    shown = shelf.worth_keeping(nodes[picture], most[picture])
    assert shown.texels == TEXELS
    assert_same_tiles(shown.tiles, chosen(baked, np.arange(len(nodes))[picture]))
    # Asked for once.
    assert not shelf.remembers
    shelf.fitted(nodes, np.full_like(most, 2))
    assert shelf.worth_keeping(nodes, np.full_like(most, 2)) is None


def test_tiles_that_have_all_been_kept_are_not_worth_it_again(hierarchy, wanted, baked):
    nodes, most = wanted
    shelf = TileShelf(hierarchy, TEXELS, ShownTiles(TEXELS, baked))
    shelf.fitted(nodes, most)
    # These are not of the picture.
    shelf.fitted(nodes, np.full_like(most, TEXELS))
    assert shelf.worth_keeping(nodes[::3], most[::3]) is None
    assert TileShelf(hierarchy, TEXELS).worth_keeping(nodes, most) is None


def test_largest_nodes_are_kept_where_not_all_fit_and_not_written_again(hierarchy, wanted, baked):
    room = int(bytes_of_each(baked)[:100].sum())
    shelf = TileShelf(hierarchy, TEXELS)
    shelf.fitted(*wanted)
    shown = shelf.worth_keeping(*wanted, most_bytes=room)
    assert_same_tiles(shown.tiles, chosen(baked, np.arange(100)))
    again = TileShelf(hierarchy, TEXELS, shown)
    again.fitted(*wanted)
    assert again.worth_keeping(*wanted, most_bytes=room) is None


def test_no_more_is_remembered_than_can_be_kept(hierarchy, wanted, monkeypatch):
    monkeypatch.setattr(tile_shelf, "MOST_BYTES", 1)
    shelf = TileShelf(hierarchy, TEXELS)
    for first in (0, 100, 200):
        shelf.fitted(wanted[0][first : first + 100], wanted[1][first : first + 100])
    assert len(shelf.worth_keeping(*wanted, most_bytes=10**9).tiles.nodes) == 100


def test_lack_of_memory_keeps_nothing_and_is_no_error(hierarchy, wanted, monkeypatch):
    def fail(*_):
        raise MemoryError

    shelf = TileShelf(hierarchy, TEXELS)
    shelf.fitted(*wanted)
    monkeypatch.setattr(tile_shelf, "joined", fail)
    assert shelf.worth_keeping(*wanted) is None
