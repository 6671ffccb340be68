"""The tiles of one cut after the other, at once on all cores: for pictures that can wait for them."""

from __future__ import annotations

import time

from hierarchy.hierarchy import Hierarchy
from hierarchy.lod import Cut
from hierarchy.model import Progress, ignore_progress
from hierarchy.normal_tiles import BLOCK, TileBaker
from hierarchy.tile_shelf import TileSource
from hierarchy.view import View
from renderer.renderer import Renderer


class CutTiles:
    """Keeps the tiles of a renderer those of the cut that it draws next.

    tiles, nbytes, seconds : tiles that were brought, the bytes that they take, and how long that took, with baking
    """

    def __init__(self, renderer: Renderer, hierarchy: Hierarchy, texels: int, source: TileSource | None = None) -> None:
        """Draw with tiles of at most `texels` x `texels` from now on; raises GpuError where there is no room for any.

        hierarchy : the renderer's
        source : where its tiles come from, None: all are baked
        """
        self.texels = texels
        self.tiles = self.nbytes = 0
        self.seconds = 0.0
        self._hierarchy = hierarchy
        self._source = TileBaker(hierarchy, texels) if source is None else source
        self._pages = renderer.make_pages(texels)
        renderer.set_tiles(self._pages)

    def bring(self, cut: Cut, view: View, progress: Progress = ignore_progress) -> None:
        """Bring what a cut needs and what is not there yet.

        progress : called from this thread; an exception that it raises ends the work
        """
        start = time.perf_counter()
        if not self._bring(cut, view, progress):
            # Pages that are full of what is not drawn any more stand in the way.
            self._pages.clear()
            self._bring(cut, view, progress)
        self.seconds += time.perf_counter() - start

    def _bring(self, cut: Cut, view: View, progress: Progress) -> bool:
        """Bake what is missing, and then what there is room for since tiles take less than they might; False: clear."""
        while True:
            nodes, most = self._pages.begin(cut.splats, view, self._hierarchy)
            if len(nodes) == 0:
                return True
            for first in range(0, len(nodes), BLOCK):
                progress("Baking normal tiles", first / len(nodes))
                block = slice(first, first + BLOCK)
                tiles = self._source.fitted(nodes[block], most[block], at_once=True)
                if not self._pages.add(tiles):
                    return False
                self.tiles += tiles.count
                self.nbytes += tiles.nbytes
