"""By how much a coarser tile, looked up as the shader does, differs from the tile that it was fitted to.

Texels of tiles lie by columns and rows, x w + y, where loops over a column can take several at a time, and those of
fitted tiles by rows and columns, as they are stored.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from hierarchy.borrowing import BORROWING
from hierarchy.encoding import BYTE_SCALE
from hierarchy.extremes import larger

# What a coarser tile may be off anywhere, in radians, and in grey levels of a colour.
WORST, WORST_COLOR = math.radians(6.0), 24.0
# A colour that is off by one grey level counts as much as a normal that is off by these radians.
LEVEL = math.radians(0.25)


@nb.njit(**BORROWING, error_model="numpy")
def _look_up(fitted, side, low, share, lines):  # type: ignore[no-untyped-def]
    """Interpolate a tile of side x side texels along its columns: lines, float32 (C, side or more, w), are set.

    A tile of one texel is the same everywhere.
    """
    for k in range(len(fitted)):
        if side == 1:
            lines[k, :2] = fitted[k, 0]
            continue
        for j in range(side):
            for y in range(len(low)):
                upper, lower = fitted[k, low[y] * side + j], fitted[k, (low[y] + 1) * side + j]
                lines[k, j, y] = upper + share[y] * (lower - upper)


@nb.njit(**BORROWING, error_model="numpy")
def _normals_off(lines, low, share, units, off):  # type: ignore[no-untyped-def]
    """Set off, float32 (w^2,), to the squares by which normals that are looked up differ, in radians."""
    texels = len(low)
    one, half = np.float32(1.0), np.float32(0.5 / BYTE_SCALE)
    for x in range(texels):
        left, part = low[x], share[x]
        for y in range(texels):
            p, q = lines[0, left, y], lines[1, left, y]
            p, q = p + part * (lines[0, left + 1, y] - p), q + part * (lines[1, left + 1, y] - q)
            a, b = (p + q) * half, (p - q) * half
            c = one - abs(a) - abs(b)
            scale = one / math.sqrt(a * a + b * b + c * c)
            i = x * texels + y
            dx, dy, dz = a * scale - units[0, i], b * scale - units[1, i], c * scale - units[2, i]
            off[i] = dx * dx + dy * dy + dz * dz


@nb.njit(**BORROWING, error_model="numpy")
def _colors_off(lines, low, share, values, own, off):  # type: ignore[no-untyped-def]
    """Set off, float32 (w^2,), to the squares by which colours that are looked up differ, in grey levels.

    own : float32 (3,), the colour that shows where alpha is 0
    """
    texels = len(low)
    whole = np.float32(1.0 / 255.0)
    for x in range(texels):
        left, part = low[x], share[x]
        for y in range(texels):
            i = x * texels + y
            alpha = lines[5, left, y]
            clear = (values[5, i] - (alpha + part * (lines[5, left + 1, y] - alpha))) * whole
            worst = np.float32(0.0)
            for k in range(3):
                near = lines[2 + k, left, y]
                near = near + part * (lines[2 + k, left + 1, y] - near)
                d = values[2 + k, i] - near - clear * own[k]
                worst = max(worst, d * d)
            off[i] = worst


@nb.njit(**BORROWING)
def _sum_off(off, firsts, tallies):  # type: ignore[no-untyped-def]
    """Return the sum over the texels of the disc, the largest, and how many they are.

    tallies : float32 (2, w), to work in: a sum and a largest for each row, so that columns are added as they lie
    """
    texels = len(firsts)
    sums, largest = tallies[0], tallies[1]
    sums[:] = 0.0
    largest[:] = 0.0
    count = 0
    for x in range(texels):
        # Columns of a disc begin where its rows do.
        count += texels - 2 * firsts[x]
        column = off[x * texels :]
        for y in range(firsts[x], texels - firsts[x]):
            sums[y] += column[y]
            largest[y] = larger(largest[y], column[y])
    total, most = np.float32(0.0), np.float32(0.0)
    for y in range(texels):
        total, most = total + sums[y], larger(most, largest[y])
    return total, most, count


@nb.njit(**BORROWING, error_model="numpy")
def error_of_fit(values, units, low, share, firsts, side, fitted, own, lines, off, tallies):  # type: ignore[no-untyped-def]
    """Return by how much a coarser tile, looked up as the shader does, differs from a tile.

    side : of the coarser tile; 1: one value everywhere
    own : float32 (3,), the colour that shows where alpha is 0
    lines, off, tallies : float32 (C, side or more, w), (w^2,) and (2, w) to work in

    Returns the root of the mean square in radians, that of colours counted as `LEVEL` each, and whether it is off
    nowhere by more than `WORST` and `WORST_COLOR`.
    """
    _look_up(fitted, side, low, share, lines)
    _normals_off(lines, low, share, units, off)
    total, most, count = _sum_off(off, firsts, tallies)
    total_color, most_color = np.float32(0.0), np.float32(0.0)
    if len(values) > 2:
        _colors_off(lines, low, share, values, own, off)
        total_color, most_color, _ = _sum_off(off, firsts, tallies)
    fair = most <= WORST * WORST and most_color <= WORST_COLOR * WORST_COLOR
    return math.sqrt(total / count) + LEVEL * math.sqrt(total_color / count), fair
