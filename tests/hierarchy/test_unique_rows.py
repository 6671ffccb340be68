import numpy as np
import pytest

from hierarchy.unique_rows import unique_positions, unique_rows


@pytest.mark.parametrize(("rows", "values"), [(0, 3), (1, 3), (1000, 3), (20_000, 12)])
def test_numbers_group_equal_rows_as_numpy_does(rows, values):
    table = np.random.default_rng(1).integers(0, values, (rows, 3)).astype(np.uint32)
    inverse, first = unique_rows(table)
    assert len(first) == len(np.unique(table, axis=0))
    np.testing.assert_array_equal(table[first][inverse], table)


def test_numbers_run_in_the_order_of_first_appearance():
    inverse, first = unique_rows(np.array([[7], [3], [7], [9], [3]], np.uint32))
    assert inverse.tolist() == [0, 1, 0, 2, 1]
    assert first.tolist() == [0, 1, 3]


def test_both_zeros_are_one_position():
    positions = np.array([[0.0, 1.0, 2.0], [-0.0, 1.0, 2.0], [0.0, 1.0, np.nextafter(np.float32(2.0), 3)]], np.float32)
    assert unique_positions(positions)[0].tolist() == [0, 0, 1]


def test_rows_that_differ_in_high_bits_only_stay_short_to_find():
    # Whole numbers as float32 have 12 or more zero bits at the low end.
    grid = np.stack(np.meshgrid(*[np.arange(64, dtype=np.float32)] * 3), -1).reshape(-1, 3)
    inverse, _ = unique_positions(np.ascontiguousarray(grid))
    np.testing.assert_array_equal(inverse, np.arange(len(grid)))
