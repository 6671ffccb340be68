"""The orthonormal frame (o1, o2, n) of a surfel, shared by baking and drawing.

Based on: Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017. Holst and Schumann's eq. 8 is
not used: its printed norm is wrong, and the right one loses all digits as |n_y| -> 1. The GLSL twin is
shaders/include/frame.glsl; a test compares the two.
"""

from __future__ import annotations

import numba as nb

# Where the basis changes its branch: -2^-100. At 0 processor and GPU would differ, as a GPU takes numbers below 2^-126
# for 0, so that a texel would be looked up in another frame than it was baked in.
SEAM = -(2.0**-100)


@nb.njit(cache=True, nogil=True, inline="always")
def tangents(nx, ny, nz):  # type: ignore[no-untyped-def]
    """Return o1 and o2, six floats, such that (o1, o2, n) is right-handed and orthonormal.

    nx, ny, nz : a unit vector
    """
    sign = 1.0 if nz > SEAM else -1.0
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    return 1.0 + sign * nx * nx * a, sign * b, -sign * nx, b, sign + ny * ny * a, -ny
