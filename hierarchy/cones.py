"""Optimal normal cones: the smallest cap of the unit sphere around all base normals below a node.

Based on: Barequet and Elber, "Optimal bounding cones of vectors in three dimensions", IPL 93(2), 2005; solved by
pivoting (enclosing.py) instead of in the stereographic plane.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from hierarchy.enclosing import INSIDE, MAX_PASSES, MAX_STALLS, RIGHT_ANGLE, cap_with_pivot
from hierarchy.model import Float32Array, Int32Array

# cone_cos of a cone that contains everything (half-angle >= 90 degrees).
EVERYTHING = -1.0


@nb.njit(cache=True, nogil=True)
def bounding_cap(vectors, cap):  # type: ignore[no-untyped-def]
    """Write axis and cosine of the smallest cap around unit vectors, float64 (N, 3), to cap, float64 (4,).

    The cosine is that of the vector measured to be farthest from the axis. It is EVERYTHING where no cap below 90
    degrees holds them; the axis is then vectors[0].
    """
    support = np.empty((4, 3), np.float64)
    support[0] = cap[:3] = vectors[0]
    cap[3] = 0.0
    count, stalls = 1, 0
    best, x, y, z = RIGHT_ANGLE, cap[0], cap[1], cap[2]
    for _ in range(MAX_PASSES):
        largest, farthest = -1.0, 0
        for i in range(len(vectors)):
            dx, dy, dz = vectors[i, 0] - cap[0], vectors[i, 1] - cap[1], vectors[i, 2] - cap[2]
            d2 = dx * dx + dy * dy + dz * dz
            if d2 > largest:
                largest, farthest = d2, i
        # Any axis makes a cap with what is farthest from it: rounding in a step cannot lose more than the step.
        if largest < best:
            best, x, y, z = largest, cap[0], cap[1], cap[2]
        least = cap[3]
        if largest <= least * (1.0 + INSIDE) or stalls == MAX_STALLS:
            break
        support[count] = vectors[farthest]
        count = cap_with_pivot(support, count + 1, cap)
        if count == 0:
            break
        stalls += cap[3] <= least
    if best < RIGHT_ANGLE:
        cap[0], cap[1], cap[2], cap[3] = x, y, z, 1.0 - 0.5 * best
    else:
        cap[:3] = vectors[0]
        cap[3] = EVERYTHING


@nb.njit(cache=True, nogil=True, inline="always")
def widened_cosine(cosine):  # type: ignore[no-untyped-def]
    """Return the cosine to store as float32 beside a float32 axis.

    The stored axis leans by up to 1e-7; the cone opens by as much, so that no normal falls out. A cosine that rounding
    to float32 raises would close the cone, near 1 by 2.4e-4 radians: half a unit in the last place is taken off.
    """
    if cosine == EVERYTHING:
        return cosine
    return max(cosine - 4e-7 * math.sqrt(1.0 - cosine * cosine + 1e-13) - 3e-8, 0.0)


@nb.njit(cache=True, nogil=True, parallel=True)
def _cones(normals, begin, end):  # type: ignore[no-untyped-def]
    count = len(begin)
    axes = np.empty((count, 3), np.float32)
    cosines = np.empty(count, np.float32)
    for node in nb.prange(count):
        # Normalised in float64: the float32 ones are off unit length by more than a narrow cone's cosine is off 1.
        vectors = np.empty((end[node] - begin[node], 3), np.float64)
        for i in range(len(vectors)):
            leaf = begin[node] + i
            x, y, z = np.float64(normals[leaf, 0]), np.float64(normals[leaf, 1]), np.float64(normals[leaf, 2])
            norm = math.sqrt(x * x + y * y + z * z)
            vectors[i, 0], vectors[i, 1], vectors[i, 2] = x / norm, y / norm, z / norm
        cap = np.empty(4, np.float64)
        bounding_cap(vectors, cap)
        for axis in range(3):
            axes[node, axis] = cap[axis]
        cosines[node] = widened_cosine(cap[3])
    return axes, cosines


def normal_cones(normals: Float32Array, begin: Int32Array, end: Int32Array) -> tuple[Float32Array, Float32Array]:
    """Return the optimal cones of ranges of normals: axes float32 (M, 3) and cosines of half-angles float32 (M,).

    normals : float32 (N, 3), unit
    begin, end : int32 (M,), node i holds normals[begin[i]:end[i]], not empty
    A cosine of `EVERYTHING` says that the half-angle is 90 degrees or more.
    """
    return _cones(normals, begin, end)  # type: ignore[no-any-return]
