"""A grid across a bundle of parallel rays: which triangles a ray through a cell can meet."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba as nb
import numpy as np
import numpy.typing as npt

from hierarchy.model import Float64Array, Int32Array

# Long triangles enter many cells. Beyond this many entries a triangle, or a query, the grid is made coarser.
MOST_ENTRIES = 16
# A cell with more triangles than this is not searched: who asks takes the answer that is on the safe side. On scans a
# cell has ten on average and 1,200 at most.
MOST_ITEMS = 2048
# Cells along one side at most: 4M cells.
MOST_CELLS = 2048
# Spans are widened by this share of a cell, far more than they are rounded by.
MARGIN = 1e-6


@dataclass(frozen=True, eq=False)
class Cells:
    """Triangles by the cells of a square grid in the plane of the first two coordinates.

    starts : int64 (side * side + 1,), where each cell's triangles begin in items, row by row
    items : int32, numbers of triangles
    low : float64 (2,), the grid's lower corner
    scale : cells a unit length
    side : cells along one side
    """

    starts: npt.NDArray[np.int64]
    items: Int32Array
    low: Float64Array
    scale: float
    side: int


def sort_into_cells(points: Float64Array, faces: Int32Array, queries: int) -> Cells:
    """Return the cells that each of faces (T, 3) over points (V, 3) meets; T > 0.

    queries : how often cells are going to be looked at, all over the model: the more, the finer they may be
    """
    used = points[faces.ravel(), :2]
    low = used.min(axis=0)
    extent = max(float((used.max(axis=0) - low).max()), 1e-300)
    # Some two triangles, or queries, a cell and layer of the surface.
    count = max(len(faces), queries)
    side = int(min(max(math.sqrt(0.5 * count), 1.0), MOST_CELLS))
    nothing = np.empty(0, np.int32)
    while True:
        cursors = np.zeros(side * side, np.int64)
        most = MOST_ENTRIES * count if side > 1 else len(faces)
        if _visit(points, faces, low, side / extent, side, cursors, nothing, most):
            break
        side //= 2
    starts = np.concatenate([np.zeros(1, np.int64), np.cumsum(cursors)])
    items = np.empty(starts[-1], np.int32)
    _visit(points, faces, low, side / extent, side, starts[:-1].copy(), items, len(items))
    return Cells(starts, items, low, side / extent, side)


@nb.njit(cache=True, nogil=True)
def _visit(points, faces, low, scale, side, cursors, items, most):  # type: ignore[no-untyped-def]
    """Move the cursor of every cell that a triangle meets, and put the triangle there where there are items.

    Returns whether there are at most so many entries; ends where there are more.
    """
    for t in range(len(faces)):
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        ax, ay = (points[a, 0] - low[0]) * scale, (points[a, 1] - low[1]) * scale
        bx, by = (points[b, 0] - low[0]) * scale, (points[b, 1] - low[1]) * scale
        cx, cy = (points[c, 0] - low[0]) * scale, (points[c, 1] - low[1]) * scale
        first, last = span(min(ay, by, cy), max(ay, by, cy), side)
        for row in range(first, last):
            left, right = row_span(ax, ay, bx, by, cx, cy, row)
            begin, end = span(left, right, side)
            most -= end - begin
            if most < 0:
                return False
            for cell in range(row * side + begin, row * side + end):
                if len(items) > 0:
                    items[cursors[cell]] = t
                cursors[cell] += 1
    return True


@nb.njit(cache=True, nogil=True, inline="always")
def span(low, high, side):  # type: ignore[no-untyped-def]
    """Return the cells 0 .. side - 1 that an interval meets, as begin and end, both 0 where it meets none."""
    if not (high + MARGIN >= 0.0 and low - MARGIN < side):
        return 0, 0
    begin = math.floor(max(low - MARGIN, 0.0))
    end = math.floor(min(high + MARGIN, side - 1.0)) + 1
    return begin, max(begin, end)


@nb.njit(cache=True, nogil=True, inline="always")
def row_span(ax, ay, bx, by, cx, cy, row):  # type: ignore[no-untyped-def]
    """Return the lowest and the highest x of a triangle between y = row and y = row + 1; inf and -inf where it is not.

    Coordinates are in cells.
    """
    low, high = row - MARGIN, row + 1.0 + MARGIN
    left, right = np.inf, -np.inf
    for px, py, qx, qy in ((ax, ay, bx, by), (bx, by, cx, cy), (cx, cy, ax, ay)):
        if max(py, qy) < low or min(py, qy) > high:
            continue
        x0, x1 = px, qx
        if py != qy:
            slope = (qx - px) / (qy - py)
            x0 = px + slope * (min(max(py, low), high) - py)
            x1 = px + slope * (min(max(qy, low), high) - py)
        left, right = min(left, x0, x1), max(right, x0, x1)
    return left, right
