"""Optimal normal cones: the smallest cap of the unit sphere around all base normals below a node.

Based on: Barequet and Elber, "Optimal bounding cones of vectors in three dimensions", IPL 93(2), 2005; solved by
pivoting (enclosing.py) instead of in the stereographic plane.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from hierarchy.borrowing import BORROWING
from hierarchy.dealing import DEALT, block_count, most_leaves, nodes_of
from hierarchy.enclosing import INSIDE, MAX_PASSES, MAX_STALLS, RIGHT_ANGLE, cap_with_pivot
from hierarchy.model import Float32Array, Int32Array

# cone_cos of a cone that contains everything (half-angle >= 90 degrees).
EVERYTHING = -1.0


@nb.njit(**BORROWING)
def _farthest(vectors, count, x, y, z):  # type: ignore[no-untyped-def]
    """Return which of the first `count` unit vectors is the farthest from (x, y, z), and its squared distance."""
    largest, farthest = -1.0, 0
    for i in range(count):
        dx, dy, dz = vectors[i, 0] - x, vectors[i, 1] - y, vectors[i, 2] - z
        d2 = dx * dx + dy * dy + dz * dz
        if d2 > largest:
            largest, farthest = d2, i
    return farthest, largest


@nb.njit(**BORROWING)
def bounding_cap(vectors, count, cap, support):  # type: ignore[no-untyped-def]
    """Write axis and cosine of the smallest cap around unit vectors to cap, float64 (4,).

    vectors : float64 (N, 3), of which the first `count` >= 1 are meant; support : float64 (4, 3), to work in
    The cosine is that of the vector measured to be farthest from the axis. It is EVERYTHING where no cap below 90
    degrees holds them; the axis is then vectors[0].
    """
    for k in range(3):
        support[0, k] = cap[k] = vectors[0, k]
    cap[3] = 0.0
    rows, stalls = 1, 0
    best, x, y, z = RIGHT_ANGLE, cap[0], cap[1], cap[2]
    for _ in range(MAX_PASSES):
        farthest, largest = _farthest(vectors, count, cap[0], cap[1], cap[2])
        # Any axis makes a cap with what is farthest from it: rounding in a step cannot lose more than the step.
        if largest < best:
            best, x, y, z = largest, cap[0], cap[1], cap[2]
        least = cap[3]
        if largest <= least * (1.0 + INSIDE) or stalls == MAX_STALLS:
            break
        for k in range(3):
            support[rows, k] = vectors[farthest, k]
        rows = cap_with_pivot(support, rows + 1, cap)
        if rows == 0:
            break
        stalls += cap[3] <= least
    if best < RIGHT_ANGLE:
        cap[0], cap[1], cap[2], cap[3] = x, y, z, 1.0 - 0.5 * best
    else:
        cap[0], cap[1], cap[2], cap[3] = vectors[0, 0], vectors[0, 1], vectors[0, 2], EVERYTHING


@nb.njit(cache=True, nogil=True, inline="always")
def widened_cosine(cosine):  # type: ignore[no-untyped-def]
    """Return the cosine to store as float32 beside a float32 axis.

    The stored axis leans by up to 1e-7; the cone opens by as much, so that no normal falls out. A cosine that rounding
    to float32 raises would close the cone, near 1 by 2.4e-4 radians: half a unit in the last place is taken off.
    """
    if cosine == EVERYTHING:
        return cosine
    return max(cosine - 4e-7 * math.sqrt(1.0 - cosine * cosine + 1e-13) - 3e-8, 0.0)


@nb.njit(**BORROWING)
def _cone(normals, begin, end, vectors, support, cap):  # type: ignore[no-untyped-def]
    """Write the cap around the normals [begin, end) to cap; vectors : float64 (N, 3), to work in."""
    # Normalised in float64: the float32 ones are off unit length by more than a narrow cone's cosine is off 1.
    for leaf in range(begin, end):
        x, y, z = np.float64(normals[leaf, 0]), np.float64(normals[leaf, 1]), np.float64(normals[leaf, 2])
        norm = math.sqrt(x * x + y * y + z * z)
        i = leaf - begin
        vectors[i, 0], vectors[i, 1], vectors[i, 2] = x / norm, y / norm, z / norm
    bounding_cap(vectors, end - begin, cap, support)


@nb.njit(cache=True, nogil=True, parallel=True)
def _cones(normals, begin, end):  # type: ignore[no-untyped-def]
    nodes = len(begin)
    axes = np.empty((nodes, 3), np.float32)
    cosines = np.empty(nodes, np.float32)
    for hand in nb.prange(len(DEALT)):
        vectors = np.empty((most_leaves(hand, begin, end), 3))
        support, cap = np.empty((4, 3)), np.empty(4)
        for block in range(DEALT[hand], block_count(nodes), len(DEALT)):
            for node in range(*nodes_of(block, nodes)):
                _cone(normals, begin[node], end[node], vectors, support, cap)
                axes[node, 0], axes[node, 1], axes[node, 2] = cap[0], cap[1], cap[2]
                cosines[node] = widened_cosine(cap[3])
    return axes, cosines


def normal_cones(normals: Float32Array, begin: Int32Array, end: Int32Array) -> tuple[Float32Array, Float32Array]:
    """Return the optimal cones of ranges of normals: axes float32 (M, 3) and cosines of half-angles float32 (M,).

    normals : float32 (N, 3), unit
    begin, end : int32 (M,), node i holds normals[begin[i]:end[i]], not empty
    A cosine of `EVERYTHING` says that the half-angle is 90 degrees or more.
    """
    return _cones(normals, begin, end)  # type: ignore[no-any-return]
