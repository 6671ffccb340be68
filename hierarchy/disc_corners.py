"""The corners of a node's leaves, in the frame of its disc."""

from __future__ import annotations

import numba as nb
import numpy as np

from hierarchy.borrowing import BORROWING
from hierarchy.leaves import SURFEL_CORNERS, corner

# Largest and least of finite numbers may be found in any order, several at a time.
BOUNDS = {"nnan", "nsz", "reassoc", "contract"}


@nb.njit(cache=True, nogil=True)
def first_vertices(indices):  # type: ignore[no-untyped-def]
    """Return which vertex is the first that no triangle before each of `indices` (N, 3), nor before the end, has."""
    first = np.empty(len(indices) + 1, np.int32)
    unused = 0
    for i in range(len(indices)):
        first[i] = unused
        unused = max(unused, indices[i, 0] + 1, indices[i, 1] + 1, indices[i, 2] + 1)
    first[len(indices)] = unused
    return first


@nb.njit(**BORROWING)
def _project(positions, low, high, origin, frame, points):  # type: ignore[no-untyped-def]
    """Write u, v and h of the vertices [low, high) to the first columns of points."""
    ox, oy, oz = origin
    ux, uy, uz, vx, vy, vz, nx, ny, nz = frame
    u, v, h = points[0], points[1], points[2]
    for k in range(high - low):
        x, y, z = positions[low + k, 0] - ox, positions[low + k, 1] - oy, positions[low + k, 2] - oz
        u[k] = x * ux + y * uy + z * uz
        v[k] = x * vx + y * vy + z * vz
        h[k] = x * nx + y * ny + z * nz


@nb.njit(**BORROWING)
def corners_in_frame(shapes, first, begin, end, origin, frame, points):  # type: ignore[no-untyped-def]
    """Write every corner of the leaves [begin, end) to points, vertices of the triangles among them mostly but once.

    shapes : positions, indices, radii and normals of the leaves; first : as `first_vertices` returns it
    origin : three floats; frame : nine, the disc's tangents and its normal
    points : float64 (3, >= P), receives u, v and h in the disc's frame
    Returns the number P of corners.
    """
    positions, indices, radii, normals = shapes
    ox, oy, oz = origin
    ux, uy, uz, vx, vy, vz, nx, ny, nz = frame
    count = 0
    if len(indices) == 0:
        for i in range(begin, end):
            for j in range(SURFEL_CORNERS):
                x, y, z = corner(positions, indices, radii, normals, i, j)
                x, y, z = x - ox, y - oy, z - oz
                points[0, count] = x * ux + y * uy + z * uz
                points[1, count] = x * vx + y * vy + z * vz
                points[2, count] = x * nx + y * ny + z * nz
                count += 1
        return count
    # Vertices are in the order in which the triangles first use them: most come in one piece.
    low, high = first[begin], first[end]
    _project(positions, low, high, origin, frame, points)
    count = high - low
    if low == 0:
        return count
    for i in range(begin, end):
        for j in range(3):
            vertex = indices[i, j]
            if vertex < low:
                x, y, z = positions[vertex, 0] - ox, positions[vertex, 1] - oy, positions[vertex, 2] - oz
                points[0, count] = x * ux + y * uy + z * uz
                points[1, count] = x * vx + y * vy + z * vz
                points[2, count] = x * nx + y * ny + z * nz
                count += 1
    return count


@nb.njit(**BORROWING, fastmath=BOUNDS)
def low_and_high(values, count):  # type: ignore[no-untyped-def]
    """Return the least and the largest of the first `count` values."""
    low = high = values[0]
    for i in range(count):
        low, high = min(low, values[i]), max(high, values[i])
    return low, high


@nb.njit(**BORROWING, fastmath=BOUNDS)
def reaches(points, count, u, v, h):  # type: ignore[no-untyped-def]
    """Return the largest squared distances of the first `count` of points (3, P) from (u, v), and from (u, v, h)."""
    flat = solid = 0.0
    for k in range(count):
        du, dv, dh = points[0, k] - u, points[1, k] - v, points[2, k] - h
        d2 = du * du + dv * dv
        flat = max(flat, d2)
        solid = max(solid, d2 + dh * dh)
    return flat, solid
