"""What a frame draws of a hierarchy's arrays: rows that lie far apart, gathered side by side."""

from __future__ import annotations

import numba as nb
import numpy as np

from hierarchy.hierarchy import SPLAT, Hierarchy
from hierarchy.model import UInt32Array
from hierarchy.prefetch import prefetch

# Rows of which the next but so many is fetched from memory.
AHEAD = 16


# By one thread: a second one has to wait for a core that a software renderer is erasing the last frame on, and the
# first one for it; frames took 1.1 times as long.
@nb.njit(cache=True, nogil=True)
def _gather(table, numbers, below, otherwise, repeats, rows):  # type: ignore[no-untyped-def]
    count = len(numbers)
    for k in range(count):
        ahead = numbers[min(k + AHEAD, count - 1)]
        if ahead < below:
            prefetch(table, ahead)
        number = numbers[k]
        for copy in range(k * repeats, (k + 1) * repeats):
            for word in range(table.shape[1]):
                rows[copy, word] = table[number, word] if number < below else otherwise[word]


def gather_rows(
    table: np.ndarray, numbers: UInt32Array, otherwise: tuple[int, ...], *, below: int | None = None, repeats: int = 1
) -> np.ndarray:
    """Return rows of a table of words of 4 bytes, (M, W), in the order of their numbers: (repeats * K, W).

    numbers : uint32 (K,)
    otherwise : of W words, what stands in place of a row whose number is not below `below`, None: M
    repeats : how often each row is written
    """
    below = len(table) if below is None else below
    rows = np.empty((repeats * len(numbers), table.shape[1]), table.dtype)
    _gather(table, numbers, below, np.array(otherwise, table.dtype), repeats, rows)
    return rows


def records_of(hierarchy: Hierarchy, splats: UInt32Array) -> np.ndarray:
    """Return the records of splats with some numbers, uint32 (K,), side by side: SPLAT (K,)."""
    words = SPLAT.itemsize // 4
    table = hierarchy.splats.view(np.int32).reshape(-1, words)
    records: np.ndarray = gather_rows(table, splats, (0,) * words).view(SPLAT)[:, 0]
    return records
