"""Morton order: 21 bits an axis, 63 bits a code."""

from __future__ import annotations

import numba as nb
import numpy as np
import numpy.typing as npt

from hierarchy.model import Float32Array

BITS = 21
CELLS = 1 << BITS


@nb.njit(cache=True, nogil=True, inline="always")
def spread_bits(v):  # type: ignore[no-untyped-def]
    """Put two zero bits before each of the lower 21 bits of a uint64."""
    v = v & np.uint64(0x1FFFFF)
    v = (v | (v << np.uint64(32))) & np.uint64(0x1F00000000FFFF)
    v = (v | (v << np.uint64(16))) & np.uint64(0x1F0000FF0000FF)
    v = (v | (v << np.uint64(8))) & np.uint64(0x100F00F00F00F00F)
    v = (v | (v << np.uint64(4))) & np.uint64(0x10C30C30C30C30C3)
    v = (v | (v << np.uint64(2))) & np.uint64(0x1249249249249249)
    return v


@nb.njit(cache=True, nogil=True, parallel=True)
def _codes(points, low, scale):  # type: ignore[no-untyped-def]
    codes = np.empty(len(points), np.uint64)
    for i in nb.prange(len(points)):
        code = np.uint64(0)
        for axis in range(3):
            cell = int((np.float64(points[i, axis]) - low[axis]) * scale)
            cell = min(max(cell, 0), CELLS - 1)
            code |= spread_bits(np.uint64(cell)) << np.uint64(2 - axis)
        codes[i] = code
    return codes


def morton_codes(points: Float32Array) -> npt.NDArray[np.uint64]:
    """Return the Morton code of every point in the cube around them all, uint64 (N,); x is the highest axis.

    points : float32 (N, 3), finite
    """
    if len(points) == 0:
        return np.empty(0, np.uint64)
    low = points.min(axis=0).astype(np.float64)
    extent = float((points.max(axis=0) - low).max())
    # The largest coordinate falls on CELLS and is clamped into the last cell.
    scale = CELLS / extent if extent > 0.0 else 0.0
    return _codes(points, low, scale)  # type: ignore[no-any-return]
