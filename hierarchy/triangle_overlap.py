"""Which triangles pass through which others.

Two triangles pass through each other where no plane parts them. Those that only touch, at a shared edge or corner or
side by side in one plane, do not. Separating axes: the normals and the cross products of the edges (Gottschalk, Lin,
Manocha, "OBBTree", 1996).
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from hierarchy.cells import row_span, sort_into_cells, span
from hierarchy.model import BoolArray, Float64Array, Int32Array

# Others that are looked at for one triangle at most, an other once for every cell that both meet.
MOST_LOOKS = 128


def pass_through(
    points: Float64Array, faces: Int32Array, other_points: Float64Array, others: Int32Array, tolerance: float
) -> BoolArray:
    """Return for each of faces (T, 3) whether it passes through one of `others` (C, 3) with C > 0, bool (T,).

    Where too many of the others lie in its cells to look at them all it is said to.
    points, other_points : float64 (V, 3)
    tolerance : a length; triangles that reach no deeper than this through each other only touch
    """
    cells = sort_into_cells(other_points, others, len(faces))
    grid = (cells.starts, cells.items, cells.low, cells.scale, cells.side)
    through: BoolArray = _pass_through(points, faces, other_points, others, grid, tolerance)
    return through


@nb.njit(cache=True, nogil=True)
def _parts(x, y, z, p, q, tolerance):  # type: ignore[no-untyped-def]
    """Tell whether two triangles (3, 3) lie on different sides along an axis of any length."""
    length = math.sqrt(x * x + y * y + z * z)
    if length == 0.0:
        return False
    low_p = low_q = np.inf
    high_p = high_q = -np.inf
    for k in range(3):
        along = x * p[k, 0] + y * p[k, 1] + z * p[k, 2]
        low_p, high_p = min(low_p, along), max(high_p, along)
        along = x * q[k, 0] + y * q[k, 1] + z * q[k, 2]
        low_q, high_q = min(low_q, along), max(high_q, along)
    slack = tolerance * length
    return high_p <= low_q + slack or high_q <= low_p + slack


@nb.njit(cache=True, nogil=True)
def _overlap(p, q, tolerance):  # type: ignore[no-untyped-def]
    """Tell whether triangles (3, 3), with corners relative to a place nearby, pass through each other."""
    if (
        _parts(1.0, 0.0, 0.0, p, q, tolerance)
        or _parts(0.0, 1.0, 0.0, p, q, tolerance)
        or _parts(0.0, 0.0, 1.0, p, q, tolerance)
    ):
        return False
    p_edges, q_edges = np.empty((3, 3), np.float64), np.empty((3, 3), np.float64)
    for k in range(3):
        for axis in range(3):
            p_edges[k, axis] = p[(k + 1) % 3, axis] - p[k, axis]
            q_edges[k, axis] = q[(k + 1) % 3, axis] - q[k, axis]
    for edges in (p_edges, q_edges):
        u, v = edges[0], edges[1]
        if _parts(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0], p, q, tolerance):
            return False
    for i in range(3):
        for j in range(3):
            u, v = p_edges[i], q_edges[j]
            if _parts(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0], p, q, tolerance):
                return False
    return True


@nb.njit(cache=True, nogil=True)
def _meets_one(points, face, other_points, others, grid, tolerance):  # type: ignore[no-untyped-def]
    """Tell whether a triangle passes through one of those in the cells that it meets."""
    starts, items, low, scale, side = grid
    a, b, c = face[0], face[1], face[2]
    ax, ay = (points[a, 0] - low[0]) * scale, (points[a, 1] - low[1]) * scale
    bx, by = (points[b, 0] - low[0]) * scale, (points[b, 1] - low[1]) * scale
    cx, cy = (points[c, 0] - low[0]) * scale, (points[c, 1] - low[1]) * scale
    first, last = span(min(ay, by, cy), max(ay, by, cy), side)
    if first == last:
        return False
    looks_left = MOST_LOOKS
    p, q = np.empty((3, 3), np.float64), np.empty((3, 3), np.float64)
    for k in range(3):
        for axis in range(3):
            p[k, axis] = points[face[k], axis] - points[a, axis]
    for row in range(first, last):
        left, right = row_span(ax, ay, bx, by, cx, cy, row)
        begin, end = span(left, right, side)
        looks_left -= starts[row * side + end] - starts[row * side + begin]
        if looks_left < 0:
            return True
        for item in range(starts[row * side + begin], starts[row * side + end]):
            for k in range(3):
                for axis in range(3):
                    q[k, axis] = other_points[others[items[item], k], axis] - points[a, axis]
            if _overlap(p, q, tolerance):
                return True
    return False


@nb.njit(cache=True, nogil=True, parallel=True)
def _pass_through(points, faces, other_points, others, grid, tolerance):  # type: ignore[no-untyped-def]
    through = np.empty(len(faces), np.bool_)
    for i in nb.prange(len(faces)):
        through[i] = _meets_one(points, faces[i], other_points, others, grid, tolerance)
    return through
