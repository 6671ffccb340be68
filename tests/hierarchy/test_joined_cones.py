"""Joined cones hold what they are joined of."""

import numpy as np
import pytest

from hierarchy.cones import EVERYTHING, balls_of_chunks, bounding_cap
from hierarchy.joined_cones import SLACK, cap_holds, join_cone, join_farthest_first, join_vector


def test_a_joined_cone_holds_both():
    rng = np.random.default_rng(5)
    for _ in range(300):
        axes = rng.normal(size=(2, 3))
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        halves = rng.uniform(0.0, 0.7, 2)
        cap = np.array([*axes[0], np.cos(halves[0])])
        join_cone(cap, *(2.0 * axes[1]), np.cos(halves[1]), np.sin(halves[1]))
        if cap[3] == EVERYTHING:
            between = np.arccos(np.clip(axes[0] @ axes[1], -1.0, 1.0))
            assert between + halves.sum() >= np.pi - 1e-6
            continue
        assert np.linalg.norm(cap[:3]) == pytest.approx(1.0)
        for axis, half in zip(axes, halves, strict=True):
            assert np.arccos(np.clip(cap[:3] @ axis, -1.0, 1.0)) + half <= np.arccos(cap[3]) + 1e-7


def test_a_cap_holds_itself_and_not_what_lies_opposite():
    cap = np.array([0.0, 0.0, 1.0, np.cos(0.5)])
    assert cap_holds(cap, 0.0, 0.0, 1.0, np.cos(0.5), np.sin(0.5))
    assert cap_holds(cap, np.sin(0.2), 0.0, np.cos(0.2), np.cos(0.3), np.sin(0.3))
    assert not cap_holds(cap, np.sin(0.2), 0.0, np.cos(0.2), np.cos(0.31), np.sin(0.31))
    # 180 degrees and 90 more: as far as 90 on the other side.
    assert not cap_holds(np.array([0.0, 0.0, 1.0, 0.0]), 0.0, 0.0, -1.0, 0.0, 1.0)
    assert not cap_holds(cap, 0.0, 0.0, 1.0, EVERYTHING, 0.0)
    assert cap_holds(np.array([0.0, 0.0, 1.0, EVERYTHING]), 0.0, 0.0, -1.0, 0.0, 1.0)


def test_farthest_first_is_hardly_wider_than_the_smallest():
    rng = np.random.default_rng(6)
    ratios = []
    for _ in range(300):
        spread = rng.uniform(0.01, 0.5)
        vectors = [0.0, 0.0, 1.0] + spread * rng.normal(size=(rng.integers(2, 60), 3))
        vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
        few, smallest = np.empty(4), np.empty(4)
        rows = np.ascontiguousarray(vectors.T)
        balls = balls_of_chunks(rows)
        bounding_cap(rows, balls, 0, 2, few, np.empty((4, 3)))
        bounding_cap(rows, balls, 0, len(vectors), smallest, np.empty((4, 3)))
        join_farthest_first(few, vectors)
        if smallest[3] < np.cos(1.2):
            continue
        assert (vectors @ few[:3]).min() >= few[3] - 1e-12
        ratios.append(np.arccos(few[3]) / np.arccos(smallest[3]))
    assert len(ratios) > 200
    assert np.mean(ratios) < 1.06
    assert max(ratios) < 1.25


@pytest.mark.parametrize("half", [0.0, 1e-9, 1e-4, 0.3, 1.2, 1.5707])
@pytest.mark.parametrize("off", [1e-12, 1e-8, 1e-4, 0.1, 1.0, 1.5, 3.0])
def test_a_cap_with_a_vector_is_that_with_a_cone_of_no_width(half, off):
    rng = np.random.default_rng(7)
    for _ in range(30):
        (axis, across), angle = np.linalg.qr(rng.normal(size=(3, 2)))[0].T, min(half + off, np.pi)
        vector = np.cos(angle) * axis + np.sin(angle) * across
        cap, as_cone = np.array([*axis, np.cos(half)]), np.array([*axis, np.cos(half)])
        if axis @ vector >= cap[3]:
            # Rounding has moved it inside.
            continue
        join_vector(cap, *vector)
        join_cone(as_cone, *vector, 1.0, 0.0)
        assert (cap[3] == EVERYTHING) == (as_cone[3] == EVERYTHING)
        if cap[3] != EVERYTHING:
            assert np.arccos(min(cap[3], 1.0)) == pytest.approx(np.arccos(min(as_cone[3], 1.0)), abs=1.2 * SLACK)
            assert np.linalg.norm(cap[:3] - as_cone[:3]) < SLACK
            assert cap[:3] @ vector >= cap[3] - 1e-15
            # The old cap's far end, too.
            assert cap[:3] @ (np.cos(half) * axis - np.sin(half) * across) >= cap[3] - 1e-15
