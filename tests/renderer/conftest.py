"""What the tests of the renderer share: a renderer, and small models to draw."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import moderngl
import pytest

from hierarchy.build import build_hierarchy
from hierarchy.hierarchy import Hierarchy
from hierarchy.lod import Cut, select_cut
from hierarchy.meteoroid import make_meteoroid
from hierarchy.normal_tiles import NormalTiles, bake_tiles
from hierarchy.view import View
from renderer.cut_tiles import CutTiles
from renderer.frame import Frame
from renderer.renderer import Renderer
from renderer.settings import Settings


@pytest.fixture
def renderer(ctx: moderngl.Context) -> Iterator[Renderer]:
    made = Renderer(ctx)
    yield made
    made.release()


@pytest.fixture(scope="session")
def meteoroid() -> tuple[Hierarchy, NormalTiles]:
    """A closed hybrid hierarchy of 2,000 triangles, and its tiles of 8 x 8 texels."""
    hierarchy = build_hierarchy(make_meteoroid(2_000))
    return hierarchy, bake_tiles(hierarchy, 8)


Draw = Callable[..., tuple[Frame, Cut]]


@pytest.fixture
def draw(ctx: moderngl.Context, renderer: Renderer) -> Iterator[Draw]:
    """draw(view, hierarchy, tiles, settings, r_sil, r_inner, cut) returns the frame and the cut.

    tiles : all of one size; or w_s, for those that the viewer would draw with
    """
    framebuffers: list[moderngl.Framebuffer] = []
    last: list[object] = [None, None]

    def draw_once(
        view: View,
        hierarchy: Hierarchy,
        tiles: NormalTiles | int | None = None,
        settings: Settings | None = None,
        r_sil: float = 2.0,
        r_inner: float = 16.0,
        cut: Cut | None = None,
    ) -> tuple[Frame, Cut]:
        settings = settings or Settings()
        if last[0] is not hierarchy:
            renderer.set_hierarchy(hierarchy)
            last[:] = hierarchy, None
        if cut is None:
            cut = select_cut(hierarchy, view, r_sil, r_inner, two_sided=settings.two_sided)
        if isinstance(tiles, int):
            CutTiles(renderer, hierarchy, tiles).bring(cut, view)
            last[1] = tiles
        elif last[1] is not tiles:
            renderer.set_tiles(tiles)
            last[1] = tiles
        framebuffer = ctx.simple_framebuffer((view.width, view.height))
        framebuffers.append(framebuffer)
        renderer.draw(cut, view, settings, framebuffer)
        return renderer.read_arrays(), cut

    yield draw_once
    # moderngl binds the last framebuffer again after it read another one; that must not be one that is gone.
    ctx.detect_framebuffer(0).use()
    for framebuffer in framebuffers:
        framebuffer.release()
