"""The exact steps of the enclosing circle and cap, on at most four points, against brute force."""

import numpy as np
import pytest
from brute_circle import minimum_circle
from brute_cone import minimum_cap
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from hierarchy.enclosing import cap_with_pivot, circle_with_pivot

LAWS = settings(derandomize=True, deadline=None, max_examples=150)

# How close together the points are, from all over to nearly identical.
spreads = st.sampled_from([1.0, 0.1, 1e-3, 1e-6])
seeds = st.integers(0, 2**32 - 1)


def circle_step(points):
    support, circle = np.zeros((4, 2)), np.zeros(3)
    support[: len(points)] = points
    count = circle_with_pivot(support, len(points), circle)
    return support[:count], circle


def cap_step(vectors):
    support, cap = np.zeros((4, 3)), np.zeros(4)
    support[: len(vectors)] = vectors
    count = cap_with_pivot(support, len(vectors), cap)
    # The last is a squared distance from the axis; here, its cosine.
    return support[:count], np.append(cap[:3], 1.0 - 0.5 * cap[3])


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


@LAWS
@given(seeds, st.integers(2, 4), spreads)
def test_circle_with_pivot_is_the_smallest_around_all(seed, count, spread):
    points = spread * np.random.default_rng(seed).normal(loc=3.0, size=(count, 2))
    # The pivot lies outside the circle of the others: only then it is on the rim of the circle of all.
    centre, radius = minimum_circle(points[:-1])
    assume(np.linalg.norm(points[-1] - centre) > radius * 1.001)
    support, circle = circle_step(points)
    _, expected = minimum_circle(points)
    assert np.sqrt(circle[2]) == pytest.approx(expected, rel=1e-6)
    # The support is some of the points, the pivot first, and all of it is on the rim.
    np.testing.assert_array_equal(support[0], points[-1])
    assert 2 <= len(support) <= 3
    assert all((point == points).all(axis=1).any() for point in support)
    distances = np.linalg.norm(support - circle[:2], axis=1)
    np.testing.assert_allclose(distances, np.sqrt(circle[2]), rtol=1e-6)


@pytest.mark.parametrize(
    ("points", "support", "circle"),
    [
        ([[0, 0], [2, 0]], 2, (1, 0, 1)),
        ([[0, 0], [1, 0], [4, 0]], 2, (2, 0, 4)),  # collinear
        ([[0, 0], [0, 0], [4, 0]], 2, (2, 0, 4)),  # two identical
        ([[0, 0], [2, 0], [1, 5]], 3, (1, 2.4, 6.76)),
        ([[-1, 0], [1, 0], [0, -1], [0, 1]], 2, (0, 0, 1)),  # four on one circle
    ],
)
def test_circles_that_can_be_worked_out(points, support, circle):
    found, result = circle_step(np.array(points, float))
    np.testing.assert_allclose(result, circle, atol=1e-12)
    assert len(found) == support


@LAWS
@given(seeds, st.integers(2, 4), st.sampled_from([1.0, 0.3, 1e-2, 1e-4]))
def test_cap_with_pivot_is_the_smallest_around_all(seed, count, spread):
    rng = np.random.default_rng(seed)
    vectors = unit(unit(rng.normal(size=3)) + spread * rng.normal(size=(count, 3)))
    axis, angle = minimum_cap(vectors[:-1])
    assume(2.0 * np.arcsin(0.5 * np.linalg.norm(vectors[-1] - axis)) > angle * 1.001)
    _, expected = minimum_cap(vectors)
    assume(expected < np.radians(89.9))
    support, cap = cap_step(vectors)
    assert np.linalg.norm(cap[:3]) == pytest.approx(1.0, abs=1e-12)
    largest = 2.0 * np.arcsin(0.5 * np.linalg.norm(vectors - cap[:3], axis=1)).max()
    assert largest == pytest.approx(expected, rel=1e-5, abs=1e-7)
    assert np.arccos(min(cap[3], 1.0)) == pytest.approx(expected, abs=3e-7)
    np.testing.assert_array_equal(support[0], vectors[-1])
    assert 2 <= len(support) <= 3
    np.testing.assert_allclose(support @ cap[:3], cap[3], atol=1e-12)


@pytest.mark.parametrize(
    "vectors",
    [
        [[1, 0, 0], [-1, 0, 0]],  # opposite
        [[1, 0, 0], [-0.5, 0.75**0.5, 0], [-0.5, -(0.75**0.5), 0]],  # around the equator
        [[1, 0, 0], [0, 0, 1], [-0.6, 0.8, 0], [-0.3, -0.9, -(0.1**0.5)]],  # all around
    ],
)
def test_no_cap_below_90_degrees(vectors):
    support, _ = cap_step(np.array(vectors, float))
    assert len(support) == 0


def test_three_axes_share_the_cap_around_their_diagonal():
    support, cap = cap_step(np.eye(3))
    np.testing.assert_allclose(cap, np.full(4, 3**-0.5), atol=1e-12)
    assert len(support) == 3
