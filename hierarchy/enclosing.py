"""Smallest enclosing circles of points of the plane and caps of points of the unit sphere.

Both are LP-type problems of combinatorial dimension 3 and are solved by the same pivoting scheme (Gaertner, "Fast
and Robust Smallest Enclosing Balls", ESA 1999): keep the best circle of at most three support points, find the
point farthest outside, solve the four-point problem exactly, repeat. The radius grows with every step, so it ends;
six passes over the points are typical. These are the four-point steps; the passes stand beside the data they run
over (circles.py, cones.py).

A step tries every circle that two or three of its points span through the new one, measures how far each has to reach
to hold all four, and takes the least. So there is no test of "inside" that rounding could fail: a circle that is badly
conditioned (three points nearly on one line, two nearly the same, a cap near 90 degrees) reaches too far and loses.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from hierarchy.borrowing import BORROWING

# Relative slack for "is inside", of squared distances: ten times the rounding of doubles.
INSIDE = 2e-15
# Ten times what is typical; a guard against cycling on rounding.
MAX_PASSES = 64
# A point that lies just outside moves the centre by as much, but the radius by its square, which rounding may swallow.
# So many times the radius may stay as it was.
MAX_STALLS = 8
# The squared distance of unit vectors at 90 degrees.
RIGHT_ANGLE = 2.0


@nb.njit(**BORROWING)
def _reach(points, count, x, y):  # type: ignore[no-untyped-def]
    """Return the largest squared distance of the first `count` points from (x, y)."""
    largest = 0.0
    for k in range(count):
        dx, dy = points[k, 0] - x, points[k, 1] - y
        largest = max(largest, dx * dx + dy * dy)
    return largest


@nb.njit(**BORROWING)
def circle_with_pivot(support, count, circle):  # type: ignore[no-untyped-def]
    """Find the smallest circle around `count` support points, the last of which lies on it.

    support : float64 (4, 2), the first `count` rows are in use, 2..4; reordered: the new support comes first. Taken
        relative to a point close by, so that coordinates are about as small as the circle.
    circle : float64 (3,), receives x, y and the squared radius, which holds all of the support
    Returns the new number of support points, 2 or 3.
    """
    p = count - 1
    best = np.inf
    first, second = 0, -1
    px, py = support[p, 0], support[p, 1]
    # Two points, the segment between them a diameter.
    for i in range(p):
        x, y = 0.5 * (px + support[i, 0]), 0.5 * (py + support[i, 1])
        r2 = _reach(support, count, x, y)
        if r2 < best:
            best, first, second = r2, i, -1
            circle[0], circle[1], circle[2] = x, y, r2
    # Three points, their circumcircle.
    for i in range(p):
        for j in range(i + 1, p):
            ax, ay = support[i, 0] - px, support[i, 1] - py
            bx, by = support[j, 0] - px, support[j, 1] - py
            cross = 2.0 * (ax * by - ay * bx)
            if cross == 0.0:
                continue
            a2, b2 = ax * ax + ay * ay, bx * bx + by * by
            x, y = px + (by * a2 - ay * b2) / cross, py + (ax * b2 - bx * a2) / cross
            r2 = _reach(support, count, x, y)
            if r2 < best:
                best, first, second = r2, i, j
                circle[0], circle[1], circle[2] = x, y, r2
    ax, ay = support[first, 0], support[first, 1]
    bx, by = support[second, 0], support[second, 1]
    support[0, 0], support[0, 1] = px, py
    support[1, 0], support[1, 1] = ax, ay
    support[2, 0], support[2, 1] = bx, by
    return 2 if second < 0 else 3


@nb.njit(**BORROWING)
def _reach_on_sphere(vectors, count, x, y, z):  # type: ignore[no-untyped-def]
    """Return the largest squared distance of the first `count` unit vectors from an axis, 2 minus twice the cosine."""
    largest = 0.0
    for k in range(count):
        dx, dy, dz = vectors[k, 0] - x, vectors[k, 1] - y, vectors[k, 2] - z
        largest = max(largest, dx * dx + dy * dy + dz * dz)
    return largest


@nb.njit(cache=True, nogil=True, inline="always")
def _between(px, py, pz, qx, qy, qz):  # type: ignore[no-untyped-def]
    """Return the direction half way between two unit vectors, zero where they are opposite."""
    x, y, z = px + qx, py + qy, pz + qz
    # The sum of nearly opposite vectors is short, and what they are off unit length leans it towards one of them: take
    # that part out, along their difference.
    dx, dy, dz = px - qx, py - qy, pz - qz
    d2 = dx * dx + dy * dy + dz * dz
    if d2 > 0.0:
        lean = (x * dx + y * dy + z * dz) / d2
        x, y, z = x - lean * dx, y - lean * dy, z - lean * dz
    norm = math.sqrt(x * x + y * y + z * z)
    if norm == 0.0:
        return 0.0, 0.0, 0.0
    return x / norm, y / norm, z / norm


@nb.njit(**BORROWING)
def cap_with_pivot(support, count, cap):  # type: ignore[no-untyped-def]
    """Find the smallest cap around `count` unit vectors, the last of which lies on its rim.

    support : float64 (4, 3), the first `count` rows are in use, 2..4; reordered: the new support comes first
    cap : float64 (4,), receives the axis and the largest squared distance of the support from it. Unlike a cosine that
        tells the narrowest caps apart
    Returns the new number of support vectors, 2 or 3, or 0 where no cap below 90 degrees holds them.
    """
    p = count - 1
    best = RIGHT_ANGLE
    first, second = -1, -1
    px, py, pz = support[p, 0], support[p, 1], support[p, 2]
    for i in range(p):
        x, y, z = _between(px, py, pz, support[i, 0], support[i, 1], support[i, 2])
        if x == 0.0 and y == 0.0 and z == 0.0:
            continue
        reach = _reach_on_sphere(support, count, x, y, z)
        if reach < best:
            best, first, second = reach, i, -1
            cap[0], cap[1], cap[2], cap[3] = x, y, z, reach
    for i in range(p):
        for j in range(i + 1, p):
            ax, ay, az = support[i, 0] - px, support[i, 1] - py, support[i, 2] - pz
            bx, by, bz = support[j, 0] - px, support[j, 1] - py, support[j, 2] - pz
            x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
            norm = math.sqrt(x * x + y * y + z * z)
            if norm == 0.0:
                continue
            # Whichever way round the three run, the axis is on their side.
            norm = math.copysign(norm, x * px + y * py + z * pz)
            x, y, z = x / norm, y / norm, z / norm
            reach = _reach_on_sphere(support, count, x, y, z)
            if reach < best:
                best, first, second = reach, i, j
                cap[0], cap[1], cap[2], cap[3] = x, y, z, reach
    if first < 0:
        return 0
    ax, ay, az = support[first, 0], support[first, 1], support[first, 2]
    bx, by, bz = support[second, 0], support[second, 1], support[second, 2]
    support[0, 0], support[0, 1], support[0, 2] = px, py, pz
    support[1, 0], support[1, 1], support[1, 2] = ax, ay, az
    support[2, 0], support[2, 1], support[2, 2] = bx, by, bz
    return 2 if second < 0 else 3
