"""Disc radii for points, from how far apart they are.

The rule: a point's disc reaches the farthest corner of its Voronoi cell among its neighbours, in its tangent plane.
Wherever the surface is nearer to this point than to any other, this disc covers it; so all discs together leave no
hole, however unevenly the points lie, and no disc is larger than that takes.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from hierarchy.model import Float32Array, Float64Array, Int32Array

# Discs are flat and the surface is not, and estimated normals lean: a little more than the exact reach.
MARGIN = 1.1

# The neighbour whose distance stands for the local spacing: on a regular grid the sixth is the first diagonal one.
SPACING_NEIGHBOUR = 6

# Corners farther out than this many times the median spacing of the neighbours belong to a gap of the cloud, not to its
# surface.
LARGEST_IN_SPACINGS = 1.5

# At a border, or on a line, a cell may have no corner; the disc then still reaches half way to this neighbour, or half
# the spacing of the points next to it, so that a lonely point gets a disc like theirs.
NEAR_NEIGHBOUR = 3


def cover_radii(
    positions: Float32Array, normals: Float32Array, distances: Float32Array, neighbours: Int32Array
) -> Float32Array:
    """Return radii, float32 (N,), positive, such that discs across the normals cover the sampled surface.

    positions, normals : float32 (N, 3)
    distances, neighbours : (N, k), of the nearest others, nearest first
    A cloud of one point gets a radius of 1.
    """
    if neighbours.shape[1] == 0:
        return np.ones(len(positions), np.float32)
    spacing = distances[:, min(SPACING_NEIGHBOUR, distances.shape[1]) - 1]
    around = np.median(spacing[neighbours], axis=1).astype(np.float64)
    largest = LARGEST_IN_SPACINGS * around
    near = 0.5 * distances[:, min(NEAR_NEIGHBOUR, distances.shape[1]) - 1].astype(np.float64)
    reach = _cell_reach(positions, normals, neighbours, largest)
    radii = MARGIN * np.maximum(reach, np.minimum(near, 0.5 * around))
    return np.asarray(np.maximum(radii, np.finfo(np.float32).tiny), np.float32)


@njit(cache=True, nogil=True)
def _cut_cell(cell: Float64Array, corners: int, x: float, y: float, cut: Float64Array) -> int:
    """Keep the part of a convex cell that is nearer to the origin than to (x, y); return its number of corners.

    cell : (M, 3), corners around the cell, and 1 where the side that follows belongs to the frame
    cut : (M, 3), room to work in
    """
    limit = 0.5 * (x * x + y * y)
    kept = 0
    for a in range(corners):
        b = a + 1 if a + 1 < corners else 0
        side_a = cell[a, 0] * x + cell[a, 1] * y - limit
        side_b = cell[b, 0] * x + cell[b, 1] * y - limit
        if side_a <= 0.0:
            cut[kept, 0], cut[kept, 1] = cell[a, 0], cell[a, 1]
            # From a corner on the line outwards, the line itself is the next side.
            cut[kept, 2] = 0.0 if side_a == 0.0 and side_b > 0.0 else cell[a, 2]
            kept += 1
        if (side_a < 0.0 and side_b > 0.0) or (side_b < 0.0 and side_a > 0.0):
            t = side_a / (side_a - side_b)
            cut[kept, 0] = cell[a, 0] + t * (cell[b, 0] - cell[a, 0])
            cut[kept, 1] = cell[a, 1] + t * (cell[b, 1] - cell[a, 1])
            cut[kept, 2] = 0.0 if side_a < 0.0 else cell[a, 2]
            kept += 1
    for a in range(kept):
        cell[a, 0], cell[a, 1], cell[a, 2] = cut[a, 0], cut[a, 1], cut[a, 2]
    return kept


@njit(cache=True, nogil=True)
def _is_surrounded(x: float, y: float, points: Float64Array, count: int) -> bool:
    """Tell whether (x, y) lies inside the convex hull of the origin and the first `count` points."""
    # Seen from there, the directions to the points spread over more than half a turn around that to the origin.
    lowest, highest = 0.0, 0.0
    for j in range(count):
        px, py = points[j, 0] - x, points[j, 1] - y
        angle = math.atan2(py * -x - px * -y, px * -x + py * -y)
        lowest, highest = min(lowest, angle), max(highest, angle)
    return highest - lowest > math.pi


@njit(cache=True, nogil=True, parallel=True)
def _cell_reach(
    positions: Float32Array, normals: Float32Array, neighbours: Int32Array, largest: Float64Array
) -> Float64Array:
    """Return the distance of the farthest corner of each point's cell that is not farther than `largest`, (N,)."""
    n, k = neighbours.shape
    reach = np.zeros(n)
    for i in prange(n):
        nx, ny, nz = np.float64(normals[i, 0]), np.float64(normals[i, 1]), np.float64(normals[i, 2])
        # Two tangents (Duff et al., Building an Orthonormal Basis, Revisited, 2017).
        sign = math.copysign(1.0, nz)
        f = -1.0 / (sign + nz)
        g = nx * ny * f
        ux, uy, uz = 1.0 + sign * nx * nx * f, sign * g, -sign * nx
        vx, vy, vz = g, sign + ny * ny * f, -ny

        # Cut a frame, in units of the largest disc, at the middle to each neighbour on the same side of the surface.
        cell = np.zeros((k + 5, 3))
        cut = np.zeros((k + 5, 3))
        for c in range(4):
            cell[c, 0], cell[c, 1], cell[c, 2] = -2.0 if c in (0, 3) else 2.0, -2.0 if c < 2 else 2.0, 1.0
        corners = 4
        flat = np.empty((k, 2))
        used = 0
        for j in range(k):
            other = neighbours[i, j]
            if normals[other, 0] * nx + normals[other, 1] * ny + normals[other, 2] * nz <= 0.0:
                continue
            dx = (np.float64(positions[other, 0]) - np.float64(positions[i, 0])) / largest[i]
            dy = (np.float64(positions[other, 1]) - np.float64(positions[i, 1])) / largest[i]
            dz = (np.float64(positions[other, 2]) - np.float64(positions[i, 2])) / largest[i]
            x, y = dx * ux + dy * uy + dz * uz, dx * vx + dy * vy + dz * vz
            # A neighbour straight above or below says nothing about the spacing.
            if x * x + y * y > 0.01 * (dx * dx + dy * dy + dz * dz):
                corners = _cut_cell(cell, corners, x, y, cut)
                flat[used, 0], flat[used, 1] = x, y
                used += 1
        for c in range(corners):
            distance = math.sqrt(cell[c, 0] * cell[c, 0] + cell[c, 1] * cell[c, 1])
            before = c - 1 if c > 0 else corners - 1
            is_framed = cell[c, 2] == 1.0 or cell[before, 2] == 1.0
            # A corner outside all neighbours is outside the cloud's border.
            if not is_framed and reach[i] < distance <= 1.0 and _is_surrounded(cell[c, 0], cell[c, 1], flat, used):
                reach[i] = distance
        reach[i] *= largest[i]
    return reach
