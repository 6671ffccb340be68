"""The larger and the smaller of two floats, and that the largest of many is found several at a time."""

import time

import numba as nb
import numpy as np
import pytest

from hierarchy.borrowing import BORROWING
from hierarchy.extremes import NEVER_NAN, larger, smaller


@nb.njit(**BORROWING, fastmath=NEVER_NAN)
def ends(values):
    low = high = values[0]
    for i in range(len(values)):
        low, high = smaller(low, values[i]), larger(high, values[i])
    return low, high


@nb.njit(**BORROWING)
def ends_one_by_one(values):
    low = high = values[0]
    for i in range(len(values)):
        low, high = min(low, values[i]), max(high, values[i])
    return low, high


@pytest.mark.parametrize("kind", [np.float32, np.float64])
@pytest.mark.parametrize("count", [1, 2, 7, 8, 9, 63, 64, 1000])
def test_ends_are_those_of_numpy(kind, count):
    rng = np.random.default_rng(count)
    for scale in (1e-30, 1.0, 1e30):
        values = (scale * rng.normal(size=count)).astype(kind)
        low, high = ends(values)
        assert (low, high) == (values.min(), values.max())
    assert ends(np.array([0.0, np.inf, -np.inf], kind)) == (-np.inf, np.inf)


def test_numbers_of_two_kinds_are_not_compared():
    @nb.njit
    def mixed(one, other):
        return larger(one, other)

    with pytest.raises(nb.TypingError):
        mixed(np.float32(1.0), 1.0)


def test_many_are_faster_than_one_by_one():
    """Nine times here: what these functions are for."""
    values = np.random.default_rng(1).normal(size=1 << 16)
    times = {}
    for find in (ends, ends_one_by_one):
        find(values)
        measured = []
        for _ in range(15):
            begin = time.perf_counter()
            find(values)
            measured.append(time.perf_counter() - begin)
        times[find] = min(measured)
    assert 2.0 * times[ends] < times[ends_one_by_one]
