"""Morton order: 21 bits an axis, 63 bits a code, and as many codes one below the other as points lie close.

A far outlier puts a whole model into one cell of the cube around them all. So the points of a cell get codes of their
own, relative to the cube around these, and so on until only points at one place share a cell.
"""

from __future__ import annotations

import numba as nb
import numpy as np
import numpy.typing as npt

from hierarchy.model import Float32Array, Int32Array, UInt16Array
from hierarchy.radix_sort import sort_codes

BITS = 21
CELLS = 1 << BITS
# A step in Morton order between two points at the same place. Others number the bits of all codes, from the first
# one's highest down: 63 a code, and float32 has room for 14 codes between its largest and its smallest number.
SAME_PLACE = 0xFFFF
# Runs of equal codes longer than this are worth sorting on all cores, which is faster and starts slower.
LONG_RUN = 1 << 15


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


@nb.njit(cache=True, nogil=True, inline="always")
def _code(points, i, low, scale):  # type: ignore[no-untyped-def]
    code = np.uint64(0)
    for axis in range(3):
        cell = int((np.float64(points[i, axis]) - low[axis]) * scale)
        cell = min(max(cell, 0), CELLS - 1)
        code |= spread_bits(np.uint64(cell)) << np.uint64(2 - axis)
    return code


@nb.njit(cache=True, nogil=True, parallel=True)
def _codes(points, low, scale, codes):  # type: ignore[no-untyped-def]
    for i in nb.prange(len(points)):
        codes[i] = _code(points, i, low, scale)


@nb.njit(cache=True, nogil=True, parallel=True)
def _bounds(points):  # type: ignore[no-untyped-def]
    """Return the least and the largest coordinates of points (N, 3), N >= 1, six floats."""
    x0, y0, z0 = points[0]
    x1, y1, z1 = points[0]
    for i in nb.prange(len(points)):
        x0, x1 = min(x0, points[i, 0]), max(x1, points[i, 0])
        y0, y1 = min(y0, points[i, 1]), max(y1, points[i, 1])
        z0, z1 = min(z0, points[i, 2]), max(z1, points[i, 2])
    return x0, y0, z0, x1, y1, z1


def morton_codes(points: Float32Array) -> npt.NDArray[np.uint64]:
    """Return the Morton code of every point in the cube around them all, uint64 (N,); x is the highest axis.

    points : float32 (N, 3), finite
    """
    if len(points) == 0:
        return np.empty(0, np.uint64)
    bounds = np.array(_bounds(points), np.float64)
    low = bounds[:3]
    extent = float((bounds[3:] - low).max())
    # The largest coordinate falls on CELLS and is clamped into the last cell.
    scale = CELLS / extent if extent > 0.0 else 0.0
    codes = np.empty(len(points), np.uint64)
    _codes(points, low, scale, codes)
    return codes


def morton_order(points: Float32Array) -> tuple[Int32Array, UInt16Array]:
    """Sort points by place: nothing but points at one place shares a cell, however close the others lie.

    points : float32 (N, 3), finite
    Returns the order, int32 (N,): points at one place stay in the order in which they come; and the step to each point
    from the one before it in that order, uint16 (N,): the number of the highest bit in which their codes differ,
    SAME_PLACE where they do not. The points between two steps below s are those of one cell of the level s. The first
    step is 0 and means nothing.
    """
    order, sorted_codes = sort_codes(morton_codes(points))
    steps = np.zeros(len(points), np.uint16)
    long_runs = [(0, len(points), 0)] if len(points) else []
    while long_runs:
        begin, end, level = long_runs.pop()
        if level > 0:
            run = np.sort(order[begin:end])
            by_code, sorted_codes = sort_codes(morton_codes(points[run]))
            order[begin:end] = run[by_code]
            if sorted_codes[0] == sorted_codes[-1]:
                # One place: two different ones would lie in the first and in the last cell.
                continue
        _write_steps(sorted_codes, level * 3 * BITS, steps[begin:end])
        for first, last in _refine_runs(points, order[begin:end], steps[begin:end], level + 1):
            long_runs.append((begin + first, begin + last, level + 1))
    return order, steps


@nb.njit(cache=True, nogil=True, inline="always")
def _step(before, after, first_bit):  # type: ignore[no-untyped-def]
    """Return the number of the highest bit in which two codes differ."""
    difference = before ^ after
    if difference == 0:
        return SAME_PLACE
    bit = 3 * BITS - 1
    while (difference >> np.uint64(bit)) == 0:
        bit -= 1
    return first_bit + 3 * BITS - 1 - bit


@nb.njit(cache=True, nogil=True, parallel=True)
def _write_steps(codes, first_bit, steps):  # type: ignore[no-untyped-def]
    """Write the steps between sorted codes to steps[1:]."""
    for i in nb.prange(1, len(codes)):
        steps[i] = _step(codes[i - 1], codes[i], first_bit)


@nb.njit(cache=True, nogil=True)
def _refine_runs(points, order, steps, level):  # type: ignore[no-untyped-def]
    """Sort within every run of equal codes; return [begin, end) of those runs that are left to do for their length.

    Runs are sorted again and again, deeper every time, until they hold but one place.
    """
    long_runs = [(0, 0) for _ in range(0)]
    begin = 0
    count = len(order)
    while begin < count:
        end = begin + 1
        while end < count and steps[end] == SAME_PLACE:
            end += 1
        if end - begin > LONG_RUN:
            long_runs.append((begin, end))
        elif end - begin > 1:
            _refine_run(points, order[begin:end], steps[begin:end], level)
        begin = end
    return long_runs


@nb.njit(cache=True, nogil=True)
def _refine_run(points, order, steps, level):  # type: ignore[no-untyped-def]
    """Sort the points order, which share a code of the level above, by codes relative to the cube around them."""
    pending = [(0, len(order), level)]
    while len(pending) > 0:
        begin, end, level = pending.pop()
        run = np.sort(order[begin:end])
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for i in run:
            for axis in range(3):
                low[axis] = min(low[axis], np.float64(points[i, axis]))
                high[axis] = max(high[axis], np.float64(points[i, axis]))
        extent = max(high[0] - low[0], high[1] - low[1], high[2] - low[2])
        if extent == 0.0:
            order[begin:end] = run
            continue
        codes = np.empty(len(run), np.uint64)
        for k in range(len(run)):
            codes[k] = _code(points, run[k], low, CELLS / extent)
        by_code = np.argsort(codes, kind="mergesort")
        order[begin:end] = run[by_code]
        first = begin
        for k in range(1, len(run) + 1):
            step = _step(codes[by_code[k - 1]], codes[by_code[k]], level * 3 * BITS) if k < len(run) else 0
            if k < len(run):
                steps[begin + k] = step
            if step != SAME_PLACE:
                if begin + k - first > 1:
                    pending.append((first, begin + k, level + 1))
                first = begin + k
