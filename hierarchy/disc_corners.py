"""The corners of a node's leaves, in the frame of its disc."""

from __future__ import annotations

import numba as nb
import numpy as np

from hierarchy.borrowing import BORROWING
from hierarchy.extremes import NEVER_NAN, larger
from hierarchy.leaves import SURFEL_CORNERS, corner
from hierarchy.model import Int32Array, UInt8Array

# Triangles that are passed over together where none has a vertex from before.
CHUNK = 16
# Corners back from which on it is not known where a vertex was used last.
LONG_AGO = 255


@nb.njit(cache=True, nogil=True)
def _note_uses(corners, used, first, least, back):  # type: ignore[no-untyped-def]
    unused = 0
    for i in range(len(first) - 1):
        first[i] = unused
        for k in range(3 * i, 3 * i + 3):
            back[k] = min(k - used[corners[k]], LONG_AGO)
            used[corners[k]] = k
            least[i // CHUNK] = min(least[i // CHUNK], corners[k])
            unused = max(unused, corners[k] + 1)
    first[len(first) - 1] = unused


def vertex_uses(indices: Int32Array, vertices: int) -> tuple[Int32Array, Int32Array, Int32Array, UInt8Array]:
    """Tell where triangles' vertices are used, which are in the order of first use.

    indices : int32 (N, 3); vertices : how many there are
    Returns the vertices of all triangles in a row, int32 (3 N,); which one is the first that no triangle before each
    one, nor before the end, has, int32 (N + 1,); the least one of every CHUNK of triangles, int32 (-(-N // CHUNK),);
    and how many corners back every corner's was used last, LONG_AGO at most, uint8 (3 N,).
    """
    first, back = np.empty(len(indices) + 1, np.int32), np.empty(3 * len(indices), np.uint8)
    least = np.full(-(-len(indices) // CHUNK), vertices, np.int32)
    _note_uses(indices.ravel(), np.full(vertices, -LONG_AGO, np.int64), first, least, back)
    return indices.ravel(), first, least, back


@nb.njit(**BORROWING)
def _older_vertices(vertices, begin, end, low, older):  # type: ignore[no-untyped-def]
    """Write the vertices before `low` of the triangles [begin, end) to older, most but once; return how many.

    Those are on the border of the triangles' patch.
    """
    corners, _, least, back = vertices
    count = 0
    i = begin
    while i < end:
        stop = min((i // CHUNK + 1) * CHUNK, end)
        if least[i // CHUNK] < low:
            for k in range(3 * i, 3 * stop):
                # Not what the patch has used before. Without branches: none could be foreseen.
                older[count] = corners[k]
                count += (corners[k] < low) & (back[k] > min(k - 3 * begin, LONG_AGO - 1))
        i = stop
    return count


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
def corners_in_frame(shapes, vertices, begin, end, origin, frame, points, older):  # type: ignore[no-untyped-def]
    """Write every corner of the leaves [begin, end) to points, vertices of the triangles among them mostly but once.

    shapes : positions, indices, radii and normals of the leaves; vertices : as `vertex_uses` returns them
    origin : three floats; frame : nine, the disc's tangents and its normal
    points : float64 (3, >= P), receives u, v and h in the disc's frame
    older : int32 (> P,), to work in
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
    low, high = vertices[1][begin], vertices[1][end]
    _project(positions, low, high, origin, frame, points)
    count = high - low
    if low == 0:
        return count
    found = _older_vertices(vertices, begin, end, low, older)
    for k in range(found):
        vertex = older[k]
        x, y, z = positions[vertex, 0] - ox, positions[vertex, 1] - oy, positions[vertex, 2] - oz
        points[0, count + k] = x * ux + y * uy + z * uz
        points[1, count + k] = x * vx + y * vy + z * vz
        points[2, count + k] = x * nx + y * ny + z * nz
    return count + found


@nb.njit(**BORROWING, fastmath=NEVER_NAN)
def reaches(points, count, u, v, h):  # type: ignore[no-untyped-def]
    """Return the largest squared distances of the first `count` of points (3, P) from (u, v), and from (u, v, h)."""
    flat = solid = 0.0
    for k in range(count):
        du, dv, dh = points[0, k] - u, points[1, k] - v, points[2, k] - h
        d2 = du * du + dv * dv
        flat = larger(flat, d2)
        solid = larger(solid, d2 + dh * dh)
    return flat, solid
