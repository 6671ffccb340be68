"""What stays on the GPU between frames: the splats' records and the leaf triangles' vertices."""

from __future__ import annotations

import math

import moderngl
import numpy as np

from hierarchy.hierarchy import SPLAT, Hierarchy
from hierarchy.leaves import Triangles
from renderer.allocation import GpuError, Held, allocating
from renderer.limits import Limits

# A record is a whole number of RGBA32F texels.
TEXELS_PER_SPLAT = SPLAT.itemsize // 16
# Texels along a row of the record texture; a multiple of the above, so that no record is broken over two rows. 4096
# rows of it, which every GPU with OpenGL 3.3 has, hold 4 M splats, and 256 layers of those a thousand million.
RECORD_WIDTH = 1024 * TEXELS_PER_SPLAT


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
