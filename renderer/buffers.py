"""What stays on the GPU between frames: the splats' records, the tiles, the leaf triangles' vertices."""

from __future__ import annotations

import math

import moderngl
import numpy as np

from hierarchy.hierarchy import SPLAT, Hierarchy
from hierarchy.leaves import Triangles
from hierarchy.model import Int32Array, UInt32Array
from hierarchy.normal_tiles import NormalTiles
from renderer.allocation import GpuError, Held, allocating
from renderer.limits import Limits
from renderer.tile_slots import TileSlots

# A record is a whole number of RGBA32F texels.
TEXELS_PER_SPLAT = SPLAT.itemsize // 16
# Texels along a row of the record texture; a multiple of the above, so that no record is broken over two rows. 4096
# rows of it, which every GPU with OpenGL 3.3 has, hold 4 M splats, and 256 layers of those a thousand million.
RECORD_WIDTH = 1024 * TEXELS_PER_SPLAT

# Tiles gathered from the atlas at a time: 4 MB of 32 x 32 texels.
UPLOADED_AT_ONCE = 2048


def record_texture(
    ctx: moderngl.Context, limits: Limits, held: Held, rows: np.ndarray, dtype: str
) -> moderngl.TextureArray:
    """Put flat records into a texture for texelFetch: RECORD_WIDTH texels a row, the rows in one layer or several.

    held : what the texture is added to
    rows : (N, components), any number; what lies behind the last one is undefined
    Raises GpuError where the records need more layers than a texture can have.
    """
    height = max(1, math.ceil(len(rows) / RECORD_WIDTH))
    layers = math.ceil(height / limits.texture_size)
    if layers > limits.array_layers:
        raise GpuError(f"the model has too many splats for this GPU: {len(rows)} texels in rows of {RECORD_WIDTH}")
    height = math.ceil(height / layers)
    texture = held.add(ctx.texture_array((RECORD_WIDTH, height, layers), rows.shape[1], dtype=dtype))
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    # Without a padded copy, which for large models is a gigabyte.
    for layer in range(layers):
        part = rows[layer * height * RECORD_WIDTH : (layer + 1) * height * RECORD_WIDTH]
        full = len(part) // RECORD_WIDTH * RECORD_WIDTH
        if full:
            texture.write(part[:full], (0, 0, layer, RECORD_WIDTH, full // RECORD_WIDTH, 1))
        if full < len(part):
            texture.write(part[full:], (0, full // RECORD_WIDTH, layer, len(part) - full, 1, 1))
    return texture


class SplatBuffers:
    """A hierarchy on the GPU."""

    def __init__(self, ctx: moderngl.Context, hierarchy: Hierarchy, limits: Limits) -> None:
        """Raises GpuError where the hierarchy does not fit."""
        self.colors: moderngl.TextureArray | None = None
        self.vertices: list[tuple[moderngl.Buffer, str, str]] = []
        with allocating(ctx, "the model") as held:
            self._held = held
            texels = hierarchy.splats.view(np.float32).reshape(-1, 4)
            self.records = record_texture(ctx, limits, held, texels, "f4")
            if hierarchy.colors is not None:
                self.colors = record_texture(ctx, limits, held, hierarchy.colors, "f1")
            leaves = hierarchy.leaves
            if isinstance(leaves, Triangles):
                self.vertices.append((held.add(ctx.buffer(leaves.positions)), "3f", "in_position"))
                self.vertices.append((held.add(ctx.buffer(leaves.normals)), "3f", "in_normal"))
                if leaves.colors is not None:
                    self.vertices.append((held.add(ctx.buffer(leaves.colors)), "4f1", "in_color"))

    @property
    def nbytes(self) -> int:
        textures = [self.records, *([self.colors] if self.colors else [])]
        sizes = [t.width * t.height * t.layers * t.components * (4 if t.dtype == "f4" else 1) for t in textures]
        return sum(sizes) + sum(buffer.size for buffer, _, _ in self.vertices)

    def release(self) -> None:
        self._held.release()


class TileTextures:
    """The normal tiles on the GPU: 2D array textures, filtered bilinearly.

    Where there is no room for all, those of the present cut have to do: `slots_of` brings what is missing.

    untiled : splats of the last cut for whose tiles there was no room
    """

    def __init__(self, ctx: moderngl.Context, tiles: NormalTiles, limits: Limits) -> None:
        """Raises GpuError where not even one layer fits."""
        self.tiles = tiles
        self.texels = tiles.texels
        self.untiled = 0
        layers, self.layer_size, _, components = tiles.normals.shape
        texel = components + (0 if tiles.colors is None else tiles.colors.shape[3])
        most = layers if limits.tile_bytes is None else max(limits.tile_bytes // (self.layer_size**2 * texel), 1)
        self._make(ctx, min(layers, limits.array_layers, most))
        self._slots: TileSlots | None = None
        if self.normals.layers < layers:
            self._slots = TileSlots(tiles.count, self.normals.layers * (self.layer_size // tiles.texels) ** 2)

    def _make(self, ctx: moderngl.Context, layers: int) -> None:
        """Make the textures, with as many layers as there is memory for."""
        while True:
            try:
                with allocating(ctx, "the normal tiles; choose a smaller w_s") as held:
                    self._held = held
                    self.normals = held.add(_tile_texture(ctx, self.tiles.normals, layers))
                    colors = self.tiles.colors
                    self.colors = None if colors is None else held.add(_tile_texture(ctx, colors, layers))
            except GpuError:
                if layers == 1:
                    raise
                layers //= 2
            else:
                return

    def slots_of(self, splats: UInt32Array) -> Int32Array:
        """Return where the tiles of a cut's splats lie in the textures, int32 (K,); -1 for those that have none."""
        tiles = self.tiles.tiles_of(splats)
        if self._slots is None:
            return tiles
        slots, missing, free = self._slots.place(tiles)
        self.untiled = int(np.count_nonzero((tiles >= 0) & (slots < 0)))
        for first in range(0, len(missing), UPLOADED_AT_ONCE):
            block = slice(first, first + UPLOADED_AT_ONCE)
            self._write(self.normals, self.tiles.normals, missing[block], free[block])
            if self.colors is not None and self.tiles.colors is not None:
                self._write(self.colors, self.tiles.colors, missing[block], free[block])
        return slots

    def _write(self, texture: moderngl.TextureArray, atlas: np.ndarray, tiles: Int32Array, slots: Int32Array) -> None:
        width, side = self.tiles.texels, self.layer_size // self.tiles.texels
        grid = atlas.reshape(len(atlas), side, width, side, width, -1).transpose(0, 1, 3, 2, 4, 5)
        texels = grid[tiles // side**2, tiles // side % side, tiles % side]
        for slot, tile in zip(slots.tolist(), np.ascontiguousarray(texels), strict=True):
            corner = slot % side * width, slot // side % side * width, slot // side**2
            texture.write(tile, (*corner, width, width, 1), alignment=1)

    @property
    def nbytes(self) -> int:
        textures = [self.normals, *([self.colors] if self.colors else [])]
        return sum(t.width * t.height * t.layers * t.components for t in textures)

    def release(self) -> None:
        self._held.release()


def _tile_texture(ctx: moderngl.Context, atlas: np.ndarray, layers: int) -> moderngl.TextureArray:
    """Make a texture with the atlas in it, or, where that has more layers, an empty one."""
    whole, size, _, components = atlas.shape
    texture = ctx.texture_array((size, size, layers), components, atlas if layers == whole else None, dtype="f1")
    texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
    return texture
