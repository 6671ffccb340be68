"""Compiled walks over PLY rows of different lengths."""

from __future__ import annotations

import numpy as np
from numba import njit

from hierarchy.model import Float64Array, UInt8Array
from hierarchy.part import Int64Array


@njit(cache=True, nogil=True)
def walk_rows(
    raw: UInt8Array, offset: int, rows: int, sizes: Int64Array, count_sizes: Int64Array, big_endian: bool
) -> tuple[Int64Array, Int64Array, int]:
    """Note where each property of each row lies.

    raw : uint8, the file; offset : byte of the first row
    sizes : (P,) bytes of an item; count_sizes : (P,) bytes of a list's count, 0 for a scalar
    Returns starts (P, rows) in bytes, counts (P, rows) in items, and the byte after the last row; -1 where a row
    runs beyond the file or has a negative count.
    """
    starts = np.empty((len(sizes), rows), np.int64)
    counts = np.ones((len(sizes), rows), np.int64)
    for row in range(rows):
        for p in range(len(sizes)):
            width = count_sizes[p]
            if width > 0:
                if offset + width > len(raw):
                    return starts, counts, -1
                count = np.int64(0)
                for b in range(width):
                    place = b if big_endian else width - 1 - b
                    count = (count << 8) | np.int64(raw[offset + place])
                # A set sign bit of a signed count makes it huge, and then it runs beyond the file.
                offset += width
                counts[p, row] = count
                if count < 0 or count > len(raw):
                    return starts, counts, -1
            starts[p, row] = offset
            offset += counts[p, row] * sizes[p]
            if offset > len(raw):
                return starts, counts, -1
    return starts, counts, offset


@njit(cache=True, nogil=True)
def gather_bytes(raw: UInt8Array, starts: Int64Array, counts: Int64Array, size: int) -> UInt8Array:
    """Copy `counts` items of `size` bytes from each of `starts`, one after another."""
    out = np.empty(counts.sum() * size, np.uint8)
    place = 0
    for row in range(len(starts)):
        for b in range(starts[row], starts[row] + counts[row] * size):
            out[place] = raw[b]
            place += 1
    return out


@njit(cache=True, nogil=True)
def walk_values(
    values: Float64Array, offset: int, rows: int, is_list: np.ndarray
) -> tuple[Int64Array, Int64Array, int]:
    """Do for a flat array of ascii values what `walk_rows` does for bytes; places are indices into `values`."""
    starts = np.empty((len(is_list), rows), np.int64)
    counts = np.ones((len(is_list), rows), np.int64)
    for row in range(rows):
        for p in range(len(is_list)):
            if is_list[p]:
                if offset >= len(values) or not 0 <= values[offset] <= len(values):
                    return starts, counts, -1
                counts[p, row] = np.int64(values[offset])
                offset += 1
            starts[p, row] = offset
            offset += counts[p, row]
            if offset > len(values):
                return starts, counts, -1
    return starts, counts, offset
