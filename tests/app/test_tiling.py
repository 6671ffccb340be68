"""Tiles that are baked when they are first drawn, and kept on the GPU as long as there is room."""

import threading
import time
from dataclasses import replace

import numpy as np
import pytest

from app.baker import Baker
from app.tiling import Tiling
from hierarchy.build import build_hierarchy
from hierarchy.lod import select_cut
from hierarchy.meteoroid import make_meteoroid
from hierarchy.normal_tiles import TileBaker, bake_tiles
from hierarchy.tile_kernels import LAYER_SIZE
from hierarchy.view import look_at
from renderer.renderer import Renderer
from renderer.settings import Settings
from renderer.targets import make_picture

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


def wait_for_all(tiling, hierarchy, texels, cut):
    end = time.monotonic() + 60.0
    while tiling.follow(hierarchy, texels, cut):
        assert time.monotonic() < end
        time.sleep(0.005)


def picture(renderer, hierarchy, turn=0.0):
    framebuffer = make_picture(renderer._ctx, renderer.limits, SIZE)
    renderer.draw(cut_of(hierarchy, turn), view_of(hierarchy, turn), Settings(), framebuffer)
    return renderer.read_arrays()


@pytest.mark.parametrize("texels", [3, 16])
def test_strips_hold_the_same_tiles_as_the_atlas(hierarchy, texels):
    baker, whole = TileBaker(hierarchy, texels), bake_tiles(hierarchy, texels)
    nodes = np.arange(0, hierarchy.node_count, 7, dtype=np.uint32)[: 2 * baker.tiles_of_strip + 5]
    strips = baker.strips(nodes)
    side = LAYER_SIZE // texels
    for number, node in enumerate(nodes):
        column = number % side * texels
        tile = strips.normals[number // side, :, column : column + texels]
        np.testing.assert_array_equal(tile, whole.normal_codes(int(node)))


def test_pictures_are_those_of_all_tiles_once_those_of_the_cut_are_there(renderer, hierarchy):
    renderer.set_tiles(bake_tiles(hierarchy, 8))
    expected = picture(renderer, hierarchy)
    tiling = Tiling(renderer, lambda: None)
    tiling.forget()
    cut = cut_of(hierarchy)
    missing = tiling.follow(hierarchy, 8, cut)
    assert 0 < missing == np.count_nonzero(cut.splats < hierarchy.node_count)
    wait_for_all(tiling, hierarchy, 8, cut)
    found = picture(renderer, hierarchy)
    # Elsewhere in the texture a tile's coordinates are rounded otherwise.
    assert np.abs(found.color.astype(int) - expected.color).max() <= 1
    np.testing.assert_allclose(found.normal, expected.normal, atol=0.02)
    # What has been baked is not baked again.
    assert tiling.follow(hierarchy, 8, cut) == 0
    assert not tiling.busy
    tiling.close()


def test_last_tiles_are_drawn_with_until_those_of_another_size_are_there(renderer, hierarchy):
    tiling, cut = Tiling(renderer, lambda: None), cut_of(hierarchy)
    wait_for_all(tiling, hierarchy, 4, cut)
    assert tiling.texels == 4
    assert tiling.follow(hierarchy, 16, cut) > 0
    assert tiling.texels == 4
    # Whoever changes his mind has lost nothing.
    assert tiling.follow(hierarchy, 4, cut) == 0
    wait_for_all(tiling, hierarchy, 16, cut)
    assert tiling.texels == 16
    tiling.close()


def test_nothing_is_left_to_do_once_no_tiles_are_wanted(renderer, hierarchy):
    """Normal mapping is switched off while tiles are baked: the window would draw for ever."""
    tiling, cut = Tiling(renderer, lambda: None), cut_of(hierarchy)
    assert tiling.follow(hierarchy, 16, cut) > 0
    time.sleep(0.05)
    assert tiling.follow(hierarchy, 0, cut) == 0
    time.sleep(0.1)
    assert not tiling.has_news
    assert not tiling.busy
    wait_for_all(tiling, hierarchy, 16, cut)
    tiling.close()


def test_pages_that_are_half_empty_are_packed_when_they_run_out(renderer, hierarchy, monkeypatch):
    """Every small step of an orbit took a page for a few tiles; when there was none left the same tiles were baked for
    ever."""
    renderer.limits = replace(renderer.limits, tile_bytes=1)
    tiling = Tiling(renderer, lambda: None)
    whole = cut_of(hierarchy)
    nodes = whole.splats[whole.splats < hierarchy.node_count]
    assert len(nodes) > 180
    for last in range(1, 181, 3):
        # A tile more than there was, on a page of its own.
        cut = replace(whole, splats=nodes[:last], silhouette_splats=0)
        wait_for_all(tiling, hierarchy, 64, cut)
    assert not tiling.busy
    tiling.close()


def test_cut_larger_than_the_memory_gets_tiles_for_its_largest_splats(renderer, hierarchy):
    renderer.limits = replace(renderer.limits, tile_bytes=1)
    tiling = Tiling(renderer, lambda: None)
    for distance in (6.0, 2.0, 3.0):
        cut = cut_of(hierarchy, distance=distance)
        wait_for_all(tiling, hierarchy, 64, cut)
        slots = tiling._shown.pages.slots_of(cut.splats)
        nodes = np.sort(cut.splats[cut.splats < hierarchy.node_count])
        assert np.array_equal(np.sort(cut.splats[slots >= 0]), nodes[:192])
    assert tiling._shown.pages.untiled > 0
    # Not all are there, nor will they be.
    assert tiling.texels == 0
    tiling.close()


def test_failure_is_told_once_and_not_tried_again(renderer, hierarchy, monkeypatch):
    def fail(self, nodes):
        raise MemoryError

    monkeypatch.setattr(TileBaker, "strips", fail)
    tiling, cut = Tiling(renderer, lambda: None), cut_of(hierarchy)
    end = time.monotonic() + 10.0
    while not tiling.trouble:
        assert time.monotonic() < end
        tiling.follow(hierarchy, 4, cut)
        time.sleep(0.01)
    assert tiling.trouble == "There is not enough memory for normal tiles"
    assert tiling.follow(hierarchy, 4, cut) == 0
    assert not tiling.busy
    monkeypatch.undo()
    wait_for_all(tiling, hierarchy, 8, cut)
    tiling.close()


def test_least_recently_drawn_pages_make_room(renderer, hierarchy):
    """One layer of tiles of 64 x 64 texels has 16 pages of 16."""
    renderer.limits = replace(renderer.limits, tile_bytes=1)
    pages, baker = renderer.make_pages(64), TileBaker(hierarchy, 64)
    assert pages.nbytes == 2 * LAYER_SIZE**2
    nodes = np.arange(hierarchy.node_count, dtype=np.uint32)
    assert len(pages.missing(nodes)) == pages.capacity == 192
    for first in range(0, 256, 16):
        pages.mark(nodes[first : first + 16])
        assert pages.add(baker.strips(nodes[first : first + 16]))
    assert len(pages.missing(nodes[:192])) == 0
    # The oldest page goes; what is drawn stays even if there is no other.
    pages.mark(nodes[240:256])
    assert pages.add(baker.strips(nodes[256:272]))
    assert pages.missing(nodes[:32]).tolist() == list(range(16))
    assert len(pages.missing(nodes[32:192])) == 0
    pages.mark(nodes[16:208])
    for first in (272, 288, 304, 320):
        assert pages.add(baker.strips(nodes[first : first + 16]))
    assert not pages.add(baker.strips(nodes[336:352]))
    assert len(pages.missing(nodes[16:208])) == 0
    assert len(pages.missing(nodes[336:352])) == 16
    # What is baked twice moves, and is not lost with the page where it was.
    pages.clear()
    pages.mark(nodes[:16])
    assert pages.add(baker.strips(nodes[:16]))
    assert pages.add(baker.strips(nodes[:16]))
    pages.mark(nodes[:16])
    for first in range(16, 256, 16):
        assert pages.add(baker.strips(nodes[first : first + 16]))
    assert len(pages.missing(nodes[:16])) == 0
    pages.release()


def test_baker_bakes_what_is_wanted_now_in_order(hierarchy):
    woken = threading.Event()
    baker, tiles = Baker(woken.set, threads=2), TileBaker(hierarchy, 16)
    other = TileBaker(hierarchy, 8)
    baker.want(other, np.arange(200, dtype=np.uint32))
    wanted = np.arange(1000, dtype=np.uint32)
    baker.want(tiles, wanted)
    baked = []
    end = time.monotonic() + 60.0
    while sum(len(strips.nodes) for strips in baked) < 1000:
        assert time.monotonic() < end
        baked += baker.take(tiles)
        time.sleep(0.005)
    assert woken.is_set()
    assert not baker.busy
    assert all(strips.texels == 16 for strips in baked)
    found = np.concatenate([strips.nodes for strips in baked])
    np.testing.assert_array_equal(np.sort(found), wanted)
    baker.close()
