"""Sorting 64-bit codes: by their digits, the lowest first, every pass on all cores.

Based on: Knuth, "The Art of Computer Programming" vol. 3, 5.2.5 (distribution counting). Each pass counts the digits of
every piece of the codes first, so that each piece knows where its own go, and equal digits stay in their order. The
time depends on the number of codes alone, however they lie.
"""

from __future__ import annotations

import numba as nb
import numpy as np
import numpy.typing as npt

from hierarchy.model import Int32Array

# Six digits of 11 bits are 66. Their 2048 counters and the ends of as many runs stay in a core's own cache.
DIGIT_BITS = 11
DIGITS = 6
BUCKETS = 1 << DIGIT_BITS
# Pieces that threads count and move, and codes from which a piece of its own is worth its counters.
PIECES = 16
PIECE = 1 << 14


@nb.njit(cache=True, nogil=True, inline="always")
def _digit(code, shift):  # type: ignore[no-untyped-def]
    return np.int64((code >> shift) & np.uint64(BUCKETS - 1))


@nb.njit(cache=True, nogil=True, parallel=True)
def _sort(codes, order, spare_codes, spare_order):  # type: ignore[no-untyped-def]
    count = len(codes)
    pieces = min(PIECES, count // PIECE + 1)
    size = -(-count // pieces)
    places = np.empty((pieces, BUCKETS), np.int64)
    for digit in range(DIGITS):
        shift = np.uint64(digit * DIGIT_BITS)
        for piece in nb.prange(pieces):
            places[piece] = 0
            for i in range(piece * size, min((piece + 1) * size, count)):
                places[piece, _digit(codes[i], shift)] += 1
        # From counts to where the first of each piece goes.
        place = most = 0
        for bucket in range(BUCKETS):
            first = place
            for piece in range(pieces):
                counted = places[piece, bucket]
                places[piece, bucket] = place
                place += counted
            most = max(most, place - first)
        if most == count:
            # All codes have the same digit.
            continue
        for piece in nb.prange(pieces):
            for i in range(piece * size, min((piece + 1) * size, count)):
                bucket = _digit(codes[i], shift)
                to = places[piece, bucket]
                places[piece, bucket] = to + 1
                spare_codes[to], spare_order[to] = codes[i], order[i]
        codes, spare_codes = spare_codes, codes
        order, spare_order = spare_order, order
    return order, codes


def sort_codes(codes: npt.NDArray[np.uint64]) -> tuple[Int32Array, npt.NDArray[np.uint64]]:
    """Sort codes; equal ones stay in the order in which they come.

    codes : uint64 (N,), N < 2^31; used to work in, so of no meaning afterwards
    Returns the order, int32 (N,), and the sorted codes, uint64 (N,).
    """
    order = np.arange(len(codes), dtype=np.int32)
    return _sort(codes, order, np.empty_like(codes), np.empty_like(order))  # type: ignore[no-any-return]
