"""What stays on the GPU between frames: the splats' records and the leaf triangles' vertices.

There is room for all of them. Of a large model only those pages are brought that a picture was drawn from: the first
one does not wait for the rest, which may never be seen.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import moderngl
import numpy as np

from hierarchy.hierarchy import SPLAT, Hierarchy
from hierarchy.leaves import Triangles
from hierarchy.lod import Cut
from renderer.allocation import GpuError, Held, allocating
from renderer.limits import Limits

# A record is a whole number of RGBA32F texels.
TEXELS_PER_SPLAT = SPLAT.itemsize // 16
# Texels along a row of the record texture; a multiple of the above, so that no record is broken over two rows. 4096
# rows of it, which every GPU with OpenGL 3.3 has, hold 4 M splats, and 256 layers of those a thousand million.
RECORD_WIDTH = 1024 * TEXELS_PER_SPLAT


# Bytes of a model up to which all of it is brought at once: it takes 50 ms.
WHOLE = 1 << 26
# Vertices of a page: 48 kB, as much as a row of records.
VERTICES = 4096


def record_texture(
    ctx: moderngl.Context, limits: Limits, held: Held, rows: np.ndarray, dtype: str
) -> moderngl.TextureArray:
    """Make a texture for texelFetch of flat records: RECORD_WIDTH texels a row, the rows in one layer or several.

    held : what the texture is added to
    rows : (N, components), any number, of which `write_records` writes some
    Raises GpuError where the records need more layers than a texture can have.
    """
    height = max(1, math.ceil(len(rows) / RECORD_WIDTH))
    layers = math.ceil(height / limits.texture_size)
    if layers > limits.array_layers:
        raise GpuError(f"the model has too many splats for this GPU: {len(rows)} texels in rows of {RECORD_WIDTH}")
    height = math.ceil(height / layers)
    texture = held.add(ctx.texture_array((RECORD_WIDTH, height, layers), rows.shape[1], dtype=dtype))
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    return texture


def write_records(texture: moderngl.TextureArray, rows: np.ndarray, first: int, end: int) -> None:
    """Write the records of the texture's rows first .. end - 1, counted through all layers.

    rows : as in `record_texture`; what lies behind the last one is undefined
    """
    while first < end:
        layer, top = divmod(first, texture.height)
        below = min(texture.height, top + end - first)
        # Without a padded copy, which for large models is a gigabyte.
        part = rows[first * RECORD_WIDTH : (first + below - top) * RECORD_WIDTH]
        full = len(part) // RECORD_WIDTH * RECORD_WIDTH
        lines = full // RECORD_WIDTH
        if full:
            texture.write(part[:full], (0, top, layer, RECORD_WIDTH, lines, 1))
        if full < len(part):
            texture.write(part[full:], (0, top + lines, layer, len(part) - full, 1, 1))
        first += below - top


class Pages:
    """Which pages of an array are on the GPU.

    count, page : elements of the array, and of a page
    write : called with the first page and the one behind the last, to bring them
    """

    def __init__(self, count: int, page: int, write: Callable[[int, int], None]) -> None:
        self._page, self._write = page, write
        self._missing = np.ones(-(-count // page), bool)
        self._any_missing = True

    def bring(self, elements: np.ndarray) -> None:
        """Bring the pages of elements, of any shape, that are not there yet."""
        if self._any_missing:
            pages = elements.reshape(-1) // self._page
            missing = pages[self._missing[pages]]
            if len(missing):
                wanted = np.zeros(len(self._missing), bool)
                wanted[missing] = True
                self._bring(wanted)

    def bring_all(self) -> None:
        """Bring all pages that are not there yet."""
        self._bring(self._missing.copy())

    def _bring(self, wanted: np.ndarray) -> None:
        edges = np.flatnonzero(np.diff(wanted, prepend=False, append=False))
        for first, end in edges.reshape(-1, 2).tolist():
            self._write(first, end)
        self._missing &= ~wanted
        self._any_missing = bool(self._missing.any())


class SplatBuffers:
    """A hierarchy on the GPU.

    records, colors : textures of the splats' records and of their colours; None: they have none
    vertices : buffers of the leaf triangles' vertices, with what a vertex array needs to know of them
    """

    def __init__(self, ctx: moderngl.Context, hierarchy: Hierarchy, limits: Limits) -> None:
        """Raises GpuError where the hierarchy does not fit."""
        self._ctx = ctx
        self.colors: moderngl.TextureArray | None = None
        self.vertices: list[tuple[moderngl.Buffer, str, str]] = []
        self._pages_of_splats: list[Pages] = []
        self._pages_of_vertices: list[Pages] = []
        with allocating(ctx, "the model") as held:
            self._held = held
            texels = hierarchy.splats.view(np.float32).reshape(-1, 4)
            self.records = self._texture(limits, texels, "f4", TEXELS_PER_SPLAT)
            if hierarchy.colors is not None:
                self.colors = self._texture(limits, hierarchy.colors, "f1", 1)
            leaves = hierarchy.leaves
            if isinstance(leaves, Triangles):
                self._add_vertices(leaves.positions, "3f", "in_position")
                self._add_vertices(leaves.normals, "3f", "in_normal")
                if leaves.colors is not None:
                    self._add_vertices(leaves.colors, "4f1", "in_color")
            if self.nbytes <= WHOLE:
                for pages in (*self._pages_of_splats, *self._pages_of_vertices):
                    pages.bring_all()

    def _texture(self, limits: Limits, rows: np.ndarray, dtype: str, texels: int) -> moderngl.TextureArray:
        """Make a texture of records of so many texels each, whose rows are its pages."""
        texture = record_texture(self._ctx, limits, self._held, rows, dtype)
        pages = Pages(len(rows) // texels, RECORD_WIDTH // texels, lambda *page: write_records(texture, rows, *page))
        self._pages_of_splats.append(pages)
        return texture

    def _add_vertices(self, values: np.ndarray, layout: str, name: str) -> None:
        buffer = self._held.add(self._ctx.buffer(reserve=values.nbytes))

        def write(first: int, end: int) -> None:
            part = values[first * VERTICES : end * VERTICES]
            buffer.write(part, offset=first * VERTICES * values.strides[0])

        self.vertices.append((buffer, layout, name))
        self._pages_of_vertices.append(Pages(len(values), VERTICES, write))

    def bring(self, cut: Cut) -> None:
        """Bring what a cut is drawn from, as far as it is not there yet. Raises GpuError where there is no room."""
        with allocating(self._ctx, "the model"):
            for pages in self._pages_of_splats:
                pages.bring(cut.splats)
            for pages in self._pages_of_vertices:
                pages.bring(cut.indices)

    @property
    def nbytes(self) -> int:
        textures = [self.records, *([self.colors] if self.colors else [])]
        sizes = [t.width * t.height * t.layers * t.components * (4 if t.dtype == "f4" else 1) for t in textures]
        return sum(sizes) + sum(buffer.size for buffer, _, _ in self.vertices)

    def release(self) -> None:
        self._held.release()
