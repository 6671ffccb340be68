"""Find equal rows with a hash table: welding positions, duplicate points, identical vertices."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from hierarchy.model import Float32Array, Int32Array


def unique_rows(rows: npt.NDArray[np.uint32]) -> tuple[Int32Array, Int32Array]:
    """Number the distinct rows in the order in which they first appear.

    rows : uint32 (N, K), compared bit by bit
    Returns inverse int32 (N,), the number of each row, and first int32 (U,), the first row of each number.
    """
    inverse, first = _unique_rows(np.ascontiguousarray(rows, np.uint32))
    return inverse, first


def unique_positions(positions: Float32Array) -> tuple[Int32Array, Int32Array]:
    """Do `unique_rows` for finite positions float32 (N, 3), to which 0 and -0 are the same."""
    return unique_rows((positions + np.float32(0.0)).view(np.uint32))


@njit(cache=True, nogil=True)
def _unique_rows(rows: npt.NDArray[np.uint32]) -> tuple[Int32Array, Int32Array]:
    n, width = rows.shape
    # At most half full, so that linear probing stays short.
    capacity = 16
    while capacity < 2 * n:
        capacity *= 2
    mask = np.uint64(capacity - 1)
    table = np.full(capacity, -1, np.int32)
    inverse = np.empty(n, np.int32)
    first = np.empty(n, np.int32)
    unique = 0
    for i in range(n):
        # FNV-1a over words, then the finaliser of MurmurHash3: low bits of floats are often zero.
        h = np.uint64(14695981039346656037)
        for k in range(width):
            h = (h ^ np.uint64(rows[i, k])) * np.uint64(1099511628211)
        h = (h ^ (h >> np.uint64(33))) * np.uint64(0xFF51AFD7ED558CCD)
        h ^= h >> np.uint64(33)
        slot = h & mask
        while True:
            number = table[slot]
            if number < 0:
                table[slot] = unique
                first[unique] = i
                inverse[i] = unique
                unique += 1
                break
            same = True
            for k in range(width):
                if rows[first[number], k] != rows[i, k]:
                    same = False
                    break
            if same:
                inverse[i] = number
                break
            slot = (slot + np.uint64(1)) & mask
    return inverse, first[:unique].copy()
