"""The cut of a frame on the GPU: its splats, a vertex for each corner, and the indices of its leaf triangles."""

from __future__ import annotations

import moderngl
import numpy as np

from hierarchy.lod import Cut
from renderer.allocation import allocating
from renderer.tile_pages import TilePages

# The two triangles of a rectangle, by the numbers of its corners: u from bit 0, v from bit 1.
TRIANGLES_OF_CORNERS = (0, 1, 2, 2, 1, 3)
CORNERS = 4
SPLAT_BYTES = 12


class CutBuffers:
    """The cut of a frame on the GPU, uploaded once for both passes.

    splats : for each splat, CORNERS times, its number, uint32, the place of its tile, int32, below 0: it has none, and
        the four bytes of the tile's spread
    corners : indices of the splats' triangles into these, the same for every cut
    indices : of the leaf triangles' vertices
    """

    # Four vertices a splat take more room than one instance of four, and less time: to a software renderer every
    # instance is a draw of its own.
    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self.splats = ctx.buffer(reserve=SPLAT_BYTES, dynamic=True)
        self.corners = ctx.buffer(reserve=SPLAT_BYTES, dynamic=True)
        self.indices = ctx.buffer(reserve=SPLAT_BYTES, dynamic=True)

    def splat_array(self, program: moderngl.Program, *, sprite: bool) -> moderngl.VertexArray:
        """Return the vertex array that draws splats with a program whose inputs are those of splat.vert.

        sprite : as points, for which the first corner of each will do
        """
        names = [name for name in ("in_splat", "in_tile", "in_spread") if name in program]
        layout = ("1u 1i 4f1" if len(names) > 1 else "1u 8x") + (f" {SPLAT_BYTES * (CORNERS - 1)}x" if sprite else "")
        return self._ctx.vertex_array(program, [(self.splats, layout, *names)], None if sprite else self.corners)

    def upload(self, cut: Cut, tiles: TilePages | None) -> None:
        """Bring a cut to the GPU, with the tiles of its splats where there are any.

        Raises GpuError where there is no room for it.
        """
        splats = np.empty((len(cut.splats), 3), np.uint32)
        splats[:, 0] = cut.splats
        splats[:, 1:] = 0xFFFFFFFF
        if tiles is not None:
            places, splats[:, 2] = tiles.places_of(cut.splats)
            splats[:, 1] = places.view(np.uint32)
        self._write(self.splats, np.repeat(splats, CORNERS, axis=0))
        self._write(self.indices, cut.indices)
        if self.corners.size < 4 * len(TRIANGLES_OF_CORNERS) * len(splats):
            self._number_corners()

    def _write(self, buffer: moderngl.Buffer, array: np.ndarray) -> None:
        if array.nbytes > buffer.size:
            # Room for half as much again: a cut that grows a little every frame shall not reallocate every frame.
            with allocating(self._ctx, "a frame's splats"):
                buffer.orphan(array.nbytes + array.nbytes // 2)
        if len(array):
            buffer.write(np.ascontiguousarray(array))

    def _number_corners(self) -> None:
        """Fill `corners` for as many splats as there is room for."""
        first = np.arange(self.splats.size // (SPLAT_BYTES * CORNERS), dtype=np.uint32) * CORNERS
        corners = first[:, None] + np.array(TRIANGLES_OF_CORNERS, np.uint32)
        with allocating(self._ctx, "a frame's splats"):
            self.corners.orphan(corners.nbytes)
        self.corners.write(corners)

    @property
    def nbytes(self) -> int:
        return int(self.splats.size + self.corners.size + self.indices.size)

    def release(self) -> None:
        self.splats.release()
        self.corners.release()
        self.indices.release()
