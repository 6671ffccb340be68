"""The tiles of one cut after the other, baked at once on all cores: for pictures that can wait for them."""

from __future__ import annotations

import time

from hierarchy.hierarchy import Hierarchy
from hierarchy.lod import Cut
from hierarchy.model import Progress, ignore_progress
from hierarchy.normal_tiles import BLOCK, TileBaker
from hierarchy.view import View
from renderer.renderer import Renderer


class CutTiles:
    """Keeps the tiles of a renderer those of the cut that it draws next.

    baked, tiles, nbytes, seconds : nodes whose normals were looked at, tiles and bytes that they took, and how long
    """

    def __init__(self, renderer: Renderer, hierarchy: Hierarchy, texels: int) -> None:
        """Draw with tiles of at most `texels` x `texels` from now on; raises GpuError where there is no room for any.

        hierarchy : the renderer's
        """
        self.texels = texels
        self.baked = self.tiles = self.nbytes = 0
        self.seconds = 0.0
        self._hierarchy = hierarchy
        self._baker = TileBaker(hierarchy, texels)
        self._pages = renderer.make_pages(texels)
        renderer.set_tiles(self._pages)

    def bring(self, cut: Cut, view: View, progress: Progress = ignore_progress) -> None:
        """Bake what a cut needs and what is not there yet.

        progress : called from this thread; an exception that it raises ends the work
        """
        start = time.perf_counter()
        self._pages.mark(cut.splats)
        if not self._bring(cut, view, progress):
            # Pages that are full of what is not drawn any more stand in the way.
            self._pages.clear()
            self._pages.mark(cut.splats)
            self._bring(cut, view, progress)
        self.seconds += time.perf_counter() - start

    def _bring(self, cut: Cut, view: View, progress: Progress) -> bool:
        nodes, most = self._pages.missing(cut.splats, view, self._hierarchy)
        for first in range(0, len(nodes), BLOCK):
            progress("Baking normal tiles", first / len(nodes))
            block = slice(first, first + BLOCK)
            tiles = self._baker.fitted(nodes[block], most[block], at_once=True)
            self.baked += len(tiles.nodes)
            self.tiles += tiles.count
            self.nbytes += tiles.nbytes
            if not self._pages.add(tiles):
                return False
        progress("Baking normal tiles", 1.0)
        return True
