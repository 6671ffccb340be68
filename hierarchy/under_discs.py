"""Which primitives lie under a disc, and how near they come to its rim."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from hierarchy.borrowing import BORROWING
from hierarchy.frames import tangents

# Primitives that face the other way by more than 120 degrees are the far side of a thin sheet, not of a crease.
FAR_SIDE = -0.5
# Points of the rim that are looked at for borders: one each 45 degrees misses a corner of 8% of the radius.
RIM_POINTS = 8
_COSINES = np.cos(2.0 * math.pi / RIM_POINTS * np.arange(RIM_POINTS))
_SINES = np.sin(2.0 * math.pi / RIM_POINTS * np.arange(RIM_POINTS))
# A rim farther from all surface than this share of the radius overhangs a border.
BORDER = 0.15


@nb.njit(**BORROWING)
def within(positions, indices, centres, extents, leaf, x, y, z, radius):  # type: ignore[no-untyped-def]
    """Tell whether a leaf's centre or one of its corners (surfel: its rim) is within a radius of a point."""
    dx, dy, dz = np.float64(centres[leaf, 0]) - x, np.float64(centres[leaf, 1]) - y, np.float64(centres[leaf, 2]) - z
    distance2 = dx * dx + dy * dy + dz * dz
    if distance2 <= radius * radius:
        return True
    if distance2 > (radius + extents[leaf]) ** 2:
        return False
    if len(indices) == 0:
        return True
    for k in range(3):
        v = indices[leaf, k]
        dx, dy, dz = positions[v, 0] - x, positions[v, 1] - y, positions[v, 2] - z
        if dx * dx + dy * dy + dz * dz <= radius * radius:
            return True
    return False


@nb.njit(**BORROWING)
def write_rim(x, y, z, radius, nx, ny, nz, rim):  # type: ignore[no-untyped-def]
    """Write points on a disc's rim to rim, float64 (RIM_POINTS, 3)."""
    ux, uy, uz, vx, vy, vz = tangents(nx, ny, nz)
    for k in range(RIM_POINTS):
        c, s = radius * _COSINES[k], radius * _SINES[k]
        rim[k, 0], rim[k, 1], rim[k, 2] = x + c * ux + s * vx, y + c * uy + s * vy, z + c * uz + s * vz


@nb.njit(**BORROWING)
def approach_rim(centres, extents, leaf, rim, gaps):  # type: ignore[no-untyped-def]
    """Shorten the squared distances of the rim's points from the surface by what a leaf's bounding sphere reaches."""
    x, y, z = np.float64(centres[leaf, 0]), np.float64(centres[leaf, 1]), np.float64(centres[leaf, 2])
    extent = np.float64(extents[leaf])
    for k in range(len(rim)):
        distance2 = (rim[k, 0] - x) ** 2 + (rim[k, 1] - y) ** 2 + (rim[k, 2] - z) ** 2
        # The root is taken only where it matters.
        if distance2 < (gaps[k] + extent) ** 2:
            gaps[k] = max(math.sqrt(distance2) - extent, 0.0)
