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
# Two or three of a disc's own corners lie on its rim, and the neighbours that share them are as far from its centre as
# it reaches, but for their heights: rounding would decide. So those on the rim, to within RIM, that are no higher than
# FLAT, in radii, lie under the disc. With the distance alone one node in a thousand differed between a model and the
# same at another scale; Igea costs 0.6% more primitives by this.
RIM, FLAT = 1.0 + 1e-4, 0.01
# Nothing under a disc is farther from its centre, in radii.
REACH = 1.0 + 2e-4


@nb.njit(**BORROWING)
def point_is_under(dx, dy, dz, nx, ny, nz, radius2):  # type: ignore[no-untyped-def]
    """Tell whether a point is under a disc: in the sphere around it, or flat on its rim."""
    distance2 = dx * dx + dy * dy + dz * dz
    height2 = (dx * nx + dy * ny + dz * nz) ** 2
    return (distance2 <= radius2) | ((distance2 - height2 <= RIM**2 * radius2) & (height2 <= FLAT**2 * radius2))


@nb.njit(**BORROWING)
def leaf_is_under(positions, indices, centres, extents, leaf, disc, radius):  # type: ignore[no-untyped-def]
    """Tell whether a leaf's centre or one of its corners is under a disc; of a surfel, its bounding sphere.

    disc : centre and unit normal
    """
    px, py, pz, nx, ny, nz = disc
    dx, dy, dz = centres[leaf, 0] - px, centres[leaf, 1] - py, centres[leaf, 2] - pz
    if len(indices) == 0:
        return dx * dx + dy * dy + dz * dz <= (radius + extents[leaf]) ** 2
    radius2 = radius * radius
    if point_is_under(dx, dy, dz, nx, ny, nz, radius2):
        return True
    for k in range(3):
        v = indices[leaf, k]
        dx, dy, dz = positions[v, 0] - px, positions[v, 1] - py, positions[v, 2] - pz
        if point_is_under(dx, dy, dz, nx, ny, nz, radius2):
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
