"""The tiles of what the window shows: baked in the background when a splat is drawn for the first time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from app.baker import Baker
from app.errors import unforeseen
from hierarchy.hierarchy import Hierarchy
from hierarchy.lod import Cut
from hierarchy.tile_shelf import ShownTiles, TileShelf
from hierarchy.tile_sizes import tiles_seen
from hierarchy.view import View
from renderer.allocation import GpuError
from renderer.renderer import Renderer
from renderer.tile_pages import TilePages


@dataclass(frozen=True, eq=False)
class _Tiles:
    """Tiles of one size: where they come from, and where they are on the GPU."""

    shelf: TileShelf
    pages: TilePages


class Tiling:
    """Keeps the renderer's tiles those of the present cut, as far as they have been baked.

    trouble : why tiles are missing that nobody is baking, "": none are; taken by whoever shows it
    unkept : the tiles of the first picture that had all of its own, if some had to be baked: for the cache, since a
        model is first seen from the same side the next time; taken by whoever keeps them
    """

    def __init__(
        self,
        renderer: Renderer,
        wake: Callable[[], None],
        find: Callable[[int], ShownTiles | None] = lambda texels: None,
    ) -> None:
        """Start without tiles.

        wake : called from the background when there are more tiles to draw with
        find : returns what has been kept of the tiles, of so many texels, of the renderer's hierarchy; None: nothing
        """
        self._renderer = renderer
        self._baker = Baker(wake)
        self._find = find
        # The pages of those that are shown are the renderer's; those that are coming are shown once a cut has all.
        self._shown: _Tiles | None = None
        self._coming: _Tiles | None = None
        self._refused: tuple[Hierarchy, int] | None = None
        self.trouble = ""
        self.unkept: ShownTiles | None = None

    @property
    def has_news(self) -> bool:
        """There are tiles that the last picture did not have."""
        return self._baker.has_baked

    @property
    def busy(self) -> bool:
        """Tiles of the last picture are still being baked."""
        return self._baker.busy

    @property
    def texels(self) -> int:
        """Texels along one side of the tiles that are drawn with; 0: none, or some will never come."""
        if self._shown is None or self._refused is not None or self._shown.pages.untiled:
            return 0
        return self._shown.pages.texels

    def forget(self) -> None:
        """Let go of all tiles: the renderer has another hierarchy, or is about to get one."""
        self._baker.drop()
        self._drop_coming()
        self._renderer.set_tiles(None)
        self._shown = self._refused = self.unkept = None

    def follow(self, hierarchy: Hierarchy, texels: int, cut: Cut, view: View) -> int:
        """Bring what has been baked to the GPU, and have baked what a cut still needs; return how many tiles that is.

        texels : along one side of the tiles at most; 0: none are needed. The renderer's hierarchy is that of the cut.
        Until all tiles of another size are there the last ones are drawn with.
        view : what the cut is drawn with
        """
        if texels == 0 or (hierarchy, texels) == self._refused:
            self._baker.drop()
            return 0
        self._refused = None
        try:
            return self._follow(hierarchy, texels, cut, view)
        except GpuError as error:
            self._refuse(hierarchy, texels, f"OpenGL: {error}")
        except MemoryError:
            self._refuse(hierarchy, texels, "There is not enough memory for normal tiles")
        except Exception as error:
            self._refuse(hierarchy, texels, unforeseen(error))
        return 0

    def _follow(self, hierarchy: Hierarchy, texels: int, cut: Cut, view: View) -> int:
        wanted = self._tiles_of(hierarchy, texels)
        if self._shown is not None and self._shown is not wanted:
            self._shown.pages.begin(cut.splats, view, hierarchy)
        missing, most = wanted.pages.begin(cut.splats, view, hierarchy)
        ready = self._baker.take(wanted.shelf)
        kept = wanted.shelf.take(missing, most)
        if kept is not None:
            ready.append(kept)
        for tiles in ready:
            if not wanted.pages.add(tiles):
                # Too many pages hold what is not drawn any more: baked again all at once the tiles of a cut fill few.
                wanted.pages.clear()
                wanted.pages.add(tiles)
        if ready:
            missing, most = wanted.pages.begin(cut.splats, view, hierarchy)
        self._baker.want(wanted.shelf, missing, most)
        if wanted is self._coming and (self._shown is None or len(missing) == 0):
            self._renderer.set_tiles(wanted.pages)
            self._shown, self._coming = wanted, None
        if len(missing) == 0 and wanted.shelf.remembers:
            self.unkept = wanted.shelf.worth_keeping(*tiles_seen(hierarchy, view, cut.splats, texels))
        return len(missing)

    def _tiles_of(self, hierarchy: Hierarchy, texels: int) -> _Tiles:
        """Return the tiles of a size: those that are shown or coming, or new ones that come from now on."""
        if self._shown is not None and self._shown.pages.texels == texels:
            self._drop_coming()
            return self._shown
        if self._coming is None or self._coming.pages.texels != texels:
            self._drop_coming()
            self._coming = _Tiles(TileShelf(hierarchy, texels, self._find(texels)), self._renderer.make_pages(texels))
        return self._coming

    def _drop_coming(self) -> None:
        if self._coming is not None:
            self._coming.pages.release()
            self._coming = None

    def _refuse(self, hierarchy: Hierarchy, texels: int, why: str) -> None:
        self._baker.drop()
        self._refused, self.trouble = (hierarchy, texels), why

    def close(self) -> None:
        """Stop baking."""
        self._baker.close()
        self._drop_coming()
