"""How often a closed surface winds around a point: crossings of a ray with it, each with its sign.

A surface is closed here where every edge is run along as often in one direction as in the other; it may pass through
itself, and faces may share an edge in any number. The winding number of a point is the number of faces that a ray from
it leaves through, from back to front, less that of the faces it enters: 0 outside, 1 inside, -1 inside a surface that
is inside out.

Based on: Jacobson, Kavan, Sorkine-Hornung, "Robust Inside-Outside Segmentation using Generalized Winding Numbers",
2013, which takes winding numbers for surfaces that are not simple. Theirs are solid angles, these count crossings.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from hierarchy.cells import MOST_ITEMS, sort_into_cells
from hierarchy.model import Float64Array, Int32Array

# The winding number that is not counted: negative, so that what is seen there is never taken for hidden.
UNKNOWN = -(2**31)


def _frame() -> Float64Array:
    """Return a right-handed orthonormal frame, row by row, that no model's own axes, planes or diagonals share."""
    along = np.array([1.0, math.sqrt(2.0), math.pi]) / math.sqrt(3.0 + math.pi**2)
    across = np.cross(along, [math.sqrt(3.0), -1.0, 0.5])
    across /= np.linalg.norm(across)
    return np.stack([across, np.cross(along, across), along])


FRAME = _frame()


def turn(points: np.ndarray) -> Float64Array:
    """Return points (N, 3) in a frame whose third axis is the direction of the rays, float64."""
    turned: Float64Array = np.ascontiguousarray(points.astype(np.float64) @ FRAME.T)
    return turned


def winding_numbers(points: Float64Array, faces: Int32Array, at: Float64Array) -> Int32Array:
    """Return the winding numbers of a closed surface at some places, int32 (N,).

    points : float64 (V, 3), turned; faces : int32 (T, 3) with T > 0, one index for corners at one place
    at : float64 (N, 3), turned, not on the surface
    Where too many triangles lie over each other to count the crossings of every ray, the number is UNKNOWN.
    """
    cells = sort_into_cells(points, faces, len(at))
    numbers: Int32Array = _winding_numbers(
        points, faces, cells.starts, cells.items, cells.low, cells.scale, cells.side, at
    )
    return numbers


@nb.njit(cache=True, nogil=True, inline="always")
def _upward(ax, ay, bx, by, cross):  # type: ignore[no-untyped-def]
    """Return 1 or -1 where an edge a b crosses the positive x axis upwards or downwards, else 0.

    The same edge run along the other way gives exactly the opposite, so that no ray slips between two triangles.
    """
    if ay <= 0.0 < by and cross > 0.0:
        return 1
    if by <= 0.0 < ay and cross < 0.0:
        return -1
    return 0


@nb.njit(cache=True, nogil=True, inline="always")
def signed_crossing(ax, ay, az, bx, by, bz, cx, cy, cz):  # type: ignore[no-untyped-def]
    """Tell how the z axis crosses a triangle: 1 towards its front, -1 towards its back, 0 not; and at which z.

    A triangle that is seen edge-on crosses the axis like any other, or a ray would slip past it and not past its
    neighbours; and whatever rounding makes of the ratio of two small areas, it is crossed between its corners.
    """
    ab, bc, ca = ax * by - ay * bx, bx * cy - by * cx, cx * ay - cy * ax
    sign = _upward(ax, ay, bx, by, ab) + _upward(bx, by, cx, cy, bc) + _upward(cx, cy, ax, ay, ca)
    if sign == 0:
        return 0, 0.0
    low, high = min(az, bz, cz), max(az, bz, cz)
    area = ab + bc + ca
    if area == 0.0:
        return sign, 0.5 * (low + high)
    return sign, min(max((bc * az + ca * bz + ab * cz) / area, low), high)


@nb.njit(cache=True, nogil=True)
def _winding_number(points, faces, starts, items, cell, x, y, z):  # type: ignore[no-untyped-def]
    number = 0
    for k in range(starts[cell], starts[cell + 1]):
        a, b, c = faces[items[k], 0], faces[items[k], 1], faces[items[k], 2]
        ax, ay, az = points[a, 0] - x, points[a, 1] - y, points[a, 2] - z
        bx, by, bz = points[b, 0] - x, points[b, 1] - y, points[b, 2] - z
        cx, cy, cz = points[c, 0] - x, points[c, 1] - y, points[c, 2] - z
        sign, depth = signed_crossing(ax, ay, az, bx, by, bz, cx, cy, cz)
        if depth > 0.0:
            number += sign
    return number


@nb.njit(cache=True, nogil=True, parallel=True)
def _winding_numbers(points, faces, starts, items, low, scale, side, at):  # type: ignore[no-untyped-def]
    numbers = np.empty(len(at), np.int32)
    for i in nb.prange(len(at)):
        # A place beside the grid is beside all triangles, whichever cell it takes.
        column = min(max(math.floor((at[i, 0] - low[0]) * scale), 0), side - 1)
        row = min(max(math.floor((at[i, 1] - low[1]) * scale), 0), side - 1)
        cell = int(row) * side + int(column)
        numbers[i] = UNKNOWN
        if starts[cell + 1] - starts[cell] <= MOST_ITEMS:
            numbers[i] = _winding_number(points, faces, starts, items, cell, at[i, 0], at[i, 1], at[i, 2])
    return numbers
