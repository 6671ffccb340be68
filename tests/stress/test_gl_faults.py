"""Graphics cards that hold little, blend no floats, or refuse at any moment."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import moderngl
import numpy as np
import pytest
from faulty_context import FaultyContext
from ledger import Ledger

from app.errors import GraphicsError, graphics_errors
from hierarchy import tile_sizes
from hierarchy.build import build_hierarchy
from hierarchy.hierarchy import Hierarchy
from hierarchy.lod import select_cut
from hierarchy.meteoroid import make_meteoroid
from hierarchy.normal_tiles import NormalTiles, bake_tiles
from hierarchy.view import View, look_at
from renderer.allocation import GpuError
from renderer.cut_tiles import CutTiles
from renderer.limits import Limits, blends_floats, filters_finely, probe_limits
from renderer.renderer import Renderer
from renderer.settings import Settings
from renderer.targets import make_picture, release_picture
from renderer.tile_pages import OF_LAYER, TilePages

SIZE = (96, 72)
SMALL = Limits(texture_size=4096, array_layers=256, picture_size=(4096, 4096))


@pytest.fixture(scope="module")
def model() -> tuple[Hierarchy, NormalTiles]:
    """More tiles than one layer of the atlas holds."""
    hierarchy = build_hierarchy(make_meteoroid(8_000))
    tiles = bake_tiles(hierarchy, 32)
    assert len(tiles.normals) > 1
    return hierarchy, tiles


def view_of(hierarchy: Hierarchy, azimuth: float = 0.5, distance: float = 2.4) -> View:
    eye = distance * np.array([np.sin(azimuth), 0.3, np.cos(azimuth)])
    return look_at(eye, (0, 0, 0), (0, 1, 0), 0.8, SIZE, bounds=hierarchy.bounds)


@contextmanager
def drawing(
    ctx: moderngl.Context, limits: Limits, hierarchy: Hierarchy, tiles: NormalTiles | None
) -> Iterator[Callable]:
    """Give draw(view, settings, r_inner), which returns the picture, and the renderer as draw.renderer.

    tiles : None: those of each cut are baked
    """
    renderer = Renderer(ctx, limits)
    renderer.set_hierarchy(hierarchy)
    cut_tiles = CutTiles(renderer, hierarchy, 32) if tiles is None else None
    if tiles is not None:
        renderer.set_tiles(tiles)
    target = make_picture(ctx, limits, SIZE)

    def draw(view: View, settings: Settings = Settings(), r_inner: float = 8.0) -> np.ndarray:  # noqa: B008
        cut = select_cut(hierarchy, view, 1.0, r_inner)
        if cut_tiles is not None:
            cut_tiles.bring(cut, view)
        renderer.draw(cut, view, settings, target)
        return np.frombuffer(target.read(components=4), np.uint8).reshape(SIZE[1], SIZE[0], 4).astype(int)

    draw.renderer = renderer
    yield draw
    release_picture(target)
    renderer.release()


@pytest.fixture
def rough(monkeypatch) -> Hierarchy:
    """A model whose tiles all keep all their texels, and pages that are asked for no fewer."""

    def whole(_hierarchy: Hierarchy, _view: View, nodes: np.ndarray, texels: int) -> np.ndarray:
        return np.full(len(nodes), texels, np.int32)

    monkeypatch.setattr(tile_sizes, "texels_seen", whole)
    model = make_meteoroid(30_000)
    normals = model.normals + 0.4 * np.random.default_rng(3).normal(size=model.normals.shape).astype(np.float32)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return build_hierarchy(replace(model, normals=normals, colors=None))


@pytest.mark.parametrize("fine_filter", [True, False], ids=["bytes", "16 bits"])
def test_tiles_of_the_cut_are_brought_where_there_is_room_for_no_more(
    ctx, rough, ledger: Ledger, amount, fine_filter: bool
) -> None:
    small, room = replace(SMALL, fine_filter=fine_filter), (2 if fine_filter else 4) * 8 * OF_LAYER
    views = [view_of(rough, azimuth) for azimuth in np.linspace(0.0, 6.0, amount(4, 200))]
    # Back to the first ones, whose tiles have had to make room.
    views += views[:2]
    with drawing(ctx, small, rough, None) as draw:
        expected = [draw(view, r_inner=12.0) for view in views]
        assert draw.renderer._tiles.nbytes > room
    with drawing(ctx, replace(small, tile_bytes=room), rough, None) as draw:
        drawn = [draw(view, r_inner=12.0) for view in views]
        assert draw.renderer.shortcomings == []
        assert draw.renderer._tiles.nbytes == room
    worst = max(np.abs(one - other).max() for one, other in zip(drawn, expected, strict=True))
    # A texel's place in the texture turns the rounding of its filter, of bytes between texels as rough as these by two
    # levels.
    texels = "bytes" if fine_filter else "16 bits"
    ledger.record(
        "faults", f"memory for tiles, {texels}",
        "room for some of the tiles of a model, an orbit", cases=len(views),
        worst=worst, bound=3 if fine_filter else 1, unit="grey levels",
    )  # fmt: skip


def test_more_tiles_in_one_frame_than_there_is_room_for(ctx, rough) -> None:
    near = view_of(rough)
    with drawing(ctx, SMALL, rough, None) as draw:
        whole = draw(near, r_inner=1.5)
        plain = draw(near, Settings(normal_mapping=False), r_inner=1.5)
    with drawing(ctx, replace(SMALL, tile_bytes=8 * 2 * OF_LAYER), rough, None) as draw:
        before = draw(near, r_inner=1.5)
        (line,) = draw.renderer.shortcomings
        assert "one normal each" in line
        draw(view_of(rough, 3.0), r_inner=1.5)
        assert np.array_equal(draw(near, r_inner=1.5), before), "the picture depends on what was drawn before"
    assert np.abs(before - whole).mean() < np.abs(plain - whole).mean()
    assert not np.array_equal(before, plain)
    assert not np.array_equal(before, whole)


@pytest.mark.parametrize("megabytes", [1, 3, 5, 64, 10_000])
def test_tiles_take_no_more_memory_than_allowed(ctx, rough, megabytes: int) -> None:
    with drawing(ctx, replace(SMALL, tile_bytes=megabytes * 1_000_000), rough, None) as draw:
        for azimuth in (0.0, 1.5, 3.0):
            draw(view_of(rough, azimuth), r_inner=6.0)
        held = draw.renderer._tiles.nbytes
    assert held <= megabytes * 1_000_000
    assert (held > 8 * 2 * OF_LAYER) == (megabytes >= 3)


def test_without_blending_of_floats_the_nearest_splats_show(ctx, model) -> None:
    hierarchy, tiles = model
    view = view_of(hierarchy)
    assert blends_floats(ctx)
    assert probe_limits(ctx).float_blending
    with drawing(ctx, SMALL, hierarchy, tiles) as draw:
        blended, nearest = draw(view), draw(view, Settings(blending=False))
    with drawing(ctx, replace(SMALL, float_blending=False), hierarchy, tiles) as draw:
        assert np.array_equal(draw(view), nearest)
        (line,) = draw.renderer.shortcomings
        frame = draw.renderer.read_arrays()
    assert "not blended" in line
    assert not np.array_equal(blended, nearest)
    assert np.isfinite(frame.normal).all()
    assert np.isfinite(frame.depth[frame.coverage > 0]).all()


def test_where_the_filter_rounds_to_bytes_tiles_have_16_bits(ctx, model) -> None:
    fine = filters_finely(ctx)
    if "llvmpipe" in ctx.info["GL_RENDERER"]:
        assert not fine
    assert probe_limits(ctx).fine_filter == fine
    with drawing(ctx, replace(SMALL, fine_filter=fine), *model) as draw:
        draw(view_of(model[0]))
        assert draw.renderer._tiles.normals.dtype == ("f1" if fine else "nu2")


def test_a_picture_larger_than_the_limits_is_one_line(ctx) -> None:
    for size in ((4097, 1), (1, 4097), (100_000, 100_000)):
        with pytest.raises(GpuError, match="4096 x 4096 can be drawn"):
            make_picture(ctx, SMALL, size)


def test_tiles_get_the_memory_that_there_is(ctx, rough, monkeypatch) -> None:
    make = TilePages._textures

    def make_few_layers_only(pages: TilePages, layers: int, copied: Any = None) -> Any:
        if layers > 8:
            raise GpuError("no memory")
        return make(pages, layers, copied)

    monkeypatch.setattr(TilePages, "_textures", make_few_layers_only)
    with drawing(ctx, SMALL, rough, None) as draw:
        for azimuth in (0.0, 1.5, 3.0):
            draw(view_of(rough, azimuth), r_inner=12.0)
        assert draw.renderer._tiles.normals.layers == 8
        assert draw.renderer.shortcomings == []


def test_a_refusal_at_any_moment_is_one_line_and_leaves_what_was_there(ctx, model, ledger: Ledger, amount) -> None:
    """Every single request of a new model, its tiles, a new size and the arrays is refused in turn, in both ways."""
    hierarchy, tiles = model
    first = build_hierarchy(make_meteoroid(500))
    faulty, view = FaultyContext(ctx), view_of(hierarchy)
    bad, cases = [], 0
    renderer = Renderer(faulty, SMALL)  # type: ignore[arg-type]
    targets = [make_picture(ctx, SMALL, size) for size in (SIZE, (40, 30))]

    def draw(model: Hierarchy, target: moderngl.Framebuffer) -> bytes:
        small = replace(view, width=target.size[0], height=target.size[1])
        renderer.draw(select_cut(model, small, 1.0, 8.0), small, Settings(), target)
        renderer.read_arrays()
        return bytes(target.read(components=4))

    def everything() -> bytes:
        renderer.set_hierarchy(first)
        draw(first, targets[1])
        renderer.set_hierarchy(hierarchy)
        renderer.set_tiles(tiles)
        draw(hierarchy, targets[0])
        renderer.set_tiles(None)
        return draw(hierarchy, targets[1])

    faulty.arm(None, by_error=False)
    expected = everything()
    requests = faulty.requests
    assert requests > 40
    for by_error in (False, True):
        for fails_at in range(2, requests, amount(23, 1)):
            faulty.arm(fails_at, by_error=by_error)
            cases += 1
            try:
                with graphics_errors():
                    everything()
            except GraphicsError as error:
                if "\n" in str(error):
                    bad.append((fails_at, by_error, error))
            except Exception as error:
                bad.append((fails_at, by_error, error))
            faulty.arm(None, by_error=False)
            if everything() != expected:
                bad.append((fails_at, by_error, "another picture afterwards"))
    for target in targets:
        release_picture(target)
    renderer.release()
    assert not bad
    ledger.record(
        "faults", "OpenGL refuses", "every request of loading, drawing and reading, by exception and by error",
        cases=cases, worst=len(bad), bound=0, unit="bad ends",
    )  # fmt: skip
