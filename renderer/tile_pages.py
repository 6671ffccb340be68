"""A cache of normal tiles on the GPU: those that were drawn last, of nodes whose tiles are baked one after the other.

A page is a strip as wide as the texture and as high as the largest tile. All tiles of a page have one size; those of
the next batch go on where the last ones ended. When all pages are taken the textures grow, up to the budget; then pages
are used anew in the order in which they were drawn last.
"""

from __future__ import annotations

import moderngl
import numpy as np

from hierarchy.hierarchy import Hierarchy
from hierarchy.model import Int32Array, UInt8Array, UInt32Array
from hierarchy.normal_tiles import FittedTiles
from hierarchy.tile_fits import sides_of, texels_seen
from hierarchy.tile_kernels import LAYER_SIZE
from hierarchy.view import View
from renderer.allocation import GpuError, Held, allocating
from renderer.limits import Limits
from renderer.tile_places import MOST_LAYERS, NO_TILE, layer_of, place_of, row_of

# Bytes of graphics memory for tiles where nobody says: a quarter of a million of 16 x 16 texels.
DEFAULT_BYTES = 1 << 27
# What a node has in place of a tile's place: one that was not baked, and one that needs no tile.
MISSING, NEEDLESS = NO_TILE, NO_TILE - 1
NEVER = -1


class TilePages:
    """Tiles of at most w_s x w_s texels of the nodes of one hierarchy.

    texels : w_s
    untiled : splats of the last cut whose tiles there is no room for
    """

    def __init__(
        self, ctx: moderngl.Context, limits: Limits, texels: int, nodes: int, *, colored: bool, most: int | None = None
    ) -> None:
        """Make room for tiles.

        nodes : of the hierarchy
        colored : its tiles have colours
        most : tiles there is room for at most, where they all have w_s x w_s texels; None: for those of any cut
        Raises GpuError where not even a layer fits.
        """
        self.texels = texels
        self.untiled = 0
        self._sizes = len(sides_of(texels)) if most is None else 1
        self._colored = colored
        of_layer = LAYER_SIZE**2 * (6 if colored else 2)
        budget = DEFAULT_BYTES if limits.tile_bytes is None else limits.tile_bytes
        self._of_layer = LAYER_SIZE // texels
        # Some pages are not full.
        wanted = -(-(2 * nodes if most is None else most) // self._of_layer**2)
        self._most_layers = max(1, min(wanted, budget // of_layer, limits.array_layers, MOST_LAYERS))
        self._ctx = ctx
        self._held, self.normals, self.colors = _textures(ctx, 1, colored)
        pages = self.normals.layers * self._of_layer
        self._place_of_node = np.full(nodes, MISSING, np.int32)
        self._spread_of_node = np.zeros(nodes, np.uint32)
        # As how many texels a side it was baked before it was fitted.
        self._baked_as = np.zeros(nodes, np.uint16)
        self._nodes_of_page: list[list[UInt32Array]] = [[] for _ in range(pages)]
        self._drawn = np.full(pages, NEVER, np.int64)
        # By side the page that is being filled, and how many tiles are in it.
        self._open: dict[int, tuple[int, int]] = {}
        self._frame = 0

    @property
    def capacity(self) -> int:
        """How many tiles of one frame are taken in: of each size but one a page may be almost empty."""
        pages = self._most_layers * self._of_layer
        return max(pages - (self._sizes - 1), pages // 2, 1) * self._of_layer

    def _nodes_of(self, splats: UInt32Array) -> UInt32Array:
        """Return the nodes among splats (K,); where there is no room for all the first ones, which are the largest."""
        nodes = splats[splats < len(self._place_of_node)]
        if len(nodes) > self.capacity:
            nodes = np.partition(nodes, self.capacity - 1)[: self.capacity]
        return nodes

    def mark(self, splats: UInt32Array) -> None:
        """Count the tiles of a cut's splats (K,) as drawn now: others make room before these do."""
        self._frame += 1
        places = self._place_of_node[self._nodes_of(splats)]
        self._drawn[self._page_of(places[places >= 0])] = self._frame

    def missing(self, splats: UInt32Array, view: View, hierarchy: Hierarchy) -> tuple[UInt32Array, Int32Array]:
        """Return the nodes among the splats of a cut whose tiles are not here and should be, largest first.

        splats : uint32 (K,)
        view : what the cut is drawn with

        Returns uint32 and int32 (N,), the nodes and as how many texels a side their tiles have to be baked. Tiles that
        are here with too few texels count as missing.
        """
        nodes = self._nodes_of(splats)
        most = texels_seen(hierarchy, view, nodes, self.texels)
        missing = most > self._baked_as[nodes]
        nodes, most = nodes[missing], most[missing]
        order = np.argsort(nodes)
        return nodes[order], most[order]

    def add(self, tiles: FittedTiles) -> bool:
        """Bring tiles to the GPU, in place of pages that were not drawn since the last `mark`; False: not all fit."""
        needless = tiles.nodes[tiles.sides == 0]
        self._place_of_node[needless] = NEEDLESS
        self._baked_as[needless] = tiles.most[tiles.sides == 0]
        fits = [self._add(tiles, side) for side in tiles.normals]
        return all(fits)

    def _add(self, tiles: FittedTiles, side: int) -> bool:
        here = np.flatnonzero(tiles.sides == side)
        in_row, rows = LAYER_SIZE // side, self.texels // side
        spreads = tiles.spreads.view(np.uint32)[:, 0]
        done = 0
        while done < len(here):
            page, filled = self._open.get(side, (NEVER, in_row * rows))
            if filled == in_row * rows:
                page, filled = self._free_page(), 0
                if page == NEVER:
                    return False
            # Row by row of the page: what is written is a rectangle.
            row, column = divmod(filled, in_row)
            count = min(in_row - column, len(here) - done)
            new = here[done : done + count]
            nodes = tiles.nodes[new]
            layer, top = divmod(page, self._of_layer)
            top = top * self.texels + row * side
            self._write(self.normals, tiles.normals[side][done : done + count], (column * side, top, layer))
            if self.colors is not None:
                self._write(self.colors, tiles.colors[side][done : done + count], (column * side, top, layer))
            columns = np.arange(column, column + count, dtype=np.int32) * side
            self._place_of_node[nodes] = place_of(layer, top, columns, side if side < self.texels else 0)
            self._spread_of_node[nodes] = spreads[new]
            self._baked_as[nodes] = tiles.most[new]
            self._nodes_of_page[page].append(nodes)
            self._drawn[page] = self._frame
            self._open[side] = page, filled + count
            done += count
        return True

    @staticmethod
    def _write(texture: moderngl.TextureArray, tiles: UInt8Array, corner: tuple[int, int, int]) -> None:
        """Write tiles, uint8 (N, side, side, C), side by side."""
        count, side = tiles.shape[:2]
        row = np.ascontiguousarray(tiles.transpose(1, 0, 2, 3))
        texture.write(row, (*corner, count * side, side, 1), alignment=1)

    def _free_page(self) -> int:
        """Return the page that was drawn least recently, emptied; NEVER: all were drawn in this frame."""
        page = int(self._drawn.argmin())
        if self._drawn[page] != NEVER and self._grow():
            page = int(self._drawn.argmin())
        if self._drawn[page] >= self._frame:
            return NEVER
        nodes = np.concatenate([*self._nodes_of_page[page], np.empty(0, np.uint32)])
        places = self._place_of_node[nodes]
        # What has been baked again lies elsewhere by now.
        nodes = nodes[(places >= 0) & (self._page_of(places) == page)]
        self._place_of_node[nodes], self._baked_as[nodes] = MISSING, 0
        self._nodes_of_page[page] = []
        self._open = {side: of for side, of in self._open.items() if of[0] != page}
        return page

    def _grow(self) -> bool:
        """Make the textures twice as deep, if there is room for that; the tiles stay where they are."""
        before = self.normals.layers
        if before >= self._most_layers:
            return False
        layers = min(2 * before, self._most_layers)
        try:
            held, normals, colors = _textures(self._ctx, layers, self._colored)
        except GpuError:
            # It has to do with what there is.
            self._most_layers = before
            return False
        place = (0, 0, 0, LAYER_SIZE, LAYER_SIZE, before)
        normals.write(self.normals.read(), place, alignment=1)
        if colors is not None and self.colors is not None:
            colors.write(self.colors.read(), place, alignment=1)
        self._held.release()
        self._held, self.normals, self.colors = held, normals, colors
        more = (layers - before) * self._of_layer
        self._nodes_of_page += [[] for _ in range(more)]
        self._drawn = np.concatenate([self._drawn, np.full(more, NEVER, np.int64)])
        return True

    def _page_of(self, places: Int32Array) -> Int32Array:
        return layer_of(places) * self._of_layer + row_of(places) // self.texels

    def clear(self) -> None:
        """Forget all tiles."""
        self._place_of_node[:], self._baked_as[:], self._drawn[:] = MISSING, 0, NEVER
        self._nodes_of_page = [[] for _ in self._nodes_of_page]
        self._open.clear()

    def places_of(self, splats: UInt32Array) -> tuple[Int32Array, UInt32Array]:
        """Return where the tiles of a cut's splats lie, and what their bytes stand for.

        Returns int32 (K,), the places in the textures (tile_places.py), below 0: nowhere; and uint32 (K,), the four
        bytes of `FittedTiles.spreads`.
        """
        places = np.full(len(splats), NO_TILE, np.int32)
        is_node = splats < len(self._place_of_node)
        self.untiled = max(int(np.count_nonzero(is_node)) - self.capacity, 0)
        if self.untiled:
            # A tile that is still here from an earlier frame does not count: pictures shall not depend on the past.
            is_node &= splats <= self._nodes_of(splats).max()
        nodes = splats[is_node]
        places[is_node] = self._place_of_node[nodes]
        spreads = np.zeros(len(splats), np.uint32)
        spreads[is_node] = self._spread_of_node[nodes]
        return places, spreads

    @property
    def nbytes(self) -> int:
        return int(LAYER_SIZE**2 * self.normals.layers * (6 if self._colored else 2))

    def release(self) -> None:
        self._held.release()


def _textures(
    ctx: moderngl.Context, layers: int, colored: bool
) -> tuple[Held, moderngl.TextureArray, moderngl.TextureArray | None]:
    """Make the textures of normals and colours; raises GpuError where there is no memory for them."""
    with allocating(ctx, "the normal tiles; choose a smaller w_s") as held:
        return held, _texture(ctx, held, layers, 2), _texture(ctx, held, layers, 4) if colored else None


def _texture(ctx: moderngl.Context, held: Held, layers: int, components: int) -> moderngl.TextureArray:
    texture = held.add(ctx.texture_array((LAYER_SIZE, LAYER_SIZE, layers), components, dtype="f1"))
    texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
    return texture
