"""A cache of normal tiles on the GPU: those that were drawn last, of nodes whose tiles are baked one after the other.

A page is a part of a layer, as wide as that, with room for PAGE_ROWS rows of the largest tile. All tiles of a page have
one size; those of the next batch go on where the last ones ended. When all pages are taken the textures grow, up to the
budget; then pages are used anew in the order in which they were drawn last.
"""

from __future__ import annotations

import moderngl
import numpy as np

from hierarchy.drawn_rows import gather_rows
from hierarchy.hierarchy import Hierarchy
from hierarchy.model import Int32Array, UInt32Array
from hierarchy.normal_tiles import FittedTiles
from hierarchy.tile_sizes import sides_of, tiles_seen
from hierarchy.view import View
from renderer.allocation import GpuError, Held, allocating
from renderer.limits import Limits
from renderer.tile_places import (
    LAYER_HEIGHT,
    LAYER_WIDTH,
    MOST_LAYERS,
    NO_TILE,
    layer_of,
    place_of,
    row_of,
    sides_at,
)

# Bytes of graphics memory for tiles where nobody says: a quarter of a million of 16 x 16 texels, half in 16 bits.
DEFAULT_BYTES = 1 << 27
# What a node has in place of a tile's place: one that was not baked, and one that needs no tile.
MISSING, NEEDLESS = NO_TILE, NO_TILE - 1
NEVER = -1
# So few that a single layer has a page for each size, and some to spare.
PAGE_ROWS = 8
# Texels.
OF_LAYER = LAYER_WIDTH * LAYER_HEIGHT
# A million texels: growing from fewer took as long as bringing the first tiles.
FIRST_LAYERS = 8

Textures = tuple[moderngl.TextureArray, moderngl.TextureArray | None]


class TilePages:
    """Tiles of at most w_s x w_s texels of the nodes of one hierarchy.

    texels : w_s
    untiled : splats of the last frame whose tiles there is no room for
    """

    def __init__(
        self, ctx: moderngl.Context, limits: Limits, texels: int, nodes: int, *, colored: bool, most: int | None = None
    ) -> None:
        """Make room for tiles.

        texels : LAYER_WIDTH at most
        nodes : of the hierarchy
        colored : its tiles have colours
        most : tiles there is room for at most, where they all have w_s x w_s texels; None: for those of any cut
        Raises GpuError where there is no room for the first layers, ValueError where a tile is wider than that.
        """
        if texels > LAYER_WIDTH:
            raise ValueError(f"a tile has at most {LAYER_WIDTH} texels a side, not {texels}")
        self.texels = texels
        self.untiled = 0
        self._sizes = len(sides_of(texels)) if most is None else 1
        self._colored = colored
        # Filtered to bytes again normals would be off by up to a degree: so it is numbers of 16 bits that are filtered.
        self._dtype = "f1" if limits.fine_filter else "nu2"
        of_layer = OF_LAYER * self._texel_bytes
        budget = limits.tile_bytes
        if budget is None:
            budget = DEFAULT_BYTES if most is None else of_layer * MOST_LAYERS
        self._page_height = PAGE_ROWS * texels
        self._of_layer = LAYER_HEIGHT // self._page_height
        # Of the largest tiles.
        self._of_page = LAYER_WIDTH // texels * PAGE_ROWS
        # Some pages are not full.
        wanted = -(-(2 * nodes if most is None else most) // (self._of_layer * self._of_page))
        self._most_layers = max(1, min(wanted, budget // of_layer, limits.array_layers, MOST_LAYERS))
        self._ctx = ctx
        self._held, self.normals, self.colors = self._textures(min(FIRST_LAYERS, self._most_layers))
        pages = self.normals.layers * self._of_layer
        # Side by side, since a frame asks for both: a place, and the four bytes of a spread.
        self._of_node = np.zeros((nodes, 2), np.int32)
        self._place_of_node, self._spread_of_node = self._of_node[:, 0], self._of_node[:, 1]
        self._place_of_node[:] = MISSING
        # As how many texels a side it was baked before it was fitted.
        self._baked_as = np.zeros(nodes, np.uint16)
        self._nodes_of_page: list[list[UInt32Array]] = [[] for _ in range(pages)]
        self._drawn = np.full(pages, NEVER, np.int64)
        # By side the page that is being filled, and how many tiles are in it.
        self._open: dict[int, tuple[int, int]] = {}
        self._frame = 0
        # The last node whose tile there is room for; None: there is for all.
        self._last: int | None = None

    def begin(self, splats: UInt32Array, view: View, hierarchy: Hierarchy) -> tuple[UInt32Array, Int32Array]:
        """Begin a frame: others make room before the tiles of its splats do. Return what is still to be baked for it.

        splats : uint32 (K,), of the frame's cut
        view : what the cut is drawn with

        Returns uint32 and int32 (N,), the nodes whose tiles are not here, or with too few texels, and as how many
        texels a side they have to be baked, the largest nodes first. Where there is no room for the tiles of all splats
        the largest nodes get them.
        """
        self._frame += 1
        nodes, most = tiles_seen(hierarchy, view, splats, self.texels)
        fits = self._fitting(nodes, most)
        self.untiled = len(nodes) - fits
        self._last = int(nodes[fits - 1]) if self.untiled else None
        nodes, most = nodes[:fits], most[:fits]
        places = self._place_of_node[nodes]
        self._drawn[self._page_of(places[places >= 0])] = self._frame
        missing = most > self._baked_as[nodes]
        return nodes[missing], most[missing]

    def _fitting(self, nodes: UInt32Array, most: Int32Array) -> int:
        """Return how many of the first nodes (K,) there is room for, by whatever their tiles will be fitted."""
        pages = self._most_layers * self._of_layer
        if pages < 2 * self._sizes:
            # Each may need a page of its own.
            return min(len(nodes), pages)
        sides = np.where(most > self._baked_as[nodes], most, self._side_of(self._place_of_node[nodes]))
        # Of each size but one a page may be almost empty.
        room = (pages - (self._sizes - 1)) * self._of_page * self.texels**2
        return int(np.searchsorted(np.cumsum(sides.astype(np.int64) ** 2), room, "right"))

    def _side_of(self, places: Int32Array) -> Int32Array:
        """Return the texels along one side of the tiles at some places, 0 where there is none."""
        sides: Int32Array = np.where(places < 0, 0, sides_at(places, self.texels))
        return sides

    def add(self, tiles: FittedTiles) -> bool:
        """Bring tiles to the GPU, in place of pages that were not drawn since the last `begin`; False: not all fit."""
        needless = tiles.nodes[tiles.sides == 0]
        self._place_of_node[needless] = NEEDLESS
        self._baked_as[needless] = tiles.most[tiles.sides == 0]
        fits = [self._add(tiles, side) for side in tiles.normals]
        return all(fits)

    def _add(self, tiles: FittedTiles, side: int) -> bool:
        here = np.flatnonzero(tiles.sides == side)
        in_row = LAYER_WIDTH // side
        in_page = in_row * (self._page_height // side)
        spreads = tiles.spreads.view(np.int32)[:, 0]
        done = 0
        while done < len(here):
            page, filled = self._open.get(side, (NEVER, in_page))
            if filled == in_page:
                page, filled = self._free_page(), 0
                if page == NEVER:
                    return False
            # What is written is a rectangle: what is left of a row, whole rows, or the beginning of one.
            row, column = divmod(filled, in_row)
            count = min(in_page - filled, len(here) - done)
            if column or count < in_row:
                count = min(in_row - column, count)
            else:
                count -= count % in_row
            new = here[done : done + count]
            nodes = tiles.nodes[new]
            layer, top = divmod(page, self._of_layer)
            top = top * self._page_height + row * side
            normals = tiles.normals[side][done : done + count]
            # 257 times a byte is the same share of 65535 as the byte is of 255.
            wide = normals if self._dtype == "f1" else np.multiply(normals, 257, dtype=np.uint16)
            corner = column * side, top, layer
            self._write(self.normals, wide, corner)
            if self.colors is not None:
                self._write(self.colors, tiles.colors[side][done : done + count], corner)
            rows, columns = np.divmod(np.arange(column, column + count, dtype=np.int32), in_row)
            named = side if side < self.texels else 0
            self._place_of_node[nodes] = place_of(layer, top + rows * side, columns * side, named)
            self._spread_of_node[nodes] = spreads[new]
            self._baked_as[nodes] = tiles.most[new]
            self._nodes_of_page[page].append(nodes)
            self._drawn[page] = self._frame
            self._open[side] = page, filled + count
            done += count
        return True

    @staticmethod
    def _write(texture: moderngl.TextureArray, tiles: np.ndarray, corner: tuple[int, int, int]) -> None:
        """Write tiles, (N, side, side, C) of the texture's dtype, side by side: a part of a row, or whole rows."""
        count, side, _, components = tiles.shape
        across = min(count, LAYER_WIDTH // side)
        down = count // across
        rows = tiles.reshape(down, across, side, side, components).transpose(0, 2, 1, 3, 4)
        texture.write(np.ascontiguousarray(rows), (*corner, across * side, down * side, 1), alignment=1)

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
            # For a moment the old ones and the new ones are there.
            made = self._textures(layers, (self.normals, self.colors))
        except (GpuError, MemoryError):
            # It has to do with what there is.
            self._most_layers = before
            return False
        self._held.release()
        self._held, self.normals, self.colors = made
        more = (layers - before) * self._of_layer
        self._nodes_of_page += [[] for _ in range(more)]
        self._drawn = np.concatenate([self._drawn, np.full(more, NEVER, np.int64)])
        return True

    def _page_of(self, places: Int32Array) -> Int32Array:
        return layer_of(places) * self._of_layer + row_of(places) // self._page_height

    def clear(self) -> None:
        """Forget all tiles."""
        self._place_of_node[:], self._baked_as[:], self._drawn[:] = MISSING, 0, NEVER
        self._nodes_of_page = [[] for _ in self._nodes_of_page]
        self._open.clear()

    def places_of(self, splats: UInt32Array, repeats: int = 1) -> Int32Array:
        """Return where the tiles of a cut's splats lie, and what their bytes stand for.

        repeats : how often each is to be written

        Returns int32 (repeats * K, 2), the places in the textures (tile_places.py), below 0: nowhere; and the four
        bytes of `FittedTiles.spreads`.
        """
        # A tile that is still here from an earlier frame does not count: what is drawn without a tile shall not
        # depend on the past.
        below = None if self._last is None else self._last + 1
        return gather_rows(self._of_node, splats, (NO_TILE, 0), below=below, repeats=repeats)

    @property
    def nbytes(self) -> int:
        return OF_LAYER * self.normals.layers * self._texel_bytes

    @property
    def _texel_bytes(self) -> int:
        return (2 if self._dtype == "f1" else 4) + (4 if self._colored else 0)

    def _textures(self, layers: int, copied: Textures | None = None) -> tuple[Held, *Textures]:
        """Make the textures of normals and colours; raises GpuError where there is no memory for them.

        copied : what their first layers are to hold
        """
        kinds = [(2, self._dtype)] + ([(4, "f1")] if self._colored else [])
        size = LAYER_WIDTH, LAYER_HEIGHT, layers
        with allocating(self._ctx, "the normal tiles; choose a smaller w_s") as held:
            made = [held.add(self._ctx.texture_array(size, components, dtype=dtype)) for components, dtype in kinds]
            for texture in made:
                texture.filter = moderngl.LINEAR, moderngl.LINEAR
            for old, new in zip(copied or (), made, strict=False):
                if old is not None:
                    new.write(old.read(), (0, 0, 0, LAYER_WIDTH, LAYER_HEIGHT, old.layers), alignment=1)
            return held, made[0], made[1] if self._colored else None

    def release(self) -> None:
        self._held.release()
