"""A cache of normal tiles on the GPU: those that were drawn last, of nodes whose tiles are baked one after the other.

A page is a strip as wide as the texture and as high as a tile; what was baked together shares pages. Pages are used
anew in the order in which they were drawn last.
"""

from __future__ import annotations

import moderngl
import numpy as np

from hierarchy.model import Int32Array, UInt32Array
from hierarchy.normal_tiles import TileStrips
from hierarchy.tile_kernels import LAYER_SIZE
from renderer.allocation import GpuError, Held, allocating
from renderer.limits import Limits

# Bytes of graphics memory for tiles where nobody says: a quarter of a million of 16 x 16 texels.
DEFAULT_BYTES = 1 << 27
NEVER = -1


class TilePages:
    """Tiles of w_s x w_s texels of the nodes of one hierarchy.

    texels : w_s
    untiled : splats of the last cut whose tiles there is no room for
    """

    def __init__(self, ctx: moderngl.Context, limits: Limits, texels: int, nodes: int, *, colored: bool) -> None:
        """nodes : of the hierarchy; colored : its tiles have colours. Raises GpuError where not even a layer fits."""
        self.texels, self.layer_size = texels, LAYER_SIZE
        self.untiled = 0
        self._side = LAYER_SIZE // texels
        self._colored = colored
        of_layer = LAYER_SIZE**2 * (6 if colored else 2)
        budget = DEFAULT_BYTES if limits.tile_bytes is None else limits.tile_bytes
        # Of what is baked a few at a time pages are half empty.
        wanted = -(-2 * nodes // self._side**2)
        self._make(ctx, max(1, min(wanted, budget // of_layer, limits.array_layers)))
        pages = self.normals.layers * self._side
        self._slot_of_node = np.full(nodes, NEVER, np.int32)
        self._node_in_slot = np.full((pages, self._side), NEVER, np.int32)
        self._drawn = np.full(pages, NEVER, np.int64)
        self._frame = 0

    def _make(self, ctx: moderngl.Context, layers: int) -> None:
        """Make the textures, with as many layers as there is memory for."""
        while True:
            try:
                with allocating(ctx, "the normal tiles; choose a smaller w_s") as held:
                    self._held = held
                    self.normals = _texture(ctx, held, layers, 2)
                    self.colors = _texture(ctx, held, layers, 4) if self._colored else None
            except GpuError:
                if layers == 1:
                    raise
                layers //= 2
            else:
                return

    @property
    def capacity(self) -> int:
        """How many tiles of one frame are taken in: some pages are half empty."""
        return max(3 * self._node_in_slot.size // 4, 1)

    def _nodes_of(self, splats: UInt32Array) -> UInt32Array:
        """Return the nodes among splats (K,); where there is no room for all the first ones, which are the largest."""
        nodes = splats[splats < len(self._slot_of_node)]
        if len(nodes) > self.capacity:
            nodes = np.partition(nodes, self.capacity - 1)[: self.capacity]
        return nodes

    def mark(self, splats: UInt32Array) -> None:
        """Count the tiles of a cut's splats (K,) as drawn now: others make room before these do."""
        self._frame += 1
        slots = self._slot_of_node[self._nodes_of(splats)]
        self._drawn[slots[slots != NEVER] // self._side] = self._frame

    def missing(self, splats: UInt32Array) -> UInt32Array:
        """Return the nodes among the splats (K,) of a cut whose tiles are not here and should be, largest first."""
        nodes = self._nodes_of(splats)
        return np.sort(nodes[self._slot_of_node[nodes] == NEVER])

    def add(self, strips: TileStrips) -> bool:
        """Bring tiles to the GPU, in place of pages that were not drawn since the last `mark`; False: not all fit."""
        free = np.flatnonzero(self._drawn < self._frame)
        count = len(strips.normals)
        if len(free) > count:
            free = np.sort(free[np.argpartition(self._drawn[free], count - 1)[:count]])
        for strip, page in enumerate(free.tolist()):
            evicted = self._node_in_slot[page]
            evicted = evicted[evicted != NEVER]
            # What has been baked again lies elsewhere by now.
            self._slot_of_node[evicted[self._slot_of_node[evicted] // self._side == page]] = NEVER
            nodes = strips.nodes[strip * self._side : (strip + 1) * self._side].astype(np.int32)
            self._node_in_slot[page] = NEVER
            self._node_in_slot[page, : len(nodes)] = nodes
            self._slot_of_node[nodes] = page * self._side + np.arange(len(nodes), dtype=np.int32)
            self._drawn[page] = self._frame
            place = (0, page % self._side * self.texels, page // self._side, LAYER_SIZE, self.texels, 1)
            self.normals.write(strips.normals[strip], place, alignment=1)
            if self.colors is not None and strips.colors is not None:
                self.colors.write(strips.colors[strip], place, alignment=1)
        return len(free) >= count

    def clear(self) -> None:
        """Forget all tiles."""
        self._slot_of_node[:] = self._node_in_slot[:] = self._drawn[:] = NEVER

    def slots_of(self, splats: UInt32Array) -> Int32Array:
        """Return where the tiles of a cut's splats lie in the textures, int32 (K,), -1 for those that are not here."""
        slots = np.full(len(splats), NEVER, np.int32)
        is_node = splats < len(self._slot_of_node)
        self.untiled = max(int(np.count_nonzero(is_node)) - self.capacity, 0)
        if self.untiled:
            # A tile that is still here from an earlier frame does not count: pictures shall not depend on the past.
            is_node &= splats <= self._nodes_of(splats).max()
        slots[is_node] = self._slot_of_node[splats[is_node]]
        return slots

    @property
    def nbytes(self) -> int:
        return int(LAYER_SIZE**2 * self.normals.layers * (6 if self._colored else 2))

    def release(self) -> None:
        self._held.release()


def _texture(ctx: moderngl.Context, held: Held, layers: int, components: int) -> moderngl.TextureArray:
    texture = held.add(ctx.texture_array((LAYER_SIZE, LAYER_SIZE, layers), components, dtype="f1"))
    texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
    return texture
