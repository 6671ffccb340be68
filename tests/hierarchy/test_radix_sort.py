"""Sorted codes against numpy's stable sort."""

import numpy as np
import pytest

from hierarchy.radix_sort import PIECE, PIECES, sort_codes

CODES = {
    "all over": lambda rng, n: rng.integers(0, 2**63, n, dtype=np.uint64),
    "the highest bit, too": lambda rng, n: rng.integers(0, 2**64, n, dtype=np.uint64),
    "few": lambda rng, n: rng.integers(0, 3, n).astype(np.uint64) << np.uint64(40),
    "all the same": lambda rng, n: np.full(n, 2**62 + 5, np.uint64),
    "one bit apart": lambda rng, n: np.uint64(1) << rng.integers(0, 64, n).astype(np.uint64),
    "falling": lambda rng, n: np.arange(n, dtype=np.uint64)[::-1] << np.uint64(9),
}


@pytest.mark.parametrize("kind", CODES)
@pytest.mark.parametrize("count", [0, 1, 2, 1000, PIECE, 3 * PIECE + 7, (PIECES + 1) * PIECE + 1])
def test_codes_are_sorted_and_equal_ones_stay_in_order(kind, count):
    codes = CODES[kind](np.random.default_rng(count), count)
    order, found = sort_codes(codes.copy())
    assert order.dtype == np.int32
    np.testing.assert_array_equal(order, np.argsort(codes, kind="stable"))
    np.testing.assert_array_equal(found, np.sort(codes))
