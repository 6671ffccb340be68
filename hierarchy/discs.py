"""The disc of every node: the smallest one that covers its base primitives, projected along its normal.

It covers the base primitives and not the children's discs: that would compound their slack level by level.
The plane has the area-weighted mean normal and the mean height of the primitives below it, so that the disc errs to
both sides of the surface by about the same (cf. Botsch 2004, fig. 3).
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from hierarchy.boxes import tight_box
from hierarchy.enclosing import INSIDE, MAX_PASSES, MAX_STALLS, circle_with_pivot
from hierarchy.frames import tangents
from hierarchy.leaves import SURFEL_CORNERS, LeafShapes, corner
from hierarchy.model import Float32Array, Int32Array

# Below this share of the summed areas the mean normal is noise (the sides of a thin sheet cancel).
MEAN_NORMAL_MIN = 0.3
# Radii are stored as float32 and read beside tangents of float32 normals: more than both are off by.
ROUNDED_UP = 1.0 + 1e-6
# Points from which on a circle around nine of them is worth finding first.
MANY = 48
# Nodes that a thread fits at once, and hands that blocks of them are dealt to.
BLOCK, HANDS = 256, 16
# Largest and least of finite numbers may be found in any order, several at a time.
BOUNDS = {"nnan", "nsz", "reassoc", "contract"}


@nb.njit(cache=True, nogil=True)
def _mean_normal(normals, areas, begin, end, axis, out):  # type: ignore[no-untyped-def]
    """Write the area-weighted mean normal to out, or the cone's axis where the mean vanishes."""
    x = y = z = total = 0.0
    for i in range(begin, end):
        a = np.float64(areas[i])
        x += a * normals[i, 0]
        y += a * normals[i, 1]
        z += a * normals[i, 2]
        total += a
    norm = math.sqrt(x * x + y * y + z * z)
    if norm <= MEAN_NORMAL_MIN * total:
        x, y, z = np.float64(axis[0]), np.float64(axis[1]), np.float64(axis[2])
        norm = math.sqrt(x * x + y * y + z * z)
    out[0], out[1], out[2] = x / norm, y / norm, z / norm


@nb.njit(cache=True, nogil=True)
def _grow_circle(points, circle, support, count):  # type: ignore[no-untyped-def]
    """Grow a circle around some points until it is the smallest one around all of float64 points (2, N).

    circle : x, y and squared radius, relative to the first point
    support : float64 (4, 2), of which the first `count` rows span the circle, relative to the first point, too
    Returns the new number of rows.
    """
    # Points that are nearly identical keep their digits where they are relative to one of them.
    ox, oy = points[0, 0], points[1, 0]
    stalls = 0
    best, x, y = np.inf, 0.0, 0.0
    for _ in range(MAX_PASSES):
        farthest, largest = 0, -1.0
        for i in range(points.shape[1]):
            dx, dy = points[0, i] - ox - circle[0], points[1, i] - oy - circle[1]
            d2 = dx * dx + dy * dy
            if d2 > largest:
                largest, farthest = d2, i
        # The measured maximum, not the support's: nothing may stick out by rounding.
        if largest < best:
            best, x, y = largest, circle[0], circle[1]
        least = circle[2]
        if largest <= least * (1.0 + INSIDE) or stalls == MAX_STALLS:
            break
        support[count, 0], support[count, 1] = points[0, farthest] - ox, points[1, farthest] - oy
        count = circle_with_pivot(support, count + 1, circle)
        stalls += circle[2] <= least
    circle[0], circle[1], circle[2] = x, y, best
    return count


@nb.njit(cache=True, nogil=True)
def _extremes(points):  # type: ignore[no-untyped-def]
    """Return the first of points (2, N) and the eight farthest along the axes and the diagonals, float64 (2, 9)."""
    found = np.zeros(9, np.int64)
    most = np.full(9, -np.inf)
    for i in range(points.shape[1]):
        u, v = points[0, i], points[1, i]
        if u > most[1]:
            most[1], found[1] = u, i
        if -u > most[2]:
            most[2], found[2] = -u, i
        if v > most[3]:
            most[3], found[3] = v, i
        if -v > most[4]:
            most[4], found[4] = -v, i
        if u + v > most[5]:
            most[5], found[5] = u + v, i
        if -u - v > most[6]:
            most[6], found[6] = -u - v, i
        if u - v > most[7]:
            most[7], found[7] = u - v, i
        if v - u > most[8]:
            most[8], found[8] = v - u, i
    return points[:, found]


@nb.njit(cache=True, nogil=True)
def enclosing_circle(points, circle):  # type: ignore[no-untyped-def]
    """Write x, y and squared radius of the smallest circle around float64 points (2, N), N >= 1, to circle."""
    support = np.zeros((4, 2), np.float64)
    circle[:] = 0.0
    count = 1
    if points.shape[1] >= MANY:
        # It is hardly larger than that around a few, which takes no passes over all.
        count = _grow_circle(_extremes(points), circle, support, count)
    _grow_circle(points, circle, support, count)
    circle[0] += points[0, 0]
    circle[1] += points[1, 0]


@nb.njit(cache=True, nogil=True)
def _first_vertices(indices):  # type: ignore[no-untyped-def]
    """Return which vertex is the first that no triangle before each of `indices` (N, 3), nor before the end, has."""
    first = np.empty(len(indices) + 1, np.int32)
    unused = 0
    for i in range(len(indices)):
        first[i] = unused
        for k in range(3):
            unused = max(unused, indices[i, k] + 1)
    first[len(indices)] = unused
    return first


@nb.njit(cache=True, nogil=True)
def _corners(shapes, first_vertices, begin, end, origin, frame):  # type: ignore[no-untyped-def]
    """Return every corner of the leaves [begin, end), vertices of the triangles among them mostly but once.

    origin : float64 (3,); frame : float64 (3, 3), the disc's tangents and normal in rows
    Returns float64 (3, P), u, v and h in the disc's frame.
    """
    positions, indices, radii, normals = shapes
    if len(indices) == 0:
        points = np.empty((3, SURFEL_CORNERS * (end - begin)), np.float64)
        k = 0
        for i in range(begin, end):
            for j in range(SURFEL_CORNERS):
                x, y, z = corner(positions, indices, radii, normals, i, j)
                x, y, z = x - origin[0], y - origin[1], z - origin[2]
                for row in range(3):
                    points[row, k] = x * frame[row, 0] + y * frame[row, 1] + z * frame[row, 2]
                k += 1
        return points
    # Vertices are in the order in which the triangles first use them: most come in one piece.
    low, high = first_vertices[begin], first_vertices[end]
    others = 0
    for i in range(begin, end):
        for j in range(3):
            others += indices[i, j] < low
    points = np.empty((3, high - low + others), np.float64)
    for v in range(low, high):
        x, y, z = positions[v, 0] - origin[0], positions[v, 1] - origin[1], positions[v, 2] - origin[2]
        for row in range(3):
            points[row, v - low] = x * frame[row, 0] + y * frame[row, 1] + z * frame[row, 2]
    if others == 0:
        return points
    k = high - low
    for i in range(begin, end):
        for j in range(3):
            v = indices[i, j]
            if v < low:
                x, y, z = positions[v, 0] - origin[0], positions[v, 1] - origin[1], positions[v, 2] - origin[2]
                for row in range(3):
                    points[row, k] = x * frame[row, 0] + y * frame[row, 1] + z * frame[row, 2]
                k += 1
    return points


@nb.njit(cache=True, nogil=True, fastmath=BOUNDS)
def _low_and_high(values):  # type: ignore[no-untyped-def]
    low = high = values[0]
    for i in range(len(values)):
        low, high = min(low, values[i]), max(high, values[i])
    return low, high


@nb.njit(cache=True, nogil=True, fastmath=BOUNDS)
def _reaches(points, u, v, h):  # type: ignore[no-untyped-def]
    """Return the largest squared distances of points (3, P) from (u, v), and from (u, v, h)."""
    flat = solid = 0.0
    for k in range(points.shape[1]):
        du, dv, dh = points[0, k] - u, points[1, k] - v, points[2, k] - h
        d2 = du * du + dv * dv
        flat = max(flat, d2)
        solid = max(solid, d2 + dh * dh)
    return flat, solid


@nb.njit(cache=True, nogil=True)
def _disc(shapes, first_vertices, centres, areas, begin, end, axis, centre, normal, size, box):  # type: ignore[no-untyped-def]
    """Fit a disc to the leaves [begin, end), and write it to centre, normal, size and box, rows of the results."""
    normals = shapes[3]
    _mean_normal(normals, areas, begin, end, axis, normal)
    nx, ny, nz = np.float64(normal[0]), np.float64(normal[1]), np.float64(normal[2])
    frame = np.empty((3, 3), np.float64)
    frame[0, 0], frame[0, 1], frame[0, 2], frame[1, 0], frame[1, 1], frame[1, 2] = tangents(nx, ny, nz)
    frame[2, 0], frame[2, 1], frame[2, 2] = nx, ny, nz
    # Everything relative to the first leaf's centre.
    origin = centres[begin].astype(np.float64)
    points = _corners(shapes, first_vertices, begin, end, origin, frame)
    low, high = _low_and_high(points[2])
    mean = total = 0.0
    for i in range(begin, end):
        weight = areas[i]
        x, y, z = centres[i, 0] - origin[0], centres[i, 1] - origin[1], centres[i, 2] - origin[2]
        mean += weight * (x * nx + y * ny + z * nz)
        total += weight
    mean = mean / total if total > 0.0 else 0.5 * (low + high)
    circle = np.empty(3, np.float64)
    enclosing_circle(points[:2], circle)
    for k in range(3):
        centre[k] = origin[k] + circle[0] * frame[0, k] + circle[1] * frame[1, k] + mean * frame[2, k]
    # Storing has rounded the centre: measure from there, so that nothing sticks out by rounding.
    x, y, z = np.float64(centre[0]) - origin[0], np.float64(centre[1]) - origin[1], np.float64(centre[2]) - origin[2]
    for k in range(3):
        circle[k] = x * frame[k, 0] + y * frame[k, 1] + z * frame[k, 2]
    flat, solid = _reaches(points, circle[0], circle[1], circle[2])
    size[0] = math.sqrt(flat) * ROUNDED_UP
    size[1] = max(high - circle[2], circle[2] - low) * ROUNDED_UP
    # The sphere holds the disc too: it stands for both in every culling test.
    size[2] = math.sqrt(max(solid, flat)) * ROUNDED_UP
    tight_box(points, circle[0], circle[1], np.float64(size[0]), box)


@nb.njit(cache=True, nogil=True, parallel=True)
def _discs(shapes, first_vertices, centres, areas, begin, end, axes):  # type: ignore[no-untyped-def]
    nodes = len(begin)
    out_centre = np.empty((nodes, 3), np.float32)
    out_normal = np.empty((nodes, 3), np.float32)
    out_size = np.empty((nodes, 3), np.float32)
    out_box = np.empty((nodes, 4), np.float32)
    # The first nodes are the largest: dealt out in turn, so that no thread gets all of them.
    blocks = -(-nodes // BLOCK)
    hand = -(-blocks // HANDS)
    for i in nb.prange(hand * HANDS):
        first = (i % hand * HANDS + i // hand) * BLOCK
        for node in range(first, min(first + BLOCK, nodes)):
            _disc(
                shapes, first_vertices, centres, areas, begin[node], end[node], axes[node],
                out_centre[node], out_normal[node], out_size[node], out_box[node],
            )  # fmt: skip
    return out_centre, out_normal, out_size, out_box


def node_discs(
    shapes: LeafShapes, begin: Int32Array, end: Int32Array, axes: Float32Array
) -> tuple[Float32Array, Float32Array, Float32Array, Float32Array]:
    """Fit a disc to every range of leaves.

    shapes : where they are triangles their vertices are in the order of first use
    begin, end : int32 (M,), node i holds the leaves [begin[i], end[i])
    axes : float32 (M, 3), axes of the normal cones, used where the mean normal vanishes
    Returns centres float32 (M, 3), unit normals float32 (M, 3), sizes float32 (M, 3): disc radius, thickness
    (largest distance of a primitive from the disc's plane) and radius of the sphere, centred on the disc, around
    everything below the node; and boxes float32 (M, 4), as in `tight_box`.
    """
    s = shapes
    arrays = (s.positions, s.indices, s.radii, s.normals)
    return _discs(arrays, _first_vertices(s.indices), s.centres, s.areas, begin, end, axes)  # type: ignore[no-any-return]
