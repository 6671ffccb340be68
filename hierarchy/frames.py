"""The orthonormal frame (o1, o2, n) of a surfel, shared by baking and drawing.

Based on: Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017. Holst and Schumann's eq. 8 is
not used: its printed norm is wrong, and the right one loses all digits as |n_y| -> 1. The GLSL twin is
shaders/include/frame.glsl; a test compares the two.
"""

from __future__ import annotations

import numba as nb


@nb.njit(cache=True, nogil=True, inline="always")
def tangents(nx, ny, nz):  # type: ignore[no-untyped-def]
    """Return o1 and o2, six floats, such that (o1, o2, n) is right-handed and orthonormal.

    nx, ny, nz : a unit vector
    """
    # Not copysign: -0.0 must take the same branch on the GPU.
    sign = 1.0 if nz >= 0.0 else -1.0
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    return 1.0 + sign * nx * nx * a, sign * b, -sign * nx, b, sign + ny * ny * a, -ny
