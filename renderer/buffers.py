"""What stays on the GPU between frames: the splats' records, the tiles, the leaf triangles' vertices."""

from __future__ import annotations

import math

import moderngl
import numpy as np

from hierarchy.hierarchy import SPLAT, Hierarchy
from hierarchy.leaves import Triangles
from hierarchy.normal_tiles import NormalTiles

# A record is a whole number of RGBA32F texels.
TEXELS_PER_SPLAT = SPLAT.itemsize // 16
# Texels along a row of the record texture; a multiple of the above, so that no record is broken over two rows. 2048
# rows of it hold 2 M splats, and 16,384 (every GPU that has OpenGL 4) hold 16 M.
RECORD_WIDTH = 1024 * TEXELS_PER_SPLAT


class GpuError(Exception):
    """The GPU cannot hold what is asked of it. The message is one line."""


def check_memory(ctx: moderngl.Context, what: str) -> None:
    """Raise GpuError where OpenGL had no memory for what was made since its errors were last read.

    what : what it was made for, as the message names it
    """
    # moderngl reports no errors by itself, and a texture without memory is only drawn wrong.
    errors = {ctx.error for _ in range(4)}
    if "GL_OUT_OF_MEMORY" in errors:
        raise GpuError(f"the graphics memory does not hold {what}")


def data_texture(ctx: moderngl.Context, rows: np.ndarray, components: int, dtype: str) -> moderngl.Texture:
    """Put flat records into a 2D texture, RECORD_WIDTH texels a row, for texelFetch.

    rows : (N, components), any number; the last row is padded
    Raises GpuError where the records need more rows than a texture can have.
    """
    height = max(1, math.ceil(len(rows) / RECORD_WIDTH))
    limit = ctx.info["GL_MAX_TEXTURE_SIZE"]
    if height > limit:
        raise GpuError(f"the model has too many splats for this GPU: {len(rows)} texels in rows of {RECORD_WIDTH}")
    padded = np.zeros((height * RECORD_WIDTH, components), rows.dtype)
    padded[: len(rows)] = rows
    texture = ctx.texture((RECORD_WIDTH, height), components, padded, dtype=dtype)
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    return texture


class SplatBuffers:
    """A hierarchy on the GPU."""

    def __init__(self, ctx: moderngl.Context, hierarchy: Hierarchy) -> None:
        """Raises GpuError where the hierarchy does not fit."""
        texels = hierarchy.splats.view(np.float32).reshape(-1, 4)
        self.records = data_texture(ctx, texels, 4, "f4")
        self.colors = None if hierarchy.colors is None else data_texture(ctx, hierarchy.colors, 4, "f1")
        self.vertices: list[tuple[moderngl.Buffer, str, str]] = []
        if isinstance(hierarchy.leaves, Triangles):
            leaves = hierarchy.leaves
            self.vertices.append((ctx.buffer(leaves.positions), "3f", "in_position"))
            self.vertices.append((ctx.buffer(leaves.normals), "3f", "in_normal"))
            if leaves.colors is not None:
                self.vertices.append((ctx.buffer(leaves.colors), "4f1", "in_color"))
        try:
            check_memory(ctx, "the model")
        except GpuError:
            self.release()
            raise

    @property
    def nbytes(self) -> int:
        textures = [self.records, *([self.colors] if self.colors else [])]
        sizes = [t.width * t.height * t.components * (4 if t.dtype == "f4" else 1) for t in textures]
        return sum(sizes) + sum(buffer.size for buffer, _, _ in self.vertices)

    def release(self) -> None:
        self.records.release()
        if self.colors is not None:
            self.colors.release()
        for buffer, _, _ in self.vertices:
            buffer.release()


class TileTextures:
    """The normal tiles on the GPU: 2D array textures, filtered bilinearly."""

    def __init__(self, ctx: moderngl.Context, tiles: NormalTiles) -> None:
        """Raises GpuError where the tiles do not fit."""
        self.tiles = tiles
        self.layer_size = tiles.normals.shape[1]
        self.normals = self._array(ctx, tiles.normals)
        self.colors = None if tiles.colors is None else self._array(ctx, tiles.colors)
        try:
            check_memory(ctx, "the normal tiles; choose a smaller w_s")
        except GpuError:
            self.release()
            raise

    @staticmethod
    def _array(ctx: moderngl.Context, texels: np.ndarray) -> moderngl.TextureArray:
        layers, size, _, components = texels.shape
        limit = ctx.info["GL_MAX_ARRAY_TEXTURE_LAYERS"]
        if layers > limit:
            raise GpuError(f"the normal tiles need {layers} texture layers, this GPU has {limit}; choose a smaller w_s")
        texture = ctx.texture_array((size, size, layers), components, texels, dtype="f1", alignment=1)
        texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        return texture

    @property
    def nbytes(self) -> int:
        textures = [self.normals, *([self.colors] if self.colors else [])]
        return sum(t.width * t.height * t.layers * t.components for t in textures)

    def release(self) -> None:
        self.normals.release()
        if self.colors is not None:
            self.colors.release()
