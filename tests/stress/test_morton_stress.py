"""Morton codes and Morton order at the borders of cells, against exact rational numbers."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_models import sorted_leaves

from hierarchy.model import PointCloud
from hierarchy.morton import BITS, CELLS, LONG_RUN, SAME_PLACE, morton_codes, morton_order
from hierarchy.octree import build_octree

SMALLEST = np.float32(1e-45)
LARGEST = np.float32(1e36)
# Far from each other and from the origin, which lies inside a cell of theirs and not on a border.
FAR = np.float32([[-1, -1, -1], [2, 2, 2]])


def exact_places(points: np.ndarray) -> list[tuple[Fraction, ...]]:
    """Return where points (N, 3) lie in the cube around them all, in cells."""
    rows = [[Fraction(float(v)) for v in row] for row in points]
    low = [min(row[axis] for row in rows) for axis in range(3)]
    extent = max(max(row[axis] for row in rows) - low[axis] for axis in range(3))
    scale = Fraction(CELLS) / extent if extent else Fraction(0)
    return [tuple((row[axis] - low[axis]) * scale for axis in range(3)) for row in rows]


def interleave(cell: tuple[int, ...]) -> int:
    bits = "".join(f"{x}{y}{z}" for x, y, z in zip(*(f"{v:0{BITS}b}" for v in cell), strict=True))
    return int(bits, 2)


def exact_code(place: tuple[Fraction, ...]) -> int:
    return interleave(tuple(min(math.floor(v), CELLS - 1) for v in place))


def exact_order(points: np.ndarray, which: list[int], level: int = 0) -> tuple[list[int], list[int]]:
    """Return order and steps of some of the points; the first step is of no meaning."""
    codes = dict(zip(which, map(exact_code, exact_places(points[which])), strict=True))
    if len(set(codes.values())) == 1:
        return which, [SAME_PLACE] * len(which)
    order: list[int] = []
    steps: list[int] = []
    before = None
    for code in sorted(set(codes.values())):
        below, steps_below = exact_order(points, [i for i in which if codes[i] == code], level + 1)
        first = 0 if before is None else 3 * BITS * (level + 1) - (before ^ code).bit_length()
        before = code
        order += below
        steps += [first, *steps_below[1:]]
    return order, steps


def border_points(rng: np.random.Generator, low: float, extent: float, cells: int) -> np.ndarray:
    """Return points on borders of cells, one number in single precision below and above, and all over the box."""
    shares = rng.integers(0, cells + 1, (60, 3)) / cells
    on = (low + extent * shares).astype(np.float32)
    box = np.array([[low] * 3, [low + extent] * 3])
    return np.concatenate([on, np.nextafter(on, -LARGEST), np.nextafter(on, LARGEST), box]).astype(np.float32)


def test_cells_are_exact_wherever_doubles_are(ledger, amount, rng):
    """A code's cells are those of exact numbers, save for places so near a border that a double cannot tell."""
    worst, cases = Fraction(0), 0
    for k in range(amount(20, 800)):
        low, extent = float(rng.normal()), float(2.0 ** rng.uniform(-30, 30))
        if k % 2:
            # A quarter of 3 is a border, and 2^21 / 3 times it is rounded.
            low, extent = 0.0, float(2 * rng.integers(1, 2000) + 1)
        points = border_points(rng, low, extent, int(2 ** rng.integers(1, BITS + 1)))
        for code, place in zip(morton_codes(points).tolist(), exact_places(points), strict=True):
            cells = [int(f"{code:063b}"[axis::3], 2) for axis in range(3)]
            # The last cell holds its upper border, too.
            outside = [max(cell - v, v - cell - 1, 0) for cell, v in zip(cells, place, strict=True)]
            worst, cases = max(worst, *outside), cases + 1
    ledger.record(
        "kernels", "Morton cells", "points on the borders of cells and one float32 beside them, boxes of any size",
        cases=cases, worst=float(worst), bound=CELLS * 3 * 2.0**-53, unit="cells",
    )  # fmt: skip


@pytest.mark.parametrize(
    "points",
    [
        [[0.0, -0.0, 0.0], [-0.0, 0.0, -0.0], [0.0, 0.0, 0.0]],
        [[-0.0, 0, 0], [SMALLEST, 0, 0], [-SMALLEST, -0.0, 0]],
        [[0, 0, 0], [SMALLEST, SMALLEST, SMALLEST]],
        [[-LARGEST] * 3, [LARGEST] * 3, [0, -0.0, SMALLEST], [0, 0, 0], [SMALLEST, 0, 0]],
        [[1, 2, 3], [1, 2, np.nextafter(np.float32(3), np.float32(4))], [1, 2, 3]],
        [[5, 0, 7], [5, 1, 7], [5, 0.5, 7], [5, 0.25, 7]],
        [[0, 0, 0], [1, 1, 1], [np.nextafter(np.float32(1), np.float32(0))] * 3],
    ],
    ids=[
        "minus zero",
        "denormals at zero",
        "a denormal box",
        "all that float32 holds",
        "one ulp",
        "a line",
        "a corner",
    ],
)
def test_extreme_boxes_are_sorted_exactly(points):
    positions = np.array(points, np.float32)
    with np.errstate(all="raise"):
        order, steps = morton_order(positions)
    expected_order, expected_steps = exact_order(positions, list(range(len(positions))))
    assert order.tolist() == expected_order
    assert steps[1:].tolist() == expected_steps[1:]


def test_the_upper_faces_of_the_box_do_not_spill_into_the_next_axis(rng):
    for extent in 2.0 ** rng.uniform(-40, 40, 200):
        points = np.array([[0, 0, 0], [extent] * 3, [extent, 0, 0], [0, extent, 0], [0, 0, extent]], np.float32)
        last = CELLS - 1
        cells = [(0, 0, 0), (last, last, last), (last, 0, 0), (0, last, 0), (0, 0, last)]
        assert morton_codes(points).tolist() == [interleave(cell) for cell in cells]


def test_clusters_in_clusters_are_sorted_to_the_last_bit(ledger, amount, laws):
    # Every point is a sum of a few powers of two, so that exact cells and those of doubles agree.
    exponents = st.lists(st.integers(-120, 0), min_size=0, max_size=2)
    coordinate = exponents.map(lambda drawn: float(np.float32(sum(2.0**e for e in drawn))))
    tried = []

    @laws
    @given(st.lists(st.tuples(coordinate, coordinate, coordinate), min_size=1, max_size=12))
    def law(rows):
        points = np.array([[-1, -1, -1], [1, 1, 1], *rows], np.float32)
        order, steps = morton_order(points)
        assert sorted(order.tolist()) == list(range(len(points)))
        for a, b, step in zip(order[:-1], order[1:], steps[1:], strict=True):
            # Points share all cells only where they are the same, and then they keep their order.
            assert (step == SAME_PLACE) == bool((points[a] == points[b]).all())
            assert step != SAME_PLACE or a < b
        # A box of [-1, 1] has cells of powers of two at the first level; below, boxes are what they are.
        first = [3 * BITS - 1 if s >= 3 * BITS else int(s) for s in steps[1:]]
        codes = [exact_code(place) for place in exact_places(points[order])]
        expected = [min(3 * BITS - (a ^ b).bit_length(), 3 * BITS - 1) for a, b in pairwise(codes)]
        assert first == expected
        tried.append(len(points))

    law()
    ledger.record(
        "kernels", "Morton order", "clusters in clusters down to 2^-120 of the box, equal points",
        cases=len(tried), worst=0, bound=0, unit="points out of order",
    )  # fmt: skip


@pytest.mark.parametrize("count", [1000, 3 * LONG_RUN])
def test_a_cluster_between_far_outliers_is_sorted_like_itself_alone(rng, count):
    # Short runs are refined by one kernel, long ones by numpy's sort: both to the same order.
    cluster = (1e-9 * rng.normal(size=(count, 3))).astype(np.float32)
    cluster[::7] = cluster[3]
    order, steps = morton_order(np.concatenate([cluster, FAR]))
    alone, steps_alone = morton_order(cluster)
    assert order[0] == count
    assert order[-1] == count + 1
    np.testing.assert_array_equal(order[1:-1], alone)
    # All in one cell of the first level, which adds a code before theirs.
    same = steps_alone[1:] == SAME_PLACE
    np.testing.assert_array_equal(steps[2:-1][same], SAME_PLACE)
    np.testing.assert_array_equal(steps[2:-1][~same], steps_alone[1:][~same] + 3 * BITS)


def test_a_cluster_between_far_outliers_has_a_tree_like_its_own(rng):
    # Before, all of it lay in one cell and was halved by number: nodes of neighbouring numbers, not of neighbours.
    cluster = (1e-9 * rng.uniform(-1.0, 1.0, (5000, 3))).astype(np.float32)
    points = np.concatenate([cluster, FAR])
    sizes = []
    for positions in (cluster, points):
        unit = np.tile(np.float32([0, 0, 1]), (len(positions), 1))
        surfels, _, steps = sorted_leaves(
            PointCloud("model", np.zeros(3), positions, unit, np.ones(len(positions), "f4"))
        )
        octree = build_octree(steps)
        ranges = [(b, e) for b, e in zip(octree.leaf_begin, octree.leaf_end, strict=True) if 8 <= e - b < 64]
        sizes.append(np.median([np.ptp(surfels.positions[b:e], axis=0).max() for b, e in ranges]))
    assert sizes[1] == sizes[0]
