"""The smallest circle around points of the plane, found by passes over them (enclosing.py has the steps between)."""

from __future__ import annotations

import numba as nb
import numpy as np

from hierarchy.borrowing import BORROWING
from hierarchy.enclosing import INSIDE, MAX_PASSES, MAX_STALLS, circle_with_pivot

# Points from which on it is worth finding first which of them lie well inside.
MANY = 160
# Points among which the corners of a polygon inside them all are looked for, and how many corners that has.
SAMPLE, CORNERS = 256, 8
# More than what is computed of a point's place beside a line is off by, relative to coordinates and lengths.
ROUNDING = 1e-14
# The same result whichever way the minimum is taken, several at a time.
IN_ANY_ORDER = {"nnan", "nsz", "contract"}


@nb.njit(**BORROWING)
def _farthest(u, v, count, x, y):  # type: ignore[no-untyped-def]
    """Return which of the first `count` points is the farthest from (x, y), and its squared distance."""
    farthest, largest = 0, -1.0
    for i in range(count):
        du, dv = u[i] - x, v[i] - y
        d2 = du * du + dv * dv
        if d2 > largest:
            largest, farthest = d2, i
    return farthest, largest


@nb.njit(**BORROWING)
def smallest_circle(u, v, count, circle, support):  # type: ignore[no-untyped-def]
    """Write x, y and squared radius of the smallest circle around the first `count` >= 1 points to circle.

    u, v : float64, coordinates; circle : float64 (3,); support : float64 (4, 2), to work in
    """
    # Points that are nearly identical keep their digits where they are relative to one of them.
    ox, oy = u[0], v[0]
    # The farthest point from any is on the circle nearly always, and that farthest from it often.
    first, _ = _farthest(u, v, count, ox, oy)
    second, _ = _farthest(u, v, count, u[first], v[first])
    support[0, 0], support[0, 1] = u[first] - ox, v[first] - oy
    support[1, 0], support[1, 1] = u[second] - ox, v[second] - oy
    rows = circle_with_pivot(support, 2, circle)
    stalls = 0
    best, x, y = np.inf, 0.0, 0.0
    for _ in range(MAX_PASSES):
        farthest, largest = 0, -1.0
        for i in range(count):
            du, dv = u[i] - ox - circle[0], v[i] - oy - circle[1]
            d2 = du * du + dv * dv
            if d2 > largest:
                largest, farthest = d2, i
        # The measured maximum, not the support's: nothing may stick out by rounding.
        if largest < best:
            best, x, y = largest, circle[0], circle[1]
        least = circle[2]
        if largest <= least * (1.0 + INSIDE) or stalls == MAX_STALLS:
            break
        support[rows, 0], support[rows, 1] = u[farthest] - ox, v[farthest] - oy
        rows = circle_with_pivot(support, rows + 1, circle)
        stalls += circle[2] <= least
    circle[0], circle[1], circle[2] = x + ox, y + oy, best


@nb.njit(**BORROWING)
def _polygon(u, v, count, corners):  # type: ignore[no-untyped-def]
    """Write points that lie far out along the axes and the diagonals to corners, (CORNERS, 3), counter-clockwise.

    The last column receives how far.
    """
    for k in range(CORNERS):
        corners[k, 2] = -np.inf
    for i in range(0, count, count // SAMPLE + 1):
        x, y = u[i], v[i]
        for k, reach in enumerate((x, x + y, y, y - x, -x, -x - y, -y, x - y)):
            if reach > corners[k, 2]:
                corners[k, 0], corners[k, 1], corners[k, 2] = x, y, reach


@nb.njit(**BORROWING, fastmath=IN_ANY_ORDER)
def _lower(inside, u, v, count, a, b, c):  # type: ignore[no-untyped-def]
    """Lower what points are inside of other lines by to what they are inside of a u + b v + c = 0 by."""
    for i in range(count):
        inside[i] = min(inside[i], a * u[i] + b * v[i] + c)


@nb.njit(**BORROWING)
def keep_outer(u, v, count, outer, corners):  # type: ignore[no-untyped-def]
    """Write the points that may be corners of their convex hull to outer, float64 (2, >= count); return their number.

    corners : float64 (CORNERS, 3), to work in
    Those inside a polygon of some of them are not (Akl and Toussaint 1978): no circle's and no rectangle's size depends
    on them.
    """
    _polygon(u, v, count, corners)
    # How far inside, until the points that are kept take the place.
    inside = outer[0]
    for i in range(count):
        inside[i] = np.inf
    far = 0.0
    for k in range(CORNERS):
        far = max(far, abs(corners[k, 0]), abs(corners[k, 1]))
    for k in range(CORNERS):
        x, y = corners[k, 0], corners[k, 1]
        du, dv = corners[(k + 1) % CORNERS, 0] - x, corners[(k + 1) % CORNERS, 1] - y
        if du != 0.0 or dv != 0.0:
            # Corners are inside by nothing but rounding.
            rounding = ROUNDING * far * (abs(du) + abs(dv))
            _lower(inside, u, v, count, -dv, du, dv * x - du * y - rounding)
    kept = 0
    for i in range(count):
        if not 0.0 < inside[i] < np.inf:
            outer[0, kept], outer[1, kept] = u[i], v[i]
            kept += 1
    return kept
