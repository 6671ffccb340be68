"""Gradient noise in space and sums of it over octaves.

Based on: Perlin, Improving Noise, 2002 (the quintic fade and the twelve gradients); Musgrave in Ebert et al.,
Texturing and Modeling, 1994 (the ridged sum).
"""

from __future__ import annotations

import math

from numba import njit


@njit(inline="never", cache=True, nogil=True)
def _corner(i: int, j: int, k: int, seed: int, x: float, y: float, z: float) -> float:
    """Return the dot product of (x, y, z) with the gradient at a lattice point."""
    # 32-bit arithmetic in 64-bit integers: multiplied primes, then an avalanche.
    h = (i * 374761393 + j * 668265263 + k * 2147483647 + seed * 1274126177) & 0xFFFFFFFF
    h = ((h ^ (h >> 13)) * 1274126177) & 0xFFFFFFFF
    h = ((h ^ (h >> 16)) * 668265263) & 0xFFFFFFFF
    h = (h ^ (h >> 15)) & 15
    u = x if h < 8 else y
    v = y if h < 4 else (x if h == 12 or h == 14 else z)
    return (u if h & 1 == 0 else -u) + (v if h & 2 == 0 else -v)


@njit(cache=True, nogil=True)
def noise(x: float, y: float, z: float, seed: int) -> float:
    """Return smooth noise of unit frequency at (x, y, z), about -1 to 1, zero at whole numbers."""
    fx, fy, fz = math.floor(x), math.floor(y), math.floor(z)
    i, j, k = int(fx), int(fy), int(fz)
    x, y, z = x - fx, y - fy, z - fz
    u = x * x * x * (x * (x * 6.0 - 15.0) + 10.0)
    v = y * y * y * (y * (y * 6.0 - 15.0) + 10.0)
    w = z * z * z * (z * (z * 6.0 - 15.0) + 10.0)
    a = _corner(i, j, k, seed, x, y, z)
    a += u * (_corner(i + 1, j, k, seed, x - 1.0, y, z) - a)
    b = _corner(i, j + 1, k, seed, x, y - 1.0, z)
    b += u * (_corner(i + 1, j + 1, k, seed, x - 1.0, y - 1.0, z) - b)
    c = _corner(i, j, k + 1, seed, x, y, z - 1.0)
    c += u * (_corner(i + 1, j, k + 1, seed, x - 1.0, y, z - 1.0) - c)
    d = _corner(i, j + 1, k + 1, seed, x, y - 1.0, z - 1.0)
    d += u * (_corner(i + 1, j + 1, k + 1, seed, x - 1.0, y - 1.0, z - 1.0) - d)
    a += v * (b - a)
    c += v * (d - c)
    return float(a + w * (c - a))
