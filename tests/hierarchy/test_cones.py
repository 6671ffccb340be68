"""Normal cones hold every normal and are as narrow as brute force finds them."""

import math

import numpy as np
import pytest
from brute_cone import minimum_cap
from hypothesis import given, settings
from hypothesis import strategies as st

from hierarchy.cones import CHUNK, EVERYTHING, FEW, balls_of_chunks, bounding_cap, normal_cones, widened_cosine

LAWS = settings(derandomize=True, deadline=None, max_examples=150)

RIGHT_ANGLE = 0.5 * math.pi
# What a dot product of unit vectors is off by.
ROUNDING = 1e-15

seeds = st.integers(0, 2**32 - 1)
# From a pencil of nearly identical normals to normals all over the sphere.
spreads = st.sampled_from([1e-8, 1e-6, 1e-4, 1e-2, 0.1, 0.5, 1.0, 3.0])


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def scattered(seed, count, spread, flat=False):
    """Return normals around a random direction, within a plane through the origin if flat."""
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=(count, 3))
    middle = unit(rng.normal(size=3))
    if flat:
        across = unit(np.cross(middle, rng.normal(size=3)))
        noise = noise[:, :1] * across
    return unit(middle + spread * noise)


def cap_of(vectors):
    cap, rows = np.empty(4), np.ascontiguousarray(np.transpose(vectors), np.float64)
    bounding_cap(rows, balls_of_chunks(rows), 0, rows.shape[1], cap, np.empty((4, 3)))
    return cap[:3], cap[3]


def angles_to(axis, vectors):
    """Return angles that are accurate when small."""
    axis, vectors = unit(np.asarray(axis, float)), np.asarray(vectors, float)
    return 2.0 * np.arctan2(np.linalg.norm(vectors - axis, axis=1), np.linalg.norm(vectors + axis, axis=1))


def assert_optimal(vectors):
    axis, cosine = cap_of(vectors)
    _, expected = minimum_cap(vectors)
    assert np.linalg.norm(axis) == pytest.approx(1.0, abs=1e-9)
    if abs(expected - RIGHT_ANGLE) < 1e-6:
        # Rounding decides on which side of 90 degrees it falls.
        return
    if expected > RIGHT_ANGLE:
        assert cosine == EVERYTHING
        return
    assert 0.0 < cosine <= 1.0
    # It holds every normal, and is no wider than the optimum.
    assert (vectors @ axis >= cosine - ROUNDING).all()
    assert angles_to(axis, vectors).max() <= expected + 1e-6
    assert math.acos(cosine) == pytest.approx(expected, abs=1e-6)


@LAWS
@given(seeds, st.integers(1, 14), spreads)
def test_caps_are_those_of_brute_force(seed, count, spread):
    assert_optimal(scattered(seed, count, spread))


@LAWS
@given(seeds, st.integers(1, 10), spreads)
def test_caps_of_normals_on_one_great_circle(seed, count, spread):
    assert_optimal(scattered(seed, count, spread, flat=True))


@LAWS
@given(seeds, st.integers(2, 5), st.integers(1, 4), spreads)
def test_repeated_normals_do_not_matter(seed, count, times, spread):
    vectors = scattered(seed, count, spread)
    assert_optimal(np.repeat(vectors, times, axis=0))
    assert_optimal(np.concatenate([vectors] * times + [vectors[::-1]]))


CAPS = {
    "one": ([[0, 0, 1]], 0.0),
    "identical": ([[0, 0.6, 0.8]] * 5, 0.0),
    "two at a right angle": ([[1, 0, 0], [0, 1, 0]], 45.0),
    "collinear, on one great circle": ([[1, 0, 0], [0.8, 0.6, 0], [0.6, 0.8, 0], [0, 1, 0]], 45.0),
    "three axes": (np.eye(3), math.degrees(math.acos(3**-0.5))),
    "a flat ring": ([[math.cos(t), math.sin(t), 2.0] for t in range(7)], math.degrees(math.atan(0.5))),
    "nearly opposite": ([[1, 0, 1e-3], [-1, 0, 1e-3]], 90.0 - math.degrees(1e-3)),
    "just below a hemisphere": ([[math.cos(t), math.sin(t), 0.01] for t in range(12)], 90.0 - math.degrees(0.01)),
}


@pytest.mark.parametrize("name", CAPS)
def test_caps_that_can_be_worked_out(name):
    vectors, degrees = CAPS[name]
    axis, cosine = cap_of(unit(np.array(vectors, float)))
    assert angles_to(axis, unit(np.array(vectors, float))).max() <= math.radians(degrees) + 2e-4
    assert math.degrees(math.acos(cosine)) == pytest.approx(degrees, abs=0.01)


EVERYWHERE = {
    "opposite": [[0, 0, 1], [0, 0, -1]],
    "opposite, each twice": [[1, 0, 0], [1, 0, 0], [-1, 0, 0], [-1, 0, 0]],
    "around the equator": [[math.cos(t), math.sin(t), 0.0] for t in range(12)],
    "just over a hemisphere": [[math.cos(t), math.sin(t), -0.01 * (-1) ** t] for t in range(12)],
    "a cube's sides": np.concatenate([np.eye(3), -np.eye(3)]),
    "a tetrahedron's sides": [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]],
}


@pytest.mark.parametrize("name", EVERYWHERE)
def test_90_degrees_or_more_is_everything(name):
    _, cosine = cap_of(unit(np.array(EVERYWHERE[name], float)))
    assert cosine == EVERYTHING


@pytest.mark.parametrize("lean", [1e-3, 1e-6, 1e-9, 1e-12])
def test_nearly_identical_normals_have_a_narrow_cap(lean):
    rng = np.random.default_rng(8)
    vectors = unit(np.array([0.3, -0.5, 0.8]) + lean * rng.normal(size=(1000, 3)))
    axis, cosine = cap_of(vectors)
    assert (vectors @ axis >= cosine - ROUNDING).all()
    # A cosine cannot tell less than 1.5e-8 radians from 0.
    assert math.acos(cosine) <= 5.0 * lean + 1e-7


@LAWS
@given(seeds, st.integers(1, 4), st.integers(1, 12), spreads)
def test_stored_cones_hold_every_normal_and_are_optimal(seed, nodes, count, spread):
    normals = np.concatenate([scattered(seed + k, count, spread) for k in range(nodes)]).astype(np.float32)
    begin = np.arange(nodes, dtype=np.int32) * count
    axes, cosines = normal_cones(normals, begin, begin + count)
    assert axes.dtype == cosines.dtype == np.float32
    for node in range(nodes):
        vectors = unit(normals[begin[node] : begin[node] + count].astype(float))
        _, expected = minimum_cap(vectors)
        if cosines[node] == EVERYTHING:
            assert expected > RIGHT_ANGLE - 1e-6
            continue
        # Nothing falls out, and the cone opens by a millionth of a radian and two units of single precision at most.
        assert angles_to(axes[node], vectors).max() <= math.acos(cosines[node]) + 1e-7
        assert math.cos(expected + 1e-6) - 1.2e-7 <= cosines[node] <= 1.0


def test_ranges_may_overlap_and_nest():
    normals = unit(np.random.default_rng(3).normal(loc=[0, 0, 3], size=(40, 3))).astype(np.float32)
    begin, end = np.array([0, 0, 10, 39], np.int32), np.array([40, 20, 20, 40], np.int32)
    axes, cosines = normal_cones(normals, begin, end)
    for node in range(4):
        _, expected = minimum_cap(unit(normals[begin[node] : end[node]].astype(float)))
        assert math.acos(cosines[node]) == pytest.approx(expected, abs=4e-4)
    # Less below a node never makes its cone wider.
    assert cosines[0] <= cosines[1] <= cosines[2]
    np.testing.assert_allclose(axes[3], normals[39], atol=1e-6)


@pytest.mark.parametrize("spread", [1e-9, 1e-4, 0.1, 0.5])
def test_what_balls_leave_out_does_not_matter(spread):
    # A normal after the other along a spiral, so that chunks differ, and ranges that begin and end within them.
    turn = np.linspace(0.0, 20.0, 20 * CHUNK)
    flat = np.stack([np.cos(turn), np.sin(turn)], 1) * (spread * turn / 20.0)[:, None]
    vectors = unit(np.column_stack([flat, np.ones(len(turn))]))
    rows = np.ascontiguousarray(vectors.T)
    balls = balls_of_chunks(rows)
    inside = np.linalg.norm(vectors - np.repeat(balls[:, :3], CHUNK, axis=0), axis=1)
    assert (inside <= np.repeat(balls[:, 3], CHUNK)).all()
    for begin, end in ((0, len(turn)), (5, 5 + FEW + 1), (7, 9 * CHUNK + 3), (CHUNK - 1, 19 * CHUNK)):
        pruned, whole = np.empty(4), np.empty(4)
        bounding_cap(rows, balls, begin, end, pruned, np.empty((4, 3)))
        # Balls that leave out nothing.
        bounding_cap(rows, np.full_like(balls, 4.0), begin, end, whole, np.empty((4, 3)))
        np.testing.assert_array_equal(pruned, whole)


def test_a_hundred_thousand_identical_normals():
    normals = np.tile(np.array([0.6, 0.0, 0.8], np.float32), (100_000, 1))
    axes, cosines = normal_cones(normals, np.array([0], np.int32), np.array([100_000], np.int32))
    np.testing.assert_allclose(axes[0], [0.6, 0, 0.8], atol=1e-7)
    assert cosines[0] >= 1.0 - 1e-6


def test_float32_normals_that_are_not_quite_unit():
    normals = np.array([[0, 0, 1.0000002], [0, 0, 0.9999997]], np.float32)
    _, cosines = normal_cones(normals, np.array([0], np.int32), np.array([2], np.int32))
    assert cosines[0] == pytest.approx(1.0, abs=1e-6)


@LAWS
@given(st.floats(0.0, 1.0))
def test_widening_outweighs_rounding_to_single_precision(cosine):
    widened = np.float32(widened_cosine(cosine))
    assert widened >= 0.0
    assert max(math.cos(math.acos(cosine) + 1e-6) - 1.2e-7, 0.0) <= widened <= cosine


def test_everything_is_not_widened():
    assert widened_cosine(EVERYTHING) == EVERYTHING
