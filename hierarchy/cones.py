"""Optimal normal cones: the smallest cap of the unit sphere around all base normals below a node.

Based on: Barequet and Elber, "Optimal bounding cones of vectors in three dimensions", IPL 93(2), 2005; solved by
pivoting (enclosing.py) instead of in the stereographic plane.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from hierarchy.borrowing import BORROWING
from hierarchy.dealing import DEALT, block_count, nodes_of
from hierarchy.enclosing import INSIDE, MAX_PASSES, MAX_STALLS, RIGHT_ANGLE, cap_with_pivot
from hierarchy.extremes import NEVER_NAN, larger
from hierarchy.model import Float32Array, Float64Array, Int32Array

# cone_cos of a cone that contains everything (half-angle >= 90 degrees).
EVERYTHING = -1.0
# Vectors in a row that have a ball around them, and how many are looked at one by one sooner than their balls.
CHUNK, FEW = 32, 64


@nb.njit(**BORROWING, fastmath=NEVER_NAN)
def _largest(vectors, begin, count, x, y, z):  # type: ignore[no-untyped-def]
    """Return the largest squared distance of `count` vectors from an axis."""
    across, up, along = vectors[0, begin:], vectors[1, begin:], vectors[2, begin:]
    largest = 0.0
    for i in range(count):
        dx, dy, dz = across[i] - x, up[i] - y, along[i] - z
        largest = larger(largest, dx * dx + dy * dy + dz * dz)
    return largest


@nb.njit(**BORROWING, fastmath=NEVER_NAN)
def _which(vectors, begin, count, x, y, z, distance2):  # type: ignore[no-untyped-def]
    """Return which of `count` vectors is as far from an axis, as `_largest` finds it."""
    across, up, along = vectors[0, begin:], vectors[1, begin:], vectors[2, begin:]
    which = 0
    for i in range(count):
        dx, dy, dz = across[i] - x, up[i] - y, along[i] - z
        which = max(which, i if dx * dx + dy * dy + dz * dz >= distance2 else 0)
    return begin + which


@nb.njit(**BORROWING)
def _farthest(vectors, balls, begin, end, cap):  # type: ignore[no-untyped-def]
    """Return which of the vectors [begin, end) is the farthest from a cap's axis, and its squared distance.

    -1 and the cap's own where none is farther than that.
    """
    x, y, z, largest = cap[0], cap[1], cap[2], cap[3]
    first, count = -1, 0
    some = begin
    while some < end:
        stop = end
        if end - begin > FEW:
            # Whatever part of a chunk is meant lies in its ball.
            chunk = some // CHUNK
            stop = min((chunk + 1) * CHUNK, end)
            dx, dy, dz = balls[chunk, 0] - x, balls[chunk, 1] - y, balls[chunk, 2] - z
            reach = math.sqrt(dx * dx + dy * dy + dz * dz) + balls[chunk, 3]
            if reach * reach <= largest:
                some = stop
                continue
        distance2 = _largest(vectors, some, stop - some, x, y, z)
        if distance2 > largest:
            largest, first, count = distance2, some, stop - some
        some = stop
    if first < 0:
        return first, largest
    return _which(vectors, first, count, x, y, z, largest), largest


@nb.njit(**BORROWING)
def bounding_cap(vectors, balls, begin, end, cap, support):  # type: ignore[no-untyped-def]
    """Write axis and cosine of the smallest cap around the unit vectors [begin, end) to cap, float64 (4,).

    vectors : float64 (3, N), of which at least one is meant
    balls : as `balls_of_chunks` returns them
    support : float64 (4, 3), to work in

    The cosine is that of the vector measured to be farthest from the axis. It is EVERYTHING where no cap below 90
    degrees holds them; the axis is then the first vector.
    """
    for k in range(3):
        support[0, k] = cap[k] = vectors[k, begin]
    cap[3] = 0.0
    rows, stalls = 1, 0
    best, x, y, z = RIGHT_ANGLE, cap[0], cap[1], cap[2]
    for _ in range(MAX_PASSES):
        farthest, largest = _farthest(vectors, balls, begin, end, cap)
        # Any axis makes a cap with what is farthest from it: rounding in a step cannot lose more than the step.
        if largest < best:
            best, x, y, z = largest, cap[0], cap[1], cap[2]
        least = cap[3]
        if largest <= least * (1.0 + INSIDE) or stalls == MAX_STALLS:
            break
        for k in range(3):
            support[rows, k] = vectors[k, farthest]
        rows = cap_with_pivot(support, rows + 1, cap)
        if rows == 0:
            break
        stalls += cap[3] <= least
    if best < RIGHT_ANGLE:
        cap[0], cap[1], cap[2], cap[3] = x, y, z, 1.0 - 0.5 * best
    else:
        cap[0], cap[1], cap[2], cap[3] = vectors[0, begin], vectors[1, begin], vectors[2, begin], EVERYTHING


@nb.njit(cache=True, nogil=True, inline="always")
def widened_cosine(cosine):  # type: ignore[no-untyped-def]
    """Return the cosine to store as float32 beside a float32 axis.

    The stored axis leans by up to 1e-7; the cone opens by as much, so that no normal falls out. A cosine that rounding
    to float32 raises would close the cone, near 1 by 2.4e-4 radians: half a unit in the last place is taken off.
    """
    if cosine == EVERYTHING:
        return cosine
    return max(cosine - 4e-7 * math.sqrt(1.0 - cosine * cosine + 1e-13) - 3e-8, 0.0)


@nb.njit(cache=True, nogil=True, inline="always")
def sine_of(cosine):  # type: ignore[no-untyped-def]
    """Return the sine of a cone's half-angle, 0 where it is EVERYTHING."""
    return 0.0 if cosine == EVERYTHING else math.sqrt(max(1.0 - np.float64(cosine) ** 2, 0.0))


@nb.njit(cache=True, nogil=True, parallel=True)
def _normalise(normals, vectors):  # type: ignore[no-untyped-def]
    for i in nb.prange(len(normals)):
        x, y, z = np.float64(normals[i, 0]), np.float64(normals[i, 1]), np.float64(normals[i, 2])
        norm = math.sqrt(x * x + y * y + z * z)
        vectors[0, i], vectors[1, i], vectors[2, i] = x / norm, y / norm, z / norm


def unit_vectors(normals: Float32Array) -> Float64Array:
    """Normalise normals (N, 3) in float64: stored ones are off unit length by more than a narrow cosine off 1.

    Returns float64 (3, N): the farthest of some is found several at a time.
    """
    vectors = np.empty((3, len(normals)))
    _normalise(normals, vectors)
    return vectors


@nb.njit(cache=True, nogil=True, parallel=True)
def balls_of_chunks(vectors):  # type: ignore[no-untyped-def]
    """Return a ball around every CHUNK of unit vectors (3, N): centre and radius, float64 (-(-N // CHUNK), 4).

    A neighbourhood's normals have much in common: of most chunks the ball tells that none is the farthest.
    """
    count = vectors.shape[1]
    balls = np.empty((-(-count // CHUNK), 4), np.float64)
    for chunk in nb.prange(len(balls)):
        begin, end = chunk * CHUNK, min((chunk + 1) * CHUNK, count)
        for k in range(3):
            low = high = vectors[k, begin]
            for i in range(begin + 1, end):
                low, high = min(low, vectors[k, i]), max(high, vectors[k, i])
            balls[chunk, k] = 0.5 * (low + high)
        reach2 = 0.0
        for i in range(begin, end):
            d2 = 0.0
            for k in range(3):
                d2 += (vectors[k, i] - balls[chunk, k]) ** 2
            reach2 = max(reach2, d2)
        # Rounded up by more than distances are off by.
        balls[chunk, 3] = math.sqrt(reach2) * (1.0 + 1e-12) + 1e-15
    return balls


@nb.njit(cache=True, nogil=True, parallel=True)
def _cones(vectors, begin, end, axes, cosines):  # type: ignore[no-untyped-def]
    nodes = len(begin)
    balls = balls_of_chunks(vectors)
    for hand in nb.prange(len(DEALT)):
        support, cap = np.empty((4, 3)), np.empty(4)
        for block in range(DEALT[hand], block_count(nodes), len(DEALT)):
            for node in range(*nodes_of(block, nodes)):
                bounding_cap(vectors, balls, begin[node], end[node], cap, support)
                axes[node, 0], axes[node, 1], axes[node, 2] = cap[0], cap[1], cap[2]
                cosines[node] = widened_cosine(cap[3])


def normal_cones(normals: Float32Array, begin: Int32Array, end: Int32Array) -> tuple[Float32Array, Float32Array]:
    """Return the optimal cones of ranges of normals: axes float32 (M, 3) and cosines of half-angles float32 (M,).

    normals : float32 (N, 3), unit
    begin, end : int32 (M,), node i holds normals[begin[i]:end[i]], not empty
    A cosine of `EVERYTHING` says that the half-angle is 90 degrees or more.
    """
    axes, cosines = np.empty((len(begin), 3), np.float32), np.empty(len(begin), np.float32)
    _cones(unit_vectors(normals), begin, end, axes, cosines)
    return axes, cosines
