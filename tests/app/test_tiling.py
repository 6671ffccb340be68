"""Tiles that are baked when they are first drawn, and kept on the GPU as long as there is room."""

import threading
import time
from dataclasses import replace

import numpy as np
import pytest

from app.baker import Baker
from app.tiling import Tiling
from hierarchy import tile_sizes
from hierarchy.build import build_hierarchy
from hierarchy.lod import select_cut
from hierarchy.meteoroid import make_meteoroid
from hierarchy.normal_tiles import FittedTiles, TileBaker, bake_tiles
from hierarchy.tile_sizes import texels_seen
from hierarchy.view import look_at
from renderer.renderer import Renderer
from renderer.settings import Settings
from renderer.targets import make_picture
from renderer.tile_pages import MISSING, TilePages
from renderer.tile_places import LAYER_HEIGHT, LAYER_WIDTH, layer_of, row_of

SIZE = (160, 120)


@pytest.fixture(scope="module")
def hierarchy():
    return build_hierarchy(make_meteoroid(20_000))


@pytest.fixture
def renderer(ctx, hierarchy):
    renderer = Renderer(ctx)
    renderer.set_hierarchy(hierarchy)
    yield renderer
    renderer.release()


def view_of(hierarchy, turn=0.0, distance=3.0):
    eye = distance * np.array([np.cos(turn), np.sin(turn), 0.3])
    return look_at(eye, np.zeros(3), (0.0, 0.0, 1.0), 0.8, SIZE, bounds=hierarchy.bounds)


def cut_of(hierarchy, turn=0.0, distance=3.0):
    return select_cut(hierarchy, view_of(hierarchy, turn, distance), 2.0, 4.0)


def wait_for_all(tiling, hierarchy, texels, cut, turn=0.0, distance=3.0):
    end = time.monotonic() + 60.0
    while tiling.follow(hierarchy, texels, cut, view_of(hierarchy, turn, distance)):
        assert time.monotonic() < end
        time.sleep(0.005)


def picture(renderer, hierarchy, turn=0.0):
    framebuffer = make_picture(renderer._ctx, renderer.limits, SIZE)
    renderer.draw(cut_of(hierarchy, turn), view_of(hierarchy, turn), Settings(), framebuffer)
    return renderer.read_arrays()


def test_pictures_are_those_of_all_tiles_once_those_of_the_cut_are_there(renderer, hierarchy):
    renderer.set_tiles(bake_tiles(hierarchy, 32))
    best = picture(renderer, hierarchy)
    renderer.set_tiles(bake_tiles(hierarchy, 8))
    expected = picture(renderer, hierarchy)
    tiling = Tiling(renderer, lambda: None)
    tiling.forget()
    cut = cut_of(hierarchy)
    view = view_of(hierarchy)
    missing = tiling.follow(hierarchy, 8, cut, view)
    assert 0 < missing == np.count_nonzero(cut.splats < hierarchy.node_count)
    wait_for_all(tiling, hierarchy, 8, cut)
    found = picture(renderer, hierarchy)
    covered = expected.coverage > 0.0
    assert np.array_equal(found.coverage > 0.0, covered)

    def degrees(frame):
        cosines = np.clip(np.sum(frame.normal * best.normal, axis=-1)[covered], -1.0, 1.0)
        return np.degrees(np.arccos(cosines))

    # As close to the best picture as tiles of one size are.
    assert degrees(found).mean() < 1.1 * degrees(expected).mean()
    assert np.percentile(degrees(found), 99.0) < 1.3 * np.percentile(degrees(expected), 99.0)
    # What has been baked is not baked again.
    assert tiling.follow(hierarchy, 8, cut, view) == 0
    assert not tiling.busy
    tiling.close()


def test_last_tiles_are_drawn_with_until_those_of_another_size_are_there(renderer, hierarchy):
    tiling, cut = Tiling(renderer, lambda: None), cut_of(hierarchy)
    wait_for_all(tiling, hierarchy, 4, cut)
    assert tiling.texels == 4
    assert tiling.follow(hierarchy, 16, cut, view_of(hierarchy)) > 0
    assert tiling.texels == 4
    # Whoever changes his mind has lost nothing.
    assert tiling.follow(hierarchy, 4, cut, view_of(hierarchy)) == 0
    wait_for_all(tiling, hierarchy, 16, cut)
    assert tiling.texels == 16
    tiling.close()


def test_nothing_is_left_to_do_once_no_tiles_are_wanted(renderer, hierarchy):
    """Normal mapping is switched off while tiles are baked: the window would draw for ever."""
    tiling, cut = Tiling(renderer, lambda: None), cut_of(hierarchy)
    assert tiling.follow(hierarchy, 16, cut, view_of(hierarchy)) > 0
    time.sleep(0.05)
    assert tiling.follow(hierarchy, 0, cut, view_of(hierarchy)) == 0
    time.sleep(0.1)
    assert not tiling.has_news
    assert not tiling.busy
    wait_for_all(tiling, hierarchy, 16, cut)
    tiling.close()


@pytest.fixture
def rough(monkeypatch):
    """A model whose tiles all keep all their texels, and a renderer's pages that are asked for no fewer."""

    def whole(_hierarchy, _view, nodes, texels):
        return np.full(len(nodes), texels, np.int32)

    monkeypatch.setattr(tile_sizes, "texels_seen", whole)
    model = make_meteoroid(20_000)
    normals = model.normals + 0.4 * np.random.default_rng(3).normal(size=model.normals.shape)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return build_hierarchy(replace(model, normals=normals.astype(np.float32), colors=None))


def limit_to_16_pages(renderer, **limits):
    """Leave room for one layer of tiles, of 32 x 32 texels 16 pages of 8; return its bytes."""
    limits = replace(renderer.limits, **limits)
    of_layer = LAYER_WIDTH * LAYER_HEIGHT * (2 if limits.fine_filter else 4)
    renderer.limits = replace(limits, tile_bytes=of_layer)
    return of_layer


def test_pages_of_what_is_not_drawn_any_more_make_room(renderer, rough, monkeypatch):
    """Every page holds a tile that is still drawn, most of the others are not: all are baked again on few pages."""
    limit_to_16_pages(renderer)
    renderer.set_hierarchy(rough)
    cleared = []
    clear = TilePages.clear
    monkeypatch.setattr(TilePages, "clear", lambda pages: (cleared.append(True), clear(pages)))
    tiling, whole = Tiling(renderer, lambda: None), cut_of(rough)
    nodes = np.arange(1, 257, dtype=np.uint32)
    # 16 pages of 8 tiles.
    for first in range(0, 96, 8):
        wait_for_all(tiling, rough, 32, replace(whole, splats=nodes[first : first + 8], silhouette_splats=0))
    kept = nodes[:96:8]
    wait_for_all(tiling, rough, 32, replace(whole, splats=kept, silhouette_splats=0))
    assert not cleared
    cut = replace(whole, splats=np.concatenate([kept, nodes[128:200]]), silhouette_splats=0)
    wait_for_all(tiling, rough, 32, cut)
    assert cleared
    assert tiling._shown.pages.untiled == 0
    assert not tiling.busy
    tiling.close()


def test_cut_larger_than_the_memory_gets_tiles_for_its_largest_splats(renderer, rough):
    limit_to_16_pages(renderer)
    renderer.set_hierarchy(rough)
    tiling = Tiling(renderer, lambda: None)
    for distance in (6.0, 2.0, 3.0):
        cut = cut_of(rough, distance=distance)
        wait_for_all(tiling, rough, 32, cut, distance=distance)
        pages = tiling._shown.pages
        nodes = np.sort(cut.splats[cut.splats < rough.node_count])
        with_tiles = cut.splats[pages.places_of(cut.splats)[:, 0] != MISSING]
        # Of 16 pages of 8 tiles four may be almost empty; a few tiles turn out to be smaller.
        room = len(nodes) - pages.untiled
        assert room == len(nodes) or 96 <= room < 128
        assert np.array_equal(np.sort(with_tiles), nodes[:room])
    # Not all are there, nor will they be.
    assert tiling.texels == 0
    tiling.close()


def test_small_tiles_take_little_room(renderer, hierarchy):
    """A thousand tiles of up to 32 x 32 texels do not fit into 16 pages; those that they are fitted by do."""
    limit_to_16_pages(renderer)
    tiling, cut = Tiling(renderer, lambda: None), cut_of(hierarchy)
    assert np.count_nonzero(cut.splats < hierarchy.node_count) > 512
    wait_for_all(tiling, hierarchy, 32, cut)
    assert tiling.texels == 32
    assert tiling._shown.pages.untiled == 0
    tiling.close()


@pytest.mark.parametrize("texels", [2, 4, 8, 16, 32])
def test_small_models_get_all_their_tiles(renderer, texels):
    """There is room for each size, however few tiles there are."""
    small = build_hierarchy(make_meteoroid(200))
    assert small.node_count < 100
    renderer.set_hierarchy(small)
    tiling = Tiling(renderer, lambda: None)
    cut = replace(cut_of(small), splats=np.arange(small.node_count, dtype=np.uint32))
    wait_for_all(tiling, small, texels, cut)
    assert tiling._shown.pages.untiled == 0
    assert tiling.texels == texels
    tiling.close()


def test_failure_is_told_once_and_not_tried_again(renderer, hierarchy, monkeypatch):
    def fail(self, nodes, most, **_):
        raise MemoryError

    monkeypatch.setattr(TileBaker, "fitted", fail)
    tiling, cut = Tiling(renderer, lambda: None), cut_of(hierarchy)
    end = time.monotonic() + 10.0
    while not tiling.trouble:
        assert time.monotonic() < end
        tiling.follow(hierarchy, 4, cut, view_of(hierarchy))
        time.sleep(0.01)
    assert tiling.trouble == "There is not enough memory for normal tiles"
    assert tiling.follow(hierarchy, 4, cut, view_of(hierarchy)) == 0
    assert not tiling.busy
    monkeypatch.undo()
    wait_for_all(tiling, hierarchy, 8, cut)
    tiling.close()


def missing_of(pages, nodes):
    """Return those of the nodes that have no tile."""
    return nodes[pages.places_of(nodes)[:, 0] == MISSING]


def tiles_of_one_size(nodes, side):
    """Return tiles of a made-up kind, each full of its node's number."""
    tiles = np.broadcast_to((nodes % 251).astype(np.uint8)[:, None, None, None], (len(nodes), side, side, 2))
    sides = np.full(len(nodes), side, np.int32)
    spreads = np.tile(np.array([0, 0, 255, 255], np.uint8), (len(nodes), 1))
    return FittedTiles(nodes, sides, sides, spreads, {side: tiles}, {})


def texels_at(pages, nodes):
    """Return the first and the last texel of each node's tile, as they are on the GPU."""
    dtype, unit = (np.uint8, 1) if pages.normals.dtype == "f1" else (np.uint16, 257)
    texels = np.frombuffer(pages.normals.read(), dtype).reshape(-1, LAYER_HEIGHT, LAYER_WIDTH, 2) // unit
    places = pages.places_of(nodes)[:, 0]
    power, row, column = places >> 28, row_of(places), places & LAYER_WIDTH - 1
    last = np.where(power > 0, 1 << power, pages.texels) - 1
    layer = layer_of(places)
    return texels[layer, row, column, 0], texels[layer, row + last, column + last, 1]


@pytest.mark.parametrize("fine_filter", [True, False], ids=["bytes", "16 bits"])
def test_least_recently_drawn_pages_make_room(renderer, rough, fine_filter):
    of_layer = limit_to_16_pages(renderer, fine_filter=fine_filter)
    renderer.set_hierarchy(rough)
    pages, view = renderer.make_pages(32), view_of(rough)
    assert pages.nbytes == of_layer
    nodes = np.arange(rough.node_count, dtype=np.uint32)
    for first in range(0, 128, 8):
        missing, most = pages.begin(nodes[first : first + 8], view, rough)
        assert (most == 32).all()
        assert pages.add(tiles_of_one_size(missing, 32))
    assert len(missing_of(pages, nodes[:128])) == 0
    # The oldest page goes; what is drawn stays even if there is no other.
    pages.begin(nodes[120:128], view, rough)
    assert pages.add(tiles_of_one_size(nodes[128:136], 32))
    assert missing_of(pages, nodes[:16]).tolist() == list(range(8))
    assert len(missing_of(pages, nodes[16:96])) == 0
    pages.begin(nodes[8:88], view, rough)
    for first in range(136, 184, 8):
        assert pages.add(tiles_of_one_size(nodes[first : first + 8], 32))
    assert len(missing_of(pages, nodes[8:88])) == 0
    assert not pages.add(tiles_of_one_size(nodes[184:192], 32))
    assert len(missing_of(pages, nodes[184:192])) == 8
    # What is baked twice moves, and is not lost with the page where it was.
    pages.clear()
    pages.begin(nodes[:8], view, rough)
    assert pages.add(tiles_of_one_size(nodes[:8], 32))
    assert pages.add(tiles_of_one_size(nodes[:8], 32))
    pages.begin(nodes[:8], view, rough)
    for first in range(8, 128, 8):
        assert pages.add(tiles_of_one_size(nodes[first : first + 8], 32))
    assert len(missing_of(pages, nodes[:8])) == 0
    pages.release()


@pytest.mark.parametrize("sizes", [(2, 4, 8, 16), (2, 4, 8, 12), (2, 4, 8, 16, 32)], ids=str)
def test_tiles_of_all_sizes_lie_where_they_are_looked_up(renderer, hierarchy, sizes):
    """Batches that end in the midst of rows and pages, of every size, and tiles that come again larger."""
    pages, view = renderer.make_pages(sizes[-1]), view_of(hierarchy)
    nodes = np.arange(hierarchy.node_count, dtype=np.uint32)
    rng = np.random.default_rng(7)
    side_of = np.zeros(len(nodes), int)
    for _ in range(60):
        side = int(rng.choice(sizes))
        some = np.sort(rng.choice(nodes, int(rng.integers(1, 700)), replace=False))
        some = some[side_of[some] < side]
        pages.begin(some, view, hierarchy)
        assert pages.add(tiles_of_one_size(some, side))
        side_of[some] = side
    there = nodes[side_of > 0]
    assert len(missing_of(pages, there)) == 0
    power = pages.places_of(there)[:, 0] >> 28
    np.testing.assert_array_equal(np.where(power > 0, 1 << power, sizes[-1]), side_of[there])
    for found in texels_at(pages, there):
        np.testing.assert_array_equal(found, there % 251)
    pages.release()


def test_tiles_grow_with_what_is_seen_of_them(renderer, hierarchy):
    """From far away four texels show a splat; near by it needs more, and gets them."""
    tiling = Tiling(renderer, lambda: None)
    far, near = view_of(hierarchy, distance=40.0), view_of(hierarchy, distance=2.0)
    cut = replace(cut_of(hierarchy, distance=2.0), silhouette_splats=0)
    nodes = cut.splats[cut.splats < hierarchy.node_count]
    assert texels_seen(hierarchy, far, nodes, 32).max() < texels_seen(hierarchy, near, nodes, 32).max()
    total = []
    for view in (far, near):
        end = time.monotonic() + 60.0
        while tiling.follow(hierarchy, 32, cut, view):
            assert time.monotonic() < end
            time.sleep(0.005)
        power = tiling._shown.pages.places_of(nodes)[:, 0]
        sides = np.where(power < 0, 0, np.where(power >> 28 > 0, 1 << (power >> 28), 32))
        assert (sides <= texels_seen(hierarchy, view, nodes, 32)).all()
        total.append(int(sides.sum()))
    assert total[1] > 1.5 * total[0]
    tiling.close()


def test_baker_bakes_what_is_wanted_now_in_order(hierarchy):
    woken = threading.Event()
    baker, tiles = Baker(woken.set, threads=2), TileBaker(hierarchy, 16)
    other = TileBaker(hierarchy, 8)
    wanted = np.arange(1000, dtype=np.uint32)
    baker.want(other, wanted[:200], np.full(200, 8, np.int32))
    baker.want(tiles, wanted, np.full(1000, 16, np.int32))
    # What has been baked and not been taken yet is not baked again, whoever still wants it.
    time.sleep(0.1)
    baker.want(tiles, wanted, np.full(1000, 16, np.int32))
    baked = []
    end = time.monotonic() + 60.0
    while sum(len(each.nodes) for each in baked) < 1000:
        assert time.monotonic() < end
        baked += baker.take(tiles)
        time.sleep(0.005)
    assert woken.is_set()
    assert not baker.busy
    assert all((each.most == 16).all() for each in baked)
    found = np.concatenate([each.nodes for each in baked])
    np.testing.assert_array_equal(np.sort(found), wanted)
    baker.close()


def test_kept_tiles_are_there_with_the_first_picture(renderer, hierarchy):
    """Nothing is left to bake, and nothing new to keep."""
    cut, view = cut_of(hierarchy), view_of(hierarchy)
    first = Tiling(renderer, lambda: None)
    wait_for_all(first, hierarchy, 8, cut)
    expected, kept = picture(renderer, hierarchy), first.unkept
    nodes = np.sort(cut.splats[cut.splats < hierarchy.node_count])
    np.testing.assert_array_equal(kept.tiles.nodes, nodes)
    np.testing.assert_array_equal(kept.tiles.most, texels_seen(hierarchy, view, nodes, 8))
    first.close()
    asked = []
    second = Tiling(renderer, lambda: None, lambda texels: (asked.append(texels), kept)[1])
    second.forget()
    assert second.follow(hierarchy, 8, cut, view) == 0
    assert second.texels == 8
    assert not second.busy
    assert second.unkept is None
    found = picture(renderer, hierarchy)
    np.testing.assert_array_equal(found.normal, expected.normal)
    np.testing.assert_array_equal(found.color, expected.color)
    # Of another view only what is missing is baked.
    turned = cut_of(hierarchy, 0.5)
    missing = second.follow(hierarchy, 8, turned, view_of(hierarchy, 0.5))
    assert 0 < missing < np.count_nonzero(turned.splats < hierarchy.node_count)
    wait_for_all(second, hierarchy, 8, turned, 0.5)
    assert asked == [8]
    second.close()


def test_only_the_first_picture_with_all_its_tiles_is_for_the_cache(renderer, hierarchy):
    tiling = Tiling(renderer, lambda: None)
    tiling.forget()
    assert tiling.follow(hierarchy, 8, cut_of(hierarchy), view_of(hierarchy)) > 0
    assert tiling.unkept is None
    # Whoever looks around meanwhile has another first picture.
    turned = cut_of(hierarchy, 0.5)
    wait_for_all(tiling, hierarchy, 8, turned, 0.5)
    kept, tiling.unkept = tiling.unkept, None
    nodes = turned.splats[turned.splats < hierarchy.node_count]
    assert np.isin(kept.tiles.nodes, nodes).all()
    # But for those that were baked with more texels than this view asks for.
    assert len(kept.tiles.nodes) > 0.95 * len(nodes)
    wait_for_all(tiling, hierarchy, 8, cut_of(hierarchy))
    assert tiling.unkept is None
    tiling.close()
