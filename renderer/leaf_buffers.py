"""What stays on the GPU between frames: the leaf triangles' vertices.

There is room for all of them. Of a large model only those pages are brought that a picture was drawn from: the first
one does not wait for the rest, which may never be seen.
"""

from __future__ import annotations

from collections.abc import Callable

import moderngl
import numpy as np

from hierarchy.leaves import Leaves, Triangles
from renderer.allocation import allocating

# Bytes of vertices up to which all of them are brought at once: it takes 50 ms.
WHOLE = 1 << 26
# Vertices of a page: 48 kB of positions.
VERTICES = 4096


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


class LeafBuffers:
    """The vertices of a mesh's leaf triangles on the GPU; of a point hierarchy there are none.

    vertices : buffers, with what a vertex array needs to know of them
    """

    def __init__(self, ctx: moderngl.Context, leaves: Leaves) -> None:
        """Raises GpuError where they do not fit."""
        self._ctx = ctx
        self.vertices: list[tuple[moderngl.Buffer, str, str]] = []
        self._pages: list[Pages] = []
        with allocating(ctx, "the model") as held:
            self._held = held
            if isinstance(leaves, Triangles):
                self._add(leaves.positions, "3f", "in_position")
                self._add(leaves.normals, "3f", "in_normal")
                if leaves.colors is not None:
                    self._add(leaves.colors, "4f1", "in_color")
            if self.nbytes <= WHOLE:
                for pages in self._pages:
                    pages.bring_all()

    def _add(self, values: np.ndarray, layout: str, name: str) -> None:
        buffer = self._held.add(self._ctx.buffer(reserve=values.nbytes))

        def write(first: int, end: int) -> None:
            part = values[first * VERTICES : end * VERTICES]
            buffer.write(part, offset=first * VERTICES * values.strides[0])

        self.vertices.append((buffer, layout, name))
        self._pages.append(Pages(len(values), VERTICES, write))

    def bring(self, indices: np.ndarray) -> None:
        """Bring the vertices with some numbers, uint32 of any shape, as far as they are not there yet.

        Raises GpuError where there is no room.
        """
        with allocating(self._ctx, "the model"):
            for pages in self._pages:
                pages.bring(indices)

    @property
    def nbytes(self) -> int:
        return sum(buffer.size for buffer, _, _ in self.vertices)

    def release(self) -> None:
        self._held.release()
