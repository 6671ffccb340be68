"""The tiles of what the window shows: baked in the background when a splat is drawn for the first time."""

from __future__ import annotations

from collections.abc import Callable

from app.baker import Baker
from app.errors import unforeseen
from hierarchy.hierarchy import Hierarchy
from hierarchy.lod import Cut
from hierarchy.normal_tiles import TileBaker
from renderer.allocation import GpuError
from renderer.renderer import Renderer
from renderer.tile_pages import TilePages


class Tiling:
    """Keeps the renderer's tiles those of the present cut, as far as they have been baked.

    shown : texels along one side of the tiles that are drawn with, 0: none
    trouble : why tiles are missing that nobody is baking, "": none are; taken by whoever shows it
    """

    def __init__(self, renderer: Renderer, wake: Callable[[], None]) -> None:
        """wake : called from the background when there are more tiles to draw with."""
        self._renderer = renderer
        self._baker = Baker(wake)
        self._tiles: TileBaker | None = None
        # Those that tiles are brought to; the renderer's as soon as they have all that a cut needs.
        self._pages: TilePages | None = None
        self._refused: tuple[Hierarchy, int] | None = None
        self.shown = 0
        self.trouble = ""

    @property
    def has_news(self) -> bool:
        """There are tiles that the last picture did not have."""
        return self._baker.has_baked

    @property
    def busy(self) -> bool:
        """Tiles of the last picture are still being baked."""
        return self._baker.busy

    def forget(self) -> None:
        """Let go of all tiles: the renderer has another hierarchy, or is about to get one."""
        self._drop_pages()
        self._renderer.set_tiles(None)
        self._tiles = self._refused = None
        self.shown = 0

    def follow(self, hierarchy: Hierarchy, texels: int, cut: Cut) -> int:
        """Bring what has been baked to the GPU, and have baked what a cut still needs; return how many tiles that is.

        texels : along one side of the tiles; 0: none are needed. The renderer's hierarchy is that of the cut. Until all
        tiles of another size are there the last ones are drawn with.
        """
        if texels == 0 or (hierarchy, texels) == self._refused:
            return 0
        try:
            return self._follow(hierarchy, texels, cut)
        except GpuError as error:
            self._refuse(hierarchy, texels, f"OpenGL: {error}")
        except MemoryError:
            self._refuse(hierarchy, texels, "There is not enough memory for normal tiles")
        except Exception as error:
            self._refuse(hierarchy, texels, unforeseen(error))
        return 0

    def _follow(self, hierarchy: Hierarchy, texels: int, cut: Cut) -> int:
        if self._pages is None or self._tiles is None or self._pages.texels != texels:
            self._drop_pages()
            self._pages, self._tiles = self._renderer.make_pages(texels), TileBaker(hierarchy, texels)
        for strips in self._baker.take(self._tiles):
            self._pages.add(strips)
        missing = self._pages.missing(cut.splats)
        self._baker.want(self._tiles, missing)
        if self.shown in (0, texels) or len(missing) == 0:
            self._renderer.set_tiles(self._pages)
            self.shown = texels
        return len(missing)

    def _drop_pages(self) -> None:
        """Give back pages that the renderer does not draw with."""
        if self._pages is not None and self.shown != self._pages.texels:
            self._pages.release()
        self._pages = None

    def _refuse(self, hierarchy: Hierarchy, texels: int, why: str) -> None:
        self._refused, self.trouble = (hierarchy, texels), why

    def close(self) -> None:
        """Stop baking."""
        self._baker.close()
        self._drop_pages()
