"""Morton codes against interleaving bit by bit."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hierarchy.morton import BITS, CELLS, morton_codes, spread_bits

LAWS = settings(derandomize=True, deadline=None, max_examples=150)

coordinates = st.one_of(
    st.floats(-1e6, 1e6, width=32), st.floats(-1.0, 1.0, width=32), st.sampled_from([0.0, -0.0, 1.0, -1.0, 0.5])
)
points = st.lists(st.tuples(coordinates, coordinates, coordinates), min_size=1, max_size=40).map(
    lambda rows: np.array(rows, np.float32)
)


def cells_of(positions):
    """Return the cells, Python integers, of positions in the cube around them all."""
    low = positions.astype(np.float64).min(axis=0)
    extent = (positions.astype(np.float64).max(axis=0) - low).max()
    if extent == 0.0:
        return [(0, 0, 0)] * len(positions)
    return [tuple(min(int(v), CELLS - 1) for v in (row - low) * (CELLS / extent)) for row in positions.astype(float)]


def interleave(cell):
    """Return x y z x y z ... from the highest bit down."""
    bits = "".join(f"{x}{y}{z}" for x, y, z in zip(*(f"{v:0{BITS}b}" for v in cell), strict=True))
    return int(bits, 2)


@LAWS
@given(points)
def test_codes_are_the_interleaved_cells(positions):
    expected = [interleave(cell) for cell in cells_of(positions)]
    codes = morton_codes(positions)
    assert codes.dtype == np.uint64
    assert codes.tolist() == expected
    # So the order is the same, too.
    by_code = np.argsort(codes, kind="stable")
    assert by_code.tolist() == sorted(range(len(positions)), key=expected.__getitem__)


@LAWS
@given(st.integers(0, CELLS - 1))
def test_spread_bits_puts_two_zeros_before_every_bit(value):
    assert int(spread_bits(np.uint64(value))) == interleave((0, 0, value))


@LAWS
@given(st.integers(0, 2**32 - 1))
def test_cells_are_nested(seed):
    """Points that share a cell of some level are contiguous in the order."""
    positions = np.random.default_rng(seed).uniform(-3.0, 5.0, (200, 3)).astype(np.float32)
    order = np.argsort(morton_codes(positions))
    cells = np.array(cells_of(positions))[order]
    for level in range(1, 5):
        coarse = cells >> (BITS - level)
        changes = 1 + (np.diff(coarse, axis=0) != 0).any(axis=1).sum()
        assert changes == len(np.unique(coarse, axis=0))


def test_borders_fall_into_the_first_and_the_last_cell():
    codes = morton_codes(np.array([[-1, -1, -1], [1, 1, 1], [-1, 1, -1]], np.float32))
    assert codes.tolist() == [0, 8**BITS - 1, interleave((0, CELLS - 1, 0))]


def test_the_longest_side_sets_the_cells_of_a_flat_model():
    codes = morton_codes(np.array([[0, 0, 5], [8, 0, 5], [0, 2, 5]], np.float32))
    assert codes.tolist() == [0, interleave((CELLS - 1, 0, 0)), interleave((0, CELLS // 4, 0))]


def test_x_is_the_highest_axis():
    codes = morton_codes(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32))
    assert codes[1] > codes[2] > codes[3] > codes[0] == 0


@pytest.mark.parametrize("count", [1, 2, 1000])
def test_identical_points_share_the_first_cell(count):
    assert not morton_codes(np.full((count, 3), 3.25, np.float32)).any()


def test_no_points():
    codes = morton_codes(np.empty((0, 3), np.float32))
    assert codes.dtype == np.uint64
    assert len(codes) == 0


@pytest.mark.parametrize("exponent", [-120, -60, 60, 126])
def test_extreme_scales_give_the_codes_of_ordinary_ones(exponent):
    positions = np.random.default_rng(4).uniform(-1.0, 1.0, (50, 3)).astype(np.float32)
    # A power of two scales single precision exactly.
    scaled = np.ldexp(positions, exponent)
    assert np.isfinite(scaled).all()
    np.testing.assert_array_equal(morton_codes(scaled), morton_codes(positions))
