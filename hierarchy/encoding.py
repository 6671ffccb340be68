"""Two bytes for a normal of a hemisphere: the hemi-octahedral map.

Based on: Cigolle et al., "A Survey of Efficient Representations for Independent Unit Vectors", JCGT 3(2), 2014.
The square is the hemisphere's octahedron turned by 45 degrees, so no fold crosses it and bilinear filtering is
safe everywhere. Byte 128 stands for 0 exactly, so that a surfel's own normal survives the round trip; tile_fits.py
spreads the bytes of a tile over a part of the square.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from hierarchy.model import Float64Array, UInt8Array

# byte = 128 + 127 e, e in [-1, 1]; the shader undoes it as (255 value - 128) / 127.
BYTE_ZERO = 128.0
BYTE_SCALE = 127.0


@nb.njit(cache=True, nogil=True, inline="always")
def encode_hemisphere(x, y, z):  # type: ignore[no-untyped-def]
    """Return the two bytes, as floats already rounded, of a vector in the surfel's frame.

    x, y, z : not all zero, any length; a vector below the plane is moved to the rim of the hemisphere
    """
    z = max(z, 0.0)
    norm = abs(x) + abs(y) + z
    if not norm > 0.0:
        return BYTE_ZERO, BYTE_ZERO
    px, py = x / norm, y / norm
    return np.rint(BYTE_ZERO + BYTE_SCALE * (px + py)), np.rint(BYTE_ZERO + BYTE_SCALE * (px - py))


def decode_hemisphere(code: UInt8Array) -> Float64Array:
    """Return the unit vectors, float64 (..., 3), of byte pairs, uint8 (..., 2)."""
    e = (code.astype(np.float64) - BYTE_ZERO) / BYTE_SCALE
    x, y = 0.5 * (e[..., 0] + e[..., 1]), 0.5 * (e[..., 0] - e[..., 1])
    # Half of |a + b| + |a - b| is the larger of |a| and |b|: so no rounding takes a normal below the rim.
    v = np.stack([x, y, 1.0 - np.abs(e).max(axis=-1)], axis=-1)
    unit: Float64Array = v / np.linalg.norm(v, axis=-1, keepdims=True)
    return unit
