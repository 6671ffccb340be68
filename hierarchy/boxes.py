"""The rectangle of a disc in which everything below it lies: what has to be drawn of the disc.

The smallest circle around a roughly square patch has half as much again of its area, and the square around that circle
twice. The rectangle may be turned in the disc's plane, by one of TURNS angles. Drawing it instead of the square took
0.8 of the time of a frame of Igea, and the outline grew by 0.05 instead of 0.13 pixels. The smallest rectangles have
0.55 of the square's area, those of 1, 4, 8 and 16 turns 0.62, 0.58, 0.57 and 0.56.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from hierarchy.borrowing import BORROWING
from hierarchy.circles import AT_ONCE
from hierarchy.extremes import NEVER_NAN, larger, smaller

TURNS = 8
_COSINES = np.cos(0.5 * math.pi * np.arange(TURNS) / TURNS)
_SINES = np.sin(0.5 * math.pi * np.arange(TURNS) / TURNS)
# The turn is added to a coordinate of a box, which is at most 1 in absolute value, in steps of this size.
TURN_STEP = 4.0
# What the ends are moved out by: float32 holds the last one, with all turns added to it, to half of 1.9e-6.
ROUNDING = 1e-6
# The box of a disc that is drawn whole.
WHOLE_DISC = (-1.0, 1.0, -1.0, 1.0)


@nb.njit(**BORROWING, fastmath=NEVER_NAN)
def _widen(ends, u, v, count, x, y, cosine, sine):  # type: ignore[no-untyped-def]
    """Widen what lies between low and high ends along turned axes to hold the first `count` points, relative to (x, y).

    ends : float64 (4,), low and high along one axis, low and high along the other
    """
    left, right, low, high = ends[0], ends[1], ends[2], ends[3]
    for i in range(count):
        du, dv = u[i] - x, v[i] - y
        across, up = cosine * du + sine * dv, cosine * dv - sine * du
        left, right = smaller(left, across), larger(right, across)
        low, high = smaller(low, up), larger(high, up)
    ends[0], ends[1], ends[2], ends[3] = left, right, low, high


@nb.njit(**BORROWING)
def tight_box(u, v, count, x, y, radius, box, ends):  # type: ignore[no-untyped-def]
    """Write the smallest rectangle around the first `count` >= 1 points to box, float32 (4,), rounded outwards.

    u, v : float64, coordinates of the points
    x, y, radius : of a circle that holds the points
    box : low and high ends along the turned u axis, low and high ends along the turned v axis, relative to the circle's
        centre and in units of its radius. TURN_STEP times the number of turns of 90 / TURNS degrees from the disc's
        tangents to the turned axes is added to the last.
    ends : float64 (TURNS, 4), to work in
    """
    if radius <= 0.0:
        box[0], box[1], box[2], box[3] = WHOLE_DISC
        return
    for turn in range(TURNS):
        ends[turn, 0] = ends[turn, 2] = np.inf
        ends[turn, 1] = ends[turn, 3] = -np.inf
    for some in range(0, count, AT_ONCE):
        for turn in range(TURNS):
            _widen(ends[turn], u[some:], v[some:], min(count - some, AT_ONCE), x, y, _COSINES[turn], _SINES[turn])
    smallest, best = np.inf, 0
    for turn in range(TURNS):
        area = (ends[turn, 1] - ends[turn, 0]) * (ends[turn, 3] - ends[turn, 2])
        if area < smallest:
            smallest, best = area, turn
    left, right = ends[best, 0] / radius, ends[best, 1] / radius
    low, high = ends[best, 2] / radius, ends[best, 3] / radius
    box[0], box[1] = max(left - ROUNDING, -1.0), min(right + ROUNDING, 1.0)
    box[2], box[3] = max(low - ROUNDING, -1.0), min(high + ROUNDING, 1.0) + TURN_STEP * best
