"""The fewest texels that show a node's normals: none, or a tile of 2, 4, 8, ... up to w_s texels a side.

A tile is baked with as many texels as the view can show and then fitted by coarser ones, least squares over the disc.
Taken is the one whose texels and whose error, at the price of `PRICE`, are least together: so a number of bytes goes to
the tiles where it lowers the error over all pixels most. A tile of 2 x 2 texels is the linear field of Botsch et al.
2004, "Phong Splatting", eq. 2-4, with a bilinear term besides.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from hierarchy.borrowing import BORROWING
from hierarchy.encoding import BYTE_SCALE, BYTE_ZERO
from hierarchy.extremes import low_and_high
from hierarchy.tile_errors import error_of_fit
from hierarchy.tile_kernels import STACK, sum_up

# What rounding to bytes alone makes a tile differ from the normals baked, in radians.
ROUNDING = math.radians(0.15)
# By how many radians each texel has to lower the error of a splat whose picture is as many pixels wide as its tile may
# have texels. At 0.12, 0.25 and 0.4 degrees the drawn tiles of Igea have 0.54, 0.39 and 0.29 of the bytes of tiles of
# one size, and its mean error is 0.37, 0.38 and 0.39 degrees instead of 0.42.
PRICE = math.radians(0.4)
# A splat whose tile has as many texels as w_s allows counts as one of at least so many.
WIDE = 16


# Below, texels lie by columns and rows, x w + y, where loops over a column can take several at a time, and those of
# fitted tiles by rows and columns, as they are stored. Arrays that are worked in do not overlap, which compilers must
# be told to do so.


@nb.njit(**BORROWING, error_model="numpy")
def _encode(nearest, sums, frame, triangles, values, units):  # type: ignore[no-untyped-def]
    """Turn sums into what the texels store, not yet rounded, and unit normals.

    nearest, sums : float64 (w^2,) and (3 or 7, w^2)
    values : float32 (C, w^2): the two bytes of the normal less BYTE_ZERO, and red, green, blue and alpha
    units : float32 (3, w^2), in the disc's frame
    """
    ux, uy, uz = frame[0, 0], frame[0, 1], frame[0, 2]
    vx, vy, vz = frame[1, 0], frame[1, 1], frame[1, 2]
    nx, ny, nz = frame[2, 0], frame[2, 1], frame[2, 2]
    for i in range(len(nearest)):
        hit = nearest[i] < np.inf if triangles else nearest[i] > 0.0
        x, y, z = sums[0, i], sums[1, i], sums[2, i]
        a = x * ux + y * uy + z * uz
        b = x * vx + y * vy + z * vz
        c = max(x * nx + y * ny + z * nz, 0.0)
        total = abs(a) + abs(b) + c
        known = hit and total > 0.0
        a, b, c, total = (a, b, c, total) if known else (0.0, 0.0, 1.0, 1.0)
        a, b, c = a / total, b / total, c / total
        values[0, i], values[1, i] = BYTE_SCALE * (a + b), BYTE_SCALE * (a - b)
        norm = math.sqrt(a * a + b * b + c * c)
        units[0, i], units[1, i], units[2, i] = a / norm, b / norm, c / norm
    for k in range(2, len(values)):
        for i in range(len(nearest)):
            hit = nearest[i] < np.inf if triangles else nearest[i] > 0.0
            weight = 1.0 if triangles else nearest[i]
            values[k, i] = sums[k + 1, i] / weight if hit else 0.0


@nb.njit(**BORROWING, error_model="numpy")
def _fit(values, low, share, firsts, inverse, side, lines, sums, fitted):  # type: ignore[no-untyped-def]
    """Fit a tile by one of side x side texels: least squares over the texels of the disc.

    values : float32 (C, w^2); fitted : float32 (C, side^2 or more)
    lines, sums : float32 (C, side or more, w) and (side^2 or more,) to work in
    """
    texels, count = len(low), side * side
    one = np.float32(1.0)
    for k in range(len(values)):
        lines[k, :side] = 0.0
        for x in range(texels):
            left, part = low[x], share[x]
            for y in range(firsts[x], texels - firsts[x]):
                value = values[k, x * texels + y]
                right = part * value
                lines[k, left, y] += value - right
                lines[k, left + 1, y] += right
        sums[:count] = 0.0
        for y in range(texels):
            upper, lower = low[y] * side, (low[y] + 1) * side
            for j in range(side):
                sums[upper + j] += (one - share[y]) * lines[k, j, y]
                sums[lower + j] += share[y] * lines[k, j, y]
        fitted[k, :count] = 0.0
        # The inverse is symmetric: row by row it adds up along memory.
        for j in range(count):
            value = sums[j]
            for i in range(count):
                fitted[k, i] += inverse[j * count + i] * value


@nb.njit(**BORROWING, error_model="numpy")
def _spread(values, count, spread):  # type: ignore[no-untyped-def]
    """Set spread, uint8 (4,), to low.x, low.y, width.x and width.y of normals, values (C, N), of which `count` count.

    Byte b stands for low + b width / 255, so that normals that vary little are kept more finely.
    """
    for k in range(2):
        low, high = low_and_high(values[k], count)
        # What no texel of the disc tells is not always in the square.
        low, high = min(max(low, -BYTE_SCALE), BYTE_SCALE), min(max(high, -BYTE_SCALE), BYTE_SCALE)
        first = math.floor(low + BYTE_ZERO)
        spread[k], spread[2 + k] = np.uint8(first), np.uint8(max(math.ceil(high + BYTE_ZERO) - first, 1))


@nb.njit(**BORROWING, error_model="numpy")
def _round(fitted, count, spread):  # type: ignore[no-untyped-def]
    """Round texels to what their bytes will stand for.

    fitted : float32 (C, side^2 or more), the first `count` of each row
    spread : is set to that of the normals
    """
    _spread(fitted, count, spread)
    for k in range(2):
        first, width = np.float64(spread[k]), np.float64(spread[2 + k])
        for i in range(count):
            byte = np.rint((min(max(fitted[k, i], -BYTE_SCALE), BYTE_SCALE) + BYTE_ZERO - first) * (255.0 / width))
            fitted[k, i] = first + byte * (width / 255.0) - BYTE_ZERO
    for k in range(2, len(fitted)):
        for i in range(count):
            fitted[k, i] = min(max(np.rint(fitted[k, i]), 0.0), 255.0)


@nb.njit(**BORROWING, error_model="numpy")
def _store_tile(fitted, side, spread, out):  # type: ignore[no-untyped-def]
    """Store the bytes of a tile that `_round` has rounded, from the front of the arrays on, and its spread."""
    out_normals, out_colors, out_spread = out
    for k in range(2):
        factor = 255.0 / spread[2 + k]
        for i in range(side * side):
            out_normals[2 * i + k] = np.uint8(np.rint((fitted[k, i] + BYTE_ZERO - spread[k]) * factor))
    for k in range(2, len(fitted)):
        for i in range(side * side):
            out_colors[4 * i + k - 2] = np.uint8(fitted[k, i])
    for k in range(4):
        out_spread[k] = spread[k]


@nb.njit(**BORROWING)
def _store_whole(values, most, fitted, spread, out):  # type: ignore[no-untyped-def]
    """Store the tile that was baked; fitted, spread : float32 (C, w^2) and uint8 (4,) to work in."""
    for k in range(len(values)):
        for y in range(most):
            for x in range(most):
                fitted[k, y * most + x] = values[k, x * most + y]
    _round(fitted, most * most, spread)
    _store_tile(fitted, most, spread, out)


@nb.njit(cache=True, nogil=True)
def _desk(most, channels):  # type: ignore[no-untyped-def]
    """Return arrays to bake and fit tiles of `most` x `most` texels in, one after the other."""
    texels = most * most
    return (
        np.empty(STACK, np.int32),  # stack
        np.empty((3, 3), np.float64),  # frame
        np.empty((most, most), np.float64),  # nearest
        np.empty((1 + channels if channels > 2 else 3, most, most), np.float64),  # sums
        np.empty((channels, texels), np.float32),  # values
        np.empty((3, texels), np.float32),  # units
        np.empty((channels, texels), np.float32),  # fitted
        np.empty((channels, max(most, 2), most), np.float32),  # lines
        np.empty(texels, np.float32),  # sums of the fit, or by how much it is off
        np.empty((2, most), np.float32),  # tallies of what it is off by
        np.empty(4, np.uint8),  # spread
        np.zeros(3, np.float32),  # own colour
    )


@nb.njit(**BORROWING)
def _bake_fitted(model, node, most, tables, desk, out):  # type: ignore[no-untyped-def]
    """Bake a node's tile with as few texels as will do; return how many along one side, 0 where its own normal will.

    most : texels along one side at most, one of the sides
    desk : of `_desk`, for that many
    out : where to store normals and colours, uint8, flat, the texels first, no colours where there are none; and the
        spread of the normals, uint8 (4,)
    """
    nodes, disc_normals, leaves, triangles, own_colors = model
    sides, lows, shares, all_firsts, inverses, begins = tables
    stack, frame, nearest, sums, values, units, fitted, lines, off, tallies, spread, own = desk
    channels, texels = len(values), most * most
    sum_up(nodes, disc_normals, leaves, triangles, node, stack, frame, nearest, sums)
    _encode(nearest.reshape(texels), sums.reshape((len(sums), texels)), frame, triangles, values, units)
    if most == 1:
        _store_whole(values, most, fitted, spread, out)
        return 1
    if channels > 2:
        for k in range(3):
            own[k] = own_colors[node, k]
    size = 0
    while sides[size] < most:
        size += 1
    firsts = all_firsts[size, :most]
    _spread(values, texels, spread)
    for k in range(4):
        out[2][k] = spread[k]
    # What a radian is worth, in texels: that of a splat as wide as its texels may be, or wider where w_s limits them.
    wide = max(most, WIDE) if most == sides[-1] else most
    worth = (wide - 1) ** 2 / PRICE / (1 if channels == 2 else 3)
    best, cheapest = most, texels + worth * ROUNDING * max(spread[2], spread[3]) / 255.0
    # Alpha 0 and a byte of 0: the node's own colour and normal.
    fitted[:, 0] = 0.0
    error, fair = error_of_fit(
        values, units, lows[0, 0, :most], shares[0, 0, :most], firsts, 1, fitted, own, lines, off, tallies
    )
    if fair and worth * error <= cheapest:
        best, cheapest = 0, worth * error
    for coarser in range(size):
        side = sides[coarser]
        if side * side >= cheapest:
            break
        begin = begins[size, coarser]
        low, share = lows[size, coarser, :most], shares[size, coarser, :most]
        _fit(values, low, share, firsts, inverses[begin : begin + side**4], side, lines, off, fitted)
        _round(fitted, side * side, spread)
        error, fair = error_of_fit(values, units, low, share, firsts, side, fitted, own, lines, off, tallies)
        if fair and side * side + worth * error <= cheapest:
            best, cheapest = side, side * side + worth * error
            _store_tile(fitted, side, spread, out)
    if best == most:
        _store_whole(values, most, fitted, spread, out)
    return best


@nb.njit(cache=True, nogil=True)
def fit_tiles(nodes, disc_normals, leaves, triangles, own_colors, wanted, most, tables, normals, colors, rest):  # type: ignore[no-untyped-def]
    """Bake tiles on one core, whatever the others do.

    wanted, most : uint32 and int32 (K,), nodes and how many texels a side their tiles may have
    normals, colors : uint8 (K, largest^2 * 2) and (K, largest^2 * 4) or no rows, are filled from the front
    rest : uint8 (K, 4), is set to the spread of each; int32 (K,), to the texels along one side
    """
    model = (nodes, disc_normals, leaves, triangles, own_colors)
    channels = 6 if len(colors) > 0 else 2
    desk = _desk(most[0] if len(most) > 0 else 1, channels)
    for i in range(len(wanted)):
        if len(desk[2]) != most[i]:
            desk = _desk(most[i], channels)
        out = (normals[i], colors[i] if len(colors) > 0 else normals[0, :0], rest[0][i])
        rest[1][i] = _bake_fitted(model, wanted[i], most[i], tables, desk, out)
