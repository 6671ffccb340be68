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
def enclosing_circle(points, circle):  # type: ignore[no-untyped-def]
    """Write x, y and squared radius of the smallest circle around float64 points (N, 2), N >= 1, to circle."""
    # Relative to the first point: points that are nearly identical then keep their digits.
    ox, oy = points[0, 0], points[0, 1]
    support = np.zeros((4, 2), np.float64)
    circle[:] = 0.0
    count, stalls = 1, 0
    best, x, y = np.inf, 0.0, 0.0
    for _ in range(MAX_PASSES):
        farthest, largest = 0, -1.0
        for i in range(len(points)):
            dx, dy = points[i, 0] - ox - circle[0], points[i, 1] - oy - circle[1]
            d2 = dx * dx + dy * dy
            if d2 > largest:
                largest, farthest = d2, i
        # The measured maximum, not the support's: nothing may stick out by rounding.
        if largest < best:
            best, x, y = largest, circle[0], circle[1]
        least = circle[2]
        if largest <= least * (1.0 + INSIDE) or stalls == MAX_STALLS:
            break
        support[count, 0], support[count, 1] = points[farthest, 0] - ox, points[farthest, 1] - oy
        count = circle_with_pivot(support, count + 1, circle)
        stalls += circle[2] <= least
    circle[0], circle[1], circle[2] = x + ox, y + oy, best


@nb.njit(cache=True, nogil=True, parallel=True)
def _discs(positions, indices, radii, normals, centres, areas, begin, end, axes):  # type: ignore[no-untyped-def]
    nodes = len(begin)
    corners = 3 if len(indices) > 0 else SURFEL_CORNERS
    out_centre = np.empty((nodes, 3), np.float32)
    out_normal = np.empty((nodes, 3), np.float32)
    out_size = np.empty((nodes, 3), np.float32)
    out_box = np.empty((nodes, 4), np.float32)
    for node in nb.prange(nodes):
        first, last = begin[node], end[node]
        n = np.empty(3, np.float32)
        _mean_normal(normals, areas, first, last, axes[node], n)
        nx, ny, nz = np.float64(n[0]), np.float64(n[1]), np.float64(n[2])
        ux, uy, uz, vx, vy, vz = tangents(nx, ny, nz)

        # Project every corner onto the disc's plane, relative to the first leaf's centre.
        ox, oy, oz = np.float64(centres[first, 0]), np.float64(centres[first, 1]), np.float64(centres[first, 2])
        points = np.empty((corners * (last - first), 2), np.float64)
        low, high, mean, total = np.inf, -np.inf, 0.0, 0.0
        k = 0
        for i in range(first, last):
            for j in range(corners):
                x, y, z = corner(positions, indices, radii, normals, i, j)
                x, y, z = x - ox, y - oy, z - oz
                points[k, 0] = x * ux + y * uy + z * uz
                points[k, 1] = x * vx + y * vy + z * vz
                h = x * nx + y * ny + z * nz
                low, high = min(low, h), max(high, h)
                k += 1
            weight = np.float64(areas[i])
            x, y, z = centres[i, 0] - ox, centres[i, 1] - oy, centres[i, 2] - oz
            mean += weight * (x * nx + y * ny + z * nz)
            total += weight
        mean = mean / total if total > 0.0 else 0.5 * (low + high)
        circle = np.empty(3, np.float64)
        enclosing_circle(points, circle)

        out_centre[node, 0] = ox + circle[0] * ux + circle[1] * vx + mean * nx
        out_centre[node, 1] = oy + circle[0] * uy + circle[1] * vy + mean * ny
        out_centre[node, 2] = oz + circle[0] * uz + circle[1] * vz + mean * nz
        out_normal[node, 0], out_normal[node, 1], out_normal[node, 2] = nx, ny, nz
        # Storing has rounded the centre: measure from there, so that nothing sticks out by rounding.
        cx, cy, cz = np.float64(out_centre[node, 0]), np.float64(out_centre[node, 1]), np.float64(out_centre[node, 2])
        x, y, z = cx - ox, cy - oy, cz - oz
        u, v, mean = x * ux + y * uy + z * uz, x * vx + y * vy + z * vz, x * nx + y * ny + z * nz
        radius2 = sphere2 = 0.0
        for k in range(len(points)):
            radius2 = max(radius2, (points[k, 0] - u) ** 2 + (points[k, 1] - v) ** 2)
        for i in range(first, last):
            for j in range(corners):
                x, y, z = corner(positions, indices, radii, normals, i, j)
                sphere2 = max(sphere2, (x - cx) ** 2 + (y - cy) ** 2 + (z - cz) ** 2)
        out_size[node, 0] = math.sqrt(radius2) * ROUNDED_UP
        out_size[node, 1] = max(high - mean, mean - low) * ROUNDED_UP
        # The sphere holds the disc too: it stands for both in every culling test.
        out_size[node, 2] = math.sqrt(max(sphere2, radius2)) * ROUNDED_UP
        tight_box(points, u, v, np.float64(out_size[node, 0]), out_box[node])
    return out_centre, out_normal, out_size, out_box


def node_discs(
    shapes: LeafShapes, begin: Int32Array, end: Int32Array, axes: Float32Array
) -> tuple[Float32Array, Float32Array, Float32Array, Float32Array]:
    """Fit a disc to every range of leaves.

    begin, end : int32 (M,), node i holds the leaves [begin[i], end[i])
    axes : float32 (M, 3), axes of the normal cones, used where the mean normal vanishes
    Returns centres float32 (M, 3), unit normals float32 (M, 3), sizes float32 (M, 3): disc radius, thickness
    (largest distance of a primitive from the disc's plane) and radius of the sphere, centred on the disc, around
    everything below the node; and boxes float32 (M, 4), as in `tight_box`.
    """
    s = shapes
    return _discs(s.positions, s.indices, s.radii, s.normals, s.centres, s.areas, begin, end, axes)  # type: ignore[no-any-return]
