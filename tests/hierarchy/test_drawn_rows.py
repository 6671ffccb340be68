import numpy as np
import pytest

from hierarchy.build import build_hierarchy
from hierarchy.drawn_rows import gather_rows, records_of
from hierarchy.meteoroid import make_meteoroid


@pytest.mark.parametrize("count", [0, 1, 5, 3000])
@pytest.mark.parametrize("repeats", [1, 4])
@pytest.mark.parametrize("below", [None, 0, 60])
def test_rows_are_gathered_in_order(count, repeats, below):
    rng = np.random.default_rng(count)
    table = rng.integers(-1000, 1000, (100, 3), np.int32)
    # Beyond the table lie those that have no row.
    numbers = rng.integers(0, 200, count).astype(np.uint32)
    found = gather_rows(table, numbers, (-1, 7, 0), below=below, repeats=repeats)
    has_row = numbers < (100 if below is None else below)
    expected = np.where(has_row[:, None], table[np.minimum(numbers, 99)], [-1, 7, 0])
    np.testing.assert_array_equal(found, np.repeat(expected, repeats, axis=0))
    assert found.dtype == np.int32


def test_records_are_those_of_the_splats():
    hierarchy = build_hierarchy(make_meteoroid(2_000))
    numbers = np.random.default_rng(3).permutation(len(hierarchy.splats)).astype(np.uint32)
    np.testing.assert_array_equal(records_of(hierarchy, numbers), hierarchy.splats[numbers])
