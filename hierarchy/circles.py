"""The smallest circle around points of the plane, found by passes over them (enclosing.py has the steps between)."""

from __future__ import annotations

import numba as nb
import numpy as np

from hierarchy.borrowing import BORROWING
from hierarchy.enclosing import INSIDE, MAX_PASSES, MAX_STALLS, circle_with_pivot
from hierarchy.extremes import NEVER_NAN, larger

# Points that are looked at several times while they are near.
AT_ONCE = 1024


@nb.njit(**BORROWING, fastmath=NEVER_NAN)
def _largest(u, v, count, ox, oy, x, y):  # type: ignore[no-untyped-def]
    """Return the largest squared distance of the first `count` points from (x, y), which is relative to (ox, oy)."""
    largest = 0.0
    for i in range(count):
        du, dv = u[i] - ox - x, v[i] - oy - y
        largest = larger(largest, du * du + dv * dv)
    return largest


@nb.njit(**BORROWING, fastmath=NEVER_NAN)
def _which(u, v, count, ox, oy, x, y, distance2):  # type: ignore[no-untyped-def]
    """Return which of the first `count` points is as far from (x, y), as `_largest` finds it."""
    which = 0
    for i in range(count):
        du, dv = u[i] - ox - x, v[i] - oy - y
        which = max(which, i if du * du + dv * dv >= distance2 else 0)
    return which


@nb.njit(**BORROWING)
def _farthest(u, v, count, ox, oy, x, y):  # type: ignore[no-untyped-def]
    """Return which of the first `count` points is the farthest from (x, y), and its squared distance."""
    largest, begin = -1.0, 0
    for some in range(0, count, AT_ONCE):
        distance2 = _largest(u[some:], v[some:], min(count - some, AT_ONCE), ox, oy, x, y)
        if distance2 > largest:
            largest, begin = distance2, some
    return begin + _which(u[begin:], v[begin:], min(count - begin, AT_ONCE), ox, oy, x, y, largest), largest


@nb.njit(**BORROWING)
def smallest_circle(u, v, count, circle, support):  # type: ignore[no-untyped-def]
    """Write x, y and squared radius of the smallest circle around the first `count` >= 1 points to circle.

    u, v : float64, coordinates; circle : float64 (3,); support : float64 (4, 2), to work in
    """
    # Points that are nearly identical keep their digits where they are relative to one of them.
    ox, oy = u[0], v[0]
    # The farthest point from any is on the circle nearly always, and that farthest from it often.
    first, _ = _farthest(u, v, count, ox, oy, 0.0, 0.0)
    second, _ = _farthest(u, v, count, ox, oy, u[first] - ox, v[first] - oy)
    support[0, 0], support[0, 1] = u[first] - ox, v[first] - oy
    support[1, 0], support[1, 1] = u[second] - ox, v[second] - oy
    rows = circle_with_pivot(support, 2, circle)
    stalls = 0
    best, x, y = np.inf, 0.0, 0.0
    for _ in range(MAX_PASSES):
        farthest, largest = _farthest(u, v, count, ox, oy, circle[0], circle[1])
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
