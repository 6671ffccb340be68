"""Cones that hold several others: what lies in them is not known one by one, so they are wider than need be."""

from __future__ import annotations

import math

import numba as nb

from hierarchy.borrowing import BORROWING
from hierarchy.cones import EVERYTHING

# Radians by which a cone is widened when it is joined with another: far above rounding, far below what matters.
SLACK = 1e-7


@nb.njit(cache=True, nogil=True, inline="always")
def angle_between(ax, ay, az, bx, by, bz):  # type: ignore[no-untyped-def]
    """Return cosine and sine of the angle between unit vectors, the sine with all its digits."""
    x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return ax * bx + ay * by + az * bz, math.sqrt(x * x + y * y + z * z)


@nb.njit(**BORROWING)
def cap_holds(cap, x, y, z, cosine, sine):  # type: ignore[no-untyped-def]
    """Tell whether a cap, float64 (4,), axis and cosine of its half-angle, holds a cone; as in `join_cone`."""
    if cap[3] == EVERYTHING:
        return True
    if cosine == EVERYTHING:
        return False
    c, s = angle_between(cap[0], cap[1], cap[2], x, y, z)
    # The cosine of the farthest angle in the cone; the same cone again lies inside. What is on the other side of the
    # sphere is not: beyond 180 degrees cosines grow again.
    return c * cosine - s * sine >= cap[3] - 1e-12 and c * sine + s * cosine >= -1e-12


@nb.njit(**BORROWING)
def join_cone(cap, x, y, z, cosine, sine):  # type: ignore[no-untyped-def]
    """Widen a cap, float64 (4,), axis and cosine of its half-angle, to hold another cone; EVERYTHING from 90 degrees.

    x, y, z : the cone's axis, of any length but 0; cosine, sine : of its half-angle
    """
    if cap[3] == EVERYTHING:
        return
    if cosine == EVERYTHING:
        cap[3] = EVERYTHING
        return
    norm = math.sqrt(x * x + y * y + z * z)
    x, y, z = x / norm, y / norm, z / norm
    if cap_holds(cap, x, y, z, cosine, sine):
        return
    c, s = angle_between(cap[0], cap[1], cap[2], x, y, z)
    between, mine = math.atan2(s, c), math.acos(min(cap[3], 1.0))
    other = math.atan2(sine, cosine)
    half = 0.5 * (mine + between + other)
    if other >= between + mine:
        cap[0], cap[1], cap[2] = x, y, z
        half = other
    elif s > 0.0:
        # Turn the axis towards the other.
        turn = half - mine
        a, b = math.sin(between - turn) / s, math.sin(turn) / s
        cap[0], cap[1], cap[2] = a * cap[0] + b * x, a * cap[1] + b * y, a * cap[2] + b * z
    half += SLACK
    cap[3] = math.cos(half) if half < 0.5 * math.pi else EVERYTHING


@nb.njit(**BORROWING)
def join_vector(cap, x, y, z):  # type: ignore[no-untyped-def]
    """Widen a cap, float64 (4,), to hold a unit vector outside of it; as `join_cone`, without its angles."""
    c, s = angle_between(cap[0], cap[1], cap[2], x, y, z)
    cosine = min(cap[3], 1.0)
    sine = math.sqrt((1.0 - cosine) * (1.0 + cosine))
    # The axis turns by half of what the vector is off the cap, and the cap becomes wider by as much.
    off_cosine, off_sine = c * cosine + s * sine, s * cosine - c * sine
    turn_cosine = math.sqrt(max(0.5 * (1.0 + off_cosine), 0.0))
    if s <= 0.0 or off_sine <= 0.0 or turn_cosine < 0.1:
        join_cone(cap, x, y, z, 1.0, 0.0)
        return
    turn_sine = 0.5 * off_sine / turn_cosine
    a, b = turn_cosine - turn_sine * c / s, turn_sine / s
    cap[0], cap[1], cap[2] = a * cap[0] + b * x, a * cap[1] + b * y, a * cap[2] + b * z
    half_cosine = cosine * turn_cosine - sine * turn_sine
    half_sine = sine * turn_cosine + cosine * turn_sine
    half_cosine -= SLACK * half_sine
    cap[3] = half_cosine if half_cosine > 0.0 else EVERYTHING


@nb.njit(**BORROWING)
def join_farthest_first(cap, vectors):  # type: ignore[no-untyped-def]
    """Widen a cap to hold unit vectors, float64 (N, 3), the farthest first: hardly more than all at once would."""
    for _ in range(len(vectors)):
        least, farthest = 2.0, -1
        for i in range(len(vectors)):
            c = cap[0] * vectors[i, 0] + cap[1] * vectors[i, 1] + cap[2] * vectors[i, 2]
            if c < least:
                least, farthest = c, i
        if cap[3] == EVERYTHING or least >= cap[3]:
            return
        join_vector(cap, vectors[farthest, 0], vectors[farthest, 1], vectors[farthest, 2])
