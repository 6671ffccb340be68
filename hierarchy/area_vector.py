"""The area vector of a triangle: normal to its plane, twice its area long."""

from __future__ import annotations

import numba as nb
import numpy as np


@nb.njit(cache=True, nogil=True, inline="always")
def area_vector(positions, a, b, c):  # type: ignore[no-untyped-def]
    """Return (b - a) x (c - a) as three floats, in float64; it points to where the corners run counter-clockwise.

    positions : floats (V, 3); a, b, c : indices of the corners
    """
    px, py, pz = np.float64(positions[a, 0]), np.float64(positions[a, 1]), np.float64(positions[a, 2])
    ux, uy, uz = positions[b, 0] - px, positions[b, 1] - py, positions[b, 2] - pz
    vx, vy, vz = positions[c, 0] - px, positions[c, 1] - py, positions[c, 2] - pz
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
