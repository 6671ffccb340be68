"""The fewest texels that show a node's normals: none, or a tile of 2, 4, 8, ... up to w_s texels a side.

A tile is baked with as many texels as the view can show and then fitted by coarser ones, least squares over the disc.
Taken is the one whose texels and whose error, at the price of `PRICE`, are least together: so a number of bytes goes to
the tiles where it lowers the error over all pixels most. A tile of 2 x 2 texels is the linear field of Botsch et al.
2004, "Phong Splatting", eq. 2-4, with a bilinear term besides; what the fit leaves open at the corners, where no texel
of the disc is, is made smooth instead of small (they take the pseudo-inverse).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba as nb
import numpy as np

from hierarchy.encoding import BYTE_SCALE, BYTE_ZERO
from hierarchy.hierarchy import Hierarchy
from hierarchy.model import Float32Array, Int32Array, Int64Array, UInt32Array
from hierarchy.tile_kernels import sum_up
from hierarchy.view import View

# What a coarser tile may be off anywhere, in radians, and in grey levels of a colour.
WORST, WORST_COLOR = math.radians(6.0), 24.0
# A colour that is off by one grey level counts as much as a normal that is off by these radians.
LEVEL = math.radians(0.25)
# What rounding to bytes alone makes a tile differ from the normals baked, in radians.
ROUNDING = math.radians(0.15)
# By how many radians each texel has to lower the error of a splat whose picture is as many pixels wide as its tile may
# have texels. At 0.12, 0.25 and 0.4 degrees the drawn tiles of Igea have 0.54, 0.39 and 0.29 of the bytes of tiles of
# one size, and its mean error is 0.37, 0.38 and 0.39 degrees instead of 0.42.
PRICE = math.radians(0.4)
# A splat whose tile has as many texels as w_s allows counts as one of at least so many.
WIDE = 16
# Tiles are fitted by tiles of these texels a side; a fit takes the square of the square of it.
COARSER = (2, 4, 8, 16)
# Texels that are no further apart than this, in pixels, are enough.
TEXEL_PIXELS = 1.6
# Weight of the differences of neighbouring texels in the fit.
SMOOTHNESS = 1e-3


@dataclass(frozen=True, eq=False)
class FitTables:
    """What fitting tiles of each size by coarser ones takes, computed once.

    sides : texels along one side, ascending; int32 (S,)
    lows, shares : texel x of a tile of sides[i] lies between the texels low and low + 1 of one of sides[j], by the
        share; int32 and float32 (S, S, largest)
    inverses, begins : of the normal equations, row by row behind each other, float32, and where each begins, int64
        (S, S)
    """

    sides: Int32Array
    lows: Int32Array
    shares: Float32Array
    inverses: Float32Array
    begins: Int64Array


def sides_of(texels: int) -> tuple[int, ...]:
    """Return the texels along one side that tiles of at most `texels` may have, ascending."""
    return (*(side for side in COARSER if side < texels), texels)


def fit_tables(texels: int) -> FitTables:
    """Compute the tables for tiles of at most `texels` texels a side."""
    sides = sides_of(texels)
    count = len(sides)
    lows, shares = np.zeros((count, count, texels), np.int32), np.zeros((count, count, texels), np.float32)
    begins = np.zeros((count, count), np.int64)
    inverses: list[Float32Array] = []
    end = 0
    for i, fine in enumerate(sides):
        at = np.linspace(-1.0, 1.0, fine)
        inside = at[:, None] ** 2 + at[None, :] ** 2 <= _reach2(fine)
        for j, coarse in enumerate(sides[:i]):
            place = np.arange(fine) * ((coarse - 1) / (fine - 1))
            low = np.minimum(place.astype(np.int32), coarse - 2)
            lows[i, j, :fine], shares[i, j, :fine] = low, place - low
            line = np.zeros((fine, coarse))
            line[np.arange(fine), low], line[np.arange(fine), low + 1] = 1.0 - (place - low), place - low
            inner = np.kron(line, line)[inside.ravel()]
            step = np.diff(np.eye(coarse), axis=0)
            rough = np.concatenate([np.kron(step, np.eye(coarse)), np.kron(np.eye(coarse), step)])
            inverse = np.linalg.inv(inner.T @ inner + SMOOTHNESS * rough.T @ rough)
            begins[i, j] = end
            inverses.append(inverse.astype(np.float32).ravel())
            end += inverse.size
    flat = np.concatenate(inverses) if inverses else np.empty(0, np.float32)
    return FitTables(np.array(sides, np.int32), lows, shares, flat, begins)


def _reach2(texels: int) -> float:
    """Return the square of the distance, in radii, up to which texels count: those that the disc's rim lies between."""
    return float((1.0 + 2.0 / max(texels - 1, 1)) ** 2)


@nb.njit(cache=True, nogil=True, inline="always")
def _row(y, texels):  # type: ignore[no-untyped-def]
    """Return the first of the texels of row y that count and the one behind the last."""
    half = 0.5 * (texels - 1)
    wide = math.sqrt(max((half + 1.0) ** 2 - (y - half) ** 2, 0.0))
    first = max(math.ceil(half - wide), 0)
    return first, texels - first


@nb.njit(cache=True, nogil=True)
def _encode(nearest, sums, frame, triangles, values, units):  # type: ignore[no-untyped-def]
    """Turn sums into what the texels store, not yet rounded, and unit normals.

    values : float32 (C, w, w): the two bytes of the normal less BYTE_ZERO, and red, green, blue and alpha
    units : float32 (3, w, w), in the disc's frame
    """
    texels = len(nearest)
    channels = len(values)
    for y in range(texels):
        for x in range(texels):
            if nearest[y, x] == np.inf if triangles else nearest[y, x] <= 0.0:
                values[:, y, x] = 0.0
                units[0, y, x] = units[1, y, x] = 0.0
                units[2, y, x] = 1.0
                continue
            a = sums[y, x, 0] * frame[0, 0] + sums[y, x, 1] * frame[0, 1] + sums[y, x, 2] * frame[0, 2]
            b = sums[y, x, 0] * frame[1, 0] + sums[y, x, 1] * frame[1, 1] + sums[y, x, 2] * frame[1, 2]
            c = max(sums[y, x, 0] * frame[2, 0] + sums[y, x, 1] * frame[2, 1] + sums[y, x, 2] * frame[2, 2], 0.0)
            total = abs(a) + abs(b) + c
            if not total > 0.0:
                a, b, c, total = 0.0, 0.0, 1.0, 1.0
            a, b, c = a / total, b / total, c / total
            values[0, y, x], values[1, y, x] = BYTE_SCALE * (a + b), BYTE_SCALE * (a - b)
            norm = math.sqrt(a * a + b * b + c * c)
            units[0, y, x], units[1, y, x], units[2, y, x] = a / norm, b / norm, c / norm
            weight = 1.0 if triangles else nearest[y, x]
            for k in range(2, channels):
                values[k, y, x] = sums[y, x, k + 1] / weight


@nb.njit(cache=True, nogil=True)
def _fit(values, low, share, inverse, side, fitted):  # type: ignore[no-untyped-def]
    """Fit a tile by one of side x side texels: least squares over the texels of the disc.

    values : float32 (C, w, w); fitted : float32 (C, side^2)
    """
    channels, texels = len(values), values.shape[1]
    one = np.float32(1.0)
    sums = np.zeros((channels, side * side), np.float32)
    row = np.empty(side, np.float32)
    for y in range(texels):
        first, last = _row(y, texels)
        upper, lower = low[y] * side, (low[y] + 1) * side
        for k in range(channels):
            row[:] = 0.0
            for x in range(first, last):
                value = values[k, y, x]
                right = share[x] * value
                row[low[x]] += value - right
                row[low[x] + 1] += right
            for j in range(side):
                sums[k, upper + j] += (one - share[y]) * row[j]
                sums[k, lower + j] += share[y] * row[j]
    count = side * side
    for k in range(channels):
        fitted[k, :count] = 0.0
        # The inverse is symmetric: row by row it adds up along memory.
        for j in range(count):
            value = sums[k, j]
            for i in range(count):
                fitted[k, i] += inverse[j * count + i] * value


@nb.njit(cache=True, nogil=True)
def _round(fitted, count, spread):  # type: ignore[no-untyped-def]
    """Round texels to what their bytes will stand for.

    fitted : float32 (C, side^2), the first `count` of each row
    spread : uint8 (4,), is set to low.x, low.y, width.x and width.y of the normals: byte b stands for
        low + b width / 255, so that normals that vary little are kept more finely
    """
    for k in range(len(fitted)):
        if k >= 2:
            for i in range(count):
                fitted[k, i] = min(max(np.rint(fitted[k, i]), 0.0), 255.0)
            continue
        low, high = BYTE_SCALE, -BYTE_SCALE
        for i in range(count):
            # What no texel of the disc tells is not always in the square.
            fitted[k, i] = min(max(fitted[k, i], -BYTE_SCALE), BYTE_SCALE)
            low, high = min(low, fitted[k, i]), max(high, fitted[k, i])
        first = math.floor(low + BYTE_ZERO)
        width = max(math.ceil(high + BYTE_ZERO) - first, 1)
        spread[k], spread[2 + k] = np.uint8(first), np.uint8(width)
        for i in range(count):
            byte = np.rint((fitted[k, i] + BYTE_ZERO - first) * (255.0 / width))
            fitted[k, i] = first + byte * (width / 255.0) - BYTE_ZERO


@nb.njit(cache=True, nogil=True)
def _error(values, units, low, share, side, fitted, own):  # type: ignore[no-untyped-def]
    """Return by how much a coarser tile, looked up as the shader does, differs from a tile.

    side : of the coarser tile; 1: one value everywhere
    own : float32 (3,), the colour that shows where alpha is 0

    Returns the root of the mean square in radians, that of colours counted as `LEVEL` each, and whether it is off
    nowhere by more than `WORST` and `WORST_COLOR`.
    """
    channels, texels = len(values), values.shape[1]
    one, half, whole = np.float32(1.0), np.float32(0.5 / BYTE_SCALE), np.float32(1.0 / 255.0)
    most, most_color = np.float32(0.0), np.float32(0.0)
    total, total_color, count = np.float32(0.0), np.float32(0.0), 0
    line = np.empty((channels, side + 1), np.float32)
    near = np.empty((channels, texels), np.float32)
    for y in range(texels):
        first, last = _row(y, texels)
        count += last - first
        for k in range(channels):
            if side == 1:
                near[k, :] = fitted[k, 0]
                continue
            upper, lower = low[y] * side, (low[y] + 1) * side
            for j in range(side):
                line[k, j] = fitted[k, upper + j] + share[y] * (fitted[k, lower + j] - fitted[k, upper + j])
            for x in range(first, last):
                left = line[k, low[x]]
                near[k, x] = left + share[x] * (line[k, low[x] + 1] - left)
        for x in range(first, last):
            a, b = (near[0, x] + near[1, x]) * half, (near[0, x] - near[1, x]) * half
            c = one - abs(a) - abs(b)
            scale = one / math.sqrt(a * a + b * b + c * c)
            dx, dy, dz = a * scale - units[0, y, x], b * scale - units[1, y, x], c * scale - units[2, y, x]
            off = dx * dx + dy * dy + dz * dz
            total += off
            most = max(most, off)
        if channels > 2:
            for x in range(first, last):
                clear = (values[5, y, x] - near[5, x]) * whole
                off = np.float32(0.0)
                for k in range(3):
                    d = values[2 + k, y, x] - near[2 + k, x] - clear * own[k]
                    off = max(off, d * d)
                total_color += off
                most_color = max(most_color, off)
    fair = most <= WORST * WORST and most_color <= WORST_COLOR * WORST_COLOR
    return math.sqrt(total / count) + LEVEL * math.sqrt(total_color / count), fair


@nb.njit(cache=True, nogil=True)
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
    out_spread[:] = spread


@nb.njit(cache=True, nogil=True)
def _bake_fitted(model, node, most, tables, out):  # type: ignore[no-untyped-def]
    """Bake a node's tile with as few texels as will do; return how many along one side, 0 where its own normal will.

    most : texels along one side at most, one of the sides
    out : where to store normals and colours, uint8, flat, the texels first, no colours where there are none; and what
        `_round` says of the normals, uint8 (4,)
    """
    nodes, disc_normals, leaves, triangles, own_colors = model
    sides, lows, shares, inverses, begins = tables
    channels = 6 if len(out[1]) > 0 else 2
    frame = np.empty((3, 3), np.float64)
    nearest = np.empty((most, most))
    sums = np.empty((most, most, 1 + channels if channels > 2 else 3))
    sum_up(nodes, disc_normals, leaves, triangles, node, frame, nearest, sums)
    values = np.empty((channels, most, most), np.float32)
    units = np.empty((3, most, most), np.float32)
    _encode(nearest, sums, frame, triangles, values, units)
    fitted = np.zeros((channels, most * most), np.float32)
    own = np.zeros(3, np.float32)
    if channels > 2:
        for k in range(3):
            own[k] = own_colors[node, k]
    size = 0
    while sides[size] < most:
        size += 1
    spread = np.zeros(4, np.uint8)
    for k in range(channels):
        fitted[k] = values[k].ravel()
    _round(fitted, most * most, spread)
    _store_tile(fitted, most, spread, out)
    if most == 1:
        return 1
    # What a radian is worth, in texels: that of a splat as wide as its texels may be, or wider where w_s limits them.
    wide = max(most, WIDE) if most == sides[-1] else most
    worth = (wide - 1) ** 2 / PRICE / (1 if channels == 2 else 3)
    best, cheapest = most, most * most + worth * ROUNDING * max(spread[2], spread[3]) / 255.0
    # Alpha 0 and a byte of 0: the node's own colour and normal.
    fitted[:] = 0.0
    error, fair = _error(values, units, lows[0, 0], shares[0, 0], 1, fitted, own)
    if fair and worth * error <= cheapest:
        best, cheapest = 0, worth * error
    for coarser in range(size):
        side = sides[coarser]
        if side * side >= cheapest:
            break
        begin = begins[size, coarser]
        low, share = lows[size, coarser], shares[size, coarser]
        _fit(values, low, share, inverses[begin : begin + side**4], side, fitted)
        _round(fitted, side * side, spread)
        error, fair = _error(values, units, low, share, side, fitted, own)
        if fair and side * side + worth * error <= cheapest:
            best, cheapest = side, side * side + worth * error
            _store_tile(fitted, side, spread, out)
    return best


@nb.njit(cache=True, nogil=True)
def fit_tiles(nodes, disc_normals, leaves, triangles, own_colors, wanted, most, tables, normals, colors, rest):  # type: ignore[no-untyped-def]
    """Bake tiles on one core, whatever the others do.

    wanted, most : uint32 and int32 (K,), nodes and how many texels a side their tiles may have
    normals, colors : uint8 (K, largest^2 * 2) and (K, largest^2 * 4) or no rows, are filled from the front
    rest : uint8 (K, 4), is set to the `_round` of each; int32 (K,), to the texels along one side
    """
    model = (nodes, disc_normals, leaves, triangles, own_colors)
    for i in range(len(wanted)):
        out = (normals[i], colors[i] if len(colors) > 0 else normals[0, :0], rest[0][i])
        rest[1][i] = _bake_fitted(model, wanted[i], most[i], tables, out)


@nb.njit(cache=True, nogil=True, inline="always")
def side_seen(sides, texels, across):  # type: ignore[no-untyped-def]
    """Return how many texels a side a picture shows of a tile.

    sides : texels that tiles may have, ascending; of those below `texels` the first that is enough is taken
    texels : it has at most
    across : pixels that it is wide
    """
    for side in sides:
        if side >= texels:
            break
        if (side - 1) * TEXEL_PIXELS >= across:
            return side
    return texels


@nb.njit(cache=True, nogil=True)
def _texels_seen(splats, wanted, eye, axis, focal, parallel, sides, texels, most):  # type: ignore[no-untyped-def]
    for i in range(len(wanted)):
        splat = splats[wanted[i]]
        x, y, z = splat["centre"][0] - eye[0], splat["centre"][1] - eye[1], splat["centre"][2] - eye[2]
        depth = x * axis[0] + y * axis[1] + z * axis[2]
        across = 2.0 * focal * splat["radius"]
        if not parallel:
            across = across / depth if depth > 0.0 else np.inf
        most[i] = side_seen(sides, texels, across)


def texels_seen(hierarchy: Hierarchy, view: View, nodes: UInt32Array, texels: int) -> Int32Array:
    """Return how many texels along one side of their tiles a view can show of nodes, int32 (K,).

    nodes : uint32 (K,)
    texels : along one side at most
    """
    most = np.empty(len(nodes), np.int32)
    sides = np.array(COARSER, np.int32)
    axis = -view.eye_from_model[2, :3]
    _texels_seen(hierarchy.splats, nodes, view.eye, axis, view.focal_pixels, view.is_parallel, sides, texels, most)
    return most
