"""The cut of a frame on the GPU: its splats' records, a vertex for each corner, the indices of its leaf triangles.

The records are gathered for every frame and not kept there: those of a cut lie far apart among those of its model, and
a software renderer waits for each of them, for each corner and in both passes, longer than gathering all takes.
"""

from __future__ import annotations

import moderngl
import numpy as np

from hierarchy.drawn_rows import gather_rows
from hierarchy.hierarchy import SPLAT
from hierarchy.lod import Cut
from hierarchy.model import UInt8Array
from renderer.allocation import GpuError, allocating
from renderer.limits import Limits
from renderer.tile_pages import TilePages

# The two triangles of a rectangle, by the numbers of its corners: u from bit 0, v from bit 1.
TRIANGLES_OF_CORNERS = (0, 1, 2, 2, 1, 3)
CORNERS = 4
# A record is a whole number of RGBA32F texels; this many records are a row of the texture. The power of two spares the
# shader a division.
TEXELS_PER_SPLAT = SPLAT.itemsize // 16
ROW_BITS = 10
RECORDS_IN_ROW = 1 << ROW_BITS


class CutBuffers:
    """The cut of a frame on the GPU, uploaded once for both passes.

    records : texture of the splats' records, RECORDS_IN_ROW of them to a row
    places : for each splat, CORNERS times, the place of its tile, int32, below 0: it has none, and the four bytes of
        the tile's spread
    colors : for each splat, CORNERS times, the four bytes of its colour
    corners : indices of the splats' triangles into these, the same for every cut
    indices : of the leaf triangles' vertices
    """

    # Four vertices a splat take more room than one instance of four, and less time: to a software renderer every
    # instance is a draw of its own.
    def __init__(self, ctx: moderngl.Context, limits: Limits) -> None:
        self._ctx, self._limits = ctx, limits
        self.places, self.colors, self.corners, self.indices = (ctx.buffer(reserve=4, dynamic=True) for _ in range(4))
        self.records = self._texture(1)

    def splat_array(self, program: moderngl.Program, *, sprite: bool) -> moderngl.VertexArray:
        """Return the vertex array that draws splats with a program whose inputs are those of splat.vert.

        sprite : as points, for which the first corner of each will do
        """
        content: list[tuple[object, ...]] = []
        if "in_tile" in program:
            skip = f" {8 * (CORNERS - 1)}x" if sprite else ""
            content.append((self.places, "1i 4f1" + skip, "in_tile", "in_spread"))
        if "in_color" in program:
            skip = f" {4 * (CORNERS - 1)}x" if sprite else ""
            content.append((self.colors, "4f1" + skip, "in_color"))
        return self._ctx.vertex_array(program, content, None if sprite else self.corners)

    def upload(self, cut: Cut, records: np.ndarray, colors: UInt8Array | None, tiles: TilePages | None) -> None:
        """Bring a cut to the GPU, with the tiles of its splats where there are any.

        records : SPLAT (K,), of the cut's splats
        colors : uint8 (M, 4), of all splats of the hierarchy, None: it has none

        Raises GpuError where there is no room for it.
        """
        self._write_records(records)
        if tiles is not None:
            self._write(self.places, tiles.places_of(cut.splats, CORNERS))
        if colors is not None:
            self._write(self.colors, gather_rows(colors.view(np.int32), cut.splats, (0,), repeats=CORNERS))
        self._write(self.indices, cut.indices)
        if self.corners.size < 4 * len(TRIANGLES_OF_CORNERS) * len(records):
            self._number_corners(len(records) + len(records) // 2)

    def _write_records(self, records: np.ndarray) -> None:
        rows, rest = divmod(len(records), RECORDS_IN_ROW)
        height = rows + (rest > 0)
        if height > self.records.height:
            if height > self._limits.texture_size:
                most = self._limits.texture_size * RECORDS_IN_ROW
                raise GpuError(f"{len(records):,} splats in one frame are too many: {most:,} can be drawn")
            self.records, old = self._texture(min(height + height // 2, self._limits.texture_size)), self.records
            old.release()
        width = self.records.width
        if rows:
            self.records.write(records[: rows * RECORDS_IN_ROW], (0, 0, width, rows))
        if rest:
            self.records.write(records[rows * RECORDS_IN_ROW :], (0, rows, rest * TEXELS_PER_SPLAT, 1))

    def _texture(self, rows: int) -> moderngl.Texture:
        with allocating(self._ctx, "a frame's splats") as held:
            size = RECORDS_IN_ROW * TEXELS_PER_SPLAT, rows
            texture = held.add(self._ctx.texture(size, 4, dtype="f4"))
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
            return texture

    def _write(self, buffer: moderngl.Buffer, array: np.ndarray) -> None:
        if array.nbytes > buffer.size:
            # Room for half as much again: a cut that grows a little every frame shall not reallocate every frame.
            with allocating(self._ctx, "a frame's splats"):
                buffer.orphan(array.nbytes + array.nbytes // 2)
        if len(array):
            buffer.write(np.ascontiguousarray(array))

    def _number_corners(self, count: int) -> None:
        """Fill `corners` for so many splats."""
        first = np.arange(count, dtype=np.uint32) * CORNERS
        corners = first[:, None] + np.array(TRIANGLES_OF_CORNERS, np.uint32)
        with allocating(self._ctx, "a frame's splats"):
            self.corners.orphan(corners.nbytes)
        self.corners.write(corners)

    @property
    def nbytes(self) -> int:
        texels = self.records.width * self.records.height
        buffers = self.places, self.colors, self.corners, self.indices
        return int(16 * texels + sum(buffer.size for buffer in buffers))

    def release(self) -> None:
        for each in (self.places, self.colors, self.corners, self.indices, self.records):
            each.release()
