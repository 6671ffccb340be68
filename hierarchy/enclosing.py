"""Smallest enclosing circles of points of the plane and caps of points of the unit sphere.

Both are LP-type problems of combinatorial dimension 3 and are solved by the same pivoting scheme (Gaertner, "Fast
and Robust Smallest Enclosing Balls", ESA 1999): keep the best circle of at most three support points, find the
point farthest outside, solve the four-point problem exactly, repeat. The radius grows with every step, so it ends;
six passes over the points are typical. These are the four-point steps; the passes stand beside the data they run
over (discs.py, cones.py).
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

# Relative slack for "is inside" a circle: far above float64 rounding, far below what any picture shows.
INSIDE = 1e-10
# The same for cosines of caps, where 1e-14 is already 1.4e-7 radians.
CAP_INSIDE = 1e-14
# Ten times what is typical; a guard against cycling on rounding.
MAX_PASSES = 64


@nb.njit(cache=True, nogil=True)
def _circle_holds(points, count, x, y, r2):  # type: ignore[no-untyped-def]
    for k in range(count):
        dx, dy = points[k, 0] - x, points[k, 1] - y
        if dx * dx + dy * dy > r2 * (1.0 + INSIDE):
            return False
    return True


@nb.njit(cache=True, nogil=True)
def circle_with_pivot(support, count, circle):  # type: ignore[no-untyped-def]
    """Find the smallest circle around `count` support points, the last of which lies on it.

    support : float64 (4, 2), the first `count` rows are in use, 2..4; reordered: the new support comes first. Taken
        relative to a point close by, so that coordinates are about as small as the circle.
    circle : float64 (3,), receives x, y and the squared radius
    Returns the new number of support points.
    """
    p = count - 1
    best = np.inf
    first, second = -1, -1
    px, py = support[p, 0], support[p, 1]
    # Two points, the segment between them a diameter.
    for i in range(p):
        x, y = 0.5 * (px + support[i, 0]), 0.5 * (py + support[i, 1])
        r2 = 0.25 * ((px - support[i, 0]) ** 2 + (py - support[i, 1]) ** 2)
        if r2 < best and _circle_holds(support, count, x, y, r2):
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
            x, y = (by * a2 - ay * b2) / cross, (ax * b2 - bx * a2) / cross
            r2 = x * x + y * y
            if r2 < best and _circle_holds(support, count, px + x, py + y, r2):
                best, first, second = r2, i, j
                circle[0], circle[1], circle[2] = px + x, py + y, r2
    if first < 0:
        return count - 1
    ax, ay = support[first, 0], support[first, 1]
    bx, by = support[second, 0], support[second, 1]
    support[0, 0], support[0, 1] = px, py
    support[1, 0], support[1, 1] = ax, ay
    support[2, 0], support[2, 1] = bx, by
    return 2 if second < 0 else 3


@nb.njit(cache=True, nogil=True)
def _cap_holds(vectors, count, x, y, z, cosine):  # type: ignore[no-untyped-def]
    for k in range(count):
        if vectors[k, 0] * x + vectors[k, 1] * y + vectors[k, 2] * z < cosine - CAP_INSIDE:
            return False
    return True


@nb.njit(cache=True, nogil=True)
def cap_with_pivot(support, count, cap):  # type: ignore[no-untyped-def]
    """Find the smallest cap around `count` unit vectors, the last of which lies on its rim.

    support : float64 (4, 3), the first `count` rows are in use, 2..4; reordered: the new support comes first
    cap : float64 (4,), receives the axis and the cosine of the half-angle
    Returns the new number of support vectors, or 0 where no cap below 90 degrees holds them.
    """
    p = count - 1
    best = 0.0
    first, second = -1, -1
    px, py, pz = support[p, 0], support[p, 1], support[p, 2]
    for i in range(p):
        x, y, z = px + support[i, 0], py + support[i, 1], pz + support[i, 2]
        norm = math.sqrt(x * x + y * y + z * z)
        if norm <= 1e-9:
            continue
        x, y, z = x / norm, y / norm, z / norm
        cosine = x * px + y * py + z * pz
        if cosine > best and _cap_holds(support, count, x, y, z, cosine):
            best, first, second = cosine, i, -1
            cap[0], cap[1], cap[2], cap[3] = x, y, z, cosine
    for i in range(p):
        for j in range(i + 1, p):
            ax, ay, az = support[i, 0] - px, support[i, 1] - py, support[i, 2] - pz
            bx, by, bz = support[j, 0] - px, support[j, 1] - py, support[j, 2] - pz
            x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
            norm = math.sqrt(x * x + y * y + z * z)
            if norm <= 1e-30:
                continue
            x, y, z = x / norm, y / norm, z / norm
            cosine = x * px + y * py + z * pz
            if cosine < 0.0:
                x, y, z, cosine = -x, -y, -z, -cosine
            if cosine > best and _cap_holds(support, count, x, y, z, cosine):
                best, first, second = cosine, i, j
                cap[0], cap[1], cap[2], cap[3] = x, y, z, cosine
    if first < 0:
        return 0
    ax, ay, az = support[first, 0], support[first, 1], support[first, 2]
    bx, by, bz = support[second, 0], support[second, 1], support[second, 2]
    support[0, 0], support[0, 1], support[0, 2] = px, py, pz
    support[1, 0], support[1, 1], support[1, 2] = ax, ay, az
    support[2, 0], support[2, 1], support[2, 2] = bx, by, bz
    return 2 if second < 0 else 3
