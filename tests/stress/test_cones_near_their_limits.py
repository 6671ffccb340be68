"""Normal cones from identical to opposite normals: every normal inside, no wider than the optimum, and never a number
that is none.

A cosine has a rounding of some 4e-16 and the search stops within 2e-15, which together are 8e-8 radians where a cone is
narrow and 3e-15 where it is wide. Stored in float32 a cosine costs 9e-8 more at most, which is 4.3e-4 radians for the
narrowest cones, and the leaning of the axis 4e-7 radians.
"""

import math

import numpy as np
import pytest
from brute_cone import minimum_cap
from hypothesis import given
from hypothesis import strategies as st

from hierarchy.cones import EVERYTHING, balls_of_chunks, bounding_cap, normal_cones, widened_cosine

COSINE = 3e-15
STORED_COSINE = 9.5e-8
STORED_AXIS = 4.1e-7


@pytest.fixture(autouse=True)
def no_float_errors():
    with np.errstate(all="raise", under="ignore"):
        yield


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def turns(rng, count):
    """Return random rotations (count, 3, 3)."""
    turned = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]
    return turned * np.linalg.det(turned)[:, None, None]


def angles(axis, vectors):
    axis = unit(np.asarray(axis, np.float64))
    return 2.0 * np.arctan2(np.linalg.norm(vectors - axis, axis=-1), np.linalg.norm(vectors + axis, axis=-1))


def cap_of(vectors):
    cap, rows = np.empty(4), np.ascontiguousarray(np.transpose(vectors))
    bounding_cap(rows, balls_of_chunks(rows), 0, rows.shape[1], cap, np.empty((4, 3)))
    return cap[:3].copy(), cap[3]


def excess(vectors, half_angle):
    """Return by how many times what a cosine may be off by a cap is wider than its half-angle should be.

    Infinite where a vector is outside, or where it is said to hold everything for no reason.
    """
    axis, cosine = cap_of(vectors)
    assert np.isfinite(axis).all()
    if cosine == EVERYTHING:
        return 0.0 if half_angle >= 0.5 * math.pi - 1e-14 else math.inf
    if (vectors @ axis).min() < cosine - 1e-15:
        return math.inf
    return (math.cos(half_angle) - cosine) / COSINE


def ring(rng, count, half_angle):
    """Return vectors (N, 3) on a circle around +z, three of them spread so that no smaller cap holds them."""
    azimuth = rng.uniform(0.0, 2.0 * math.pi, max(count, 3))
    azimuth[:3] = rng.uniform(0.0, 2.0 * math.pi) + np.array([0.0, 2.0, 4.0]) + rng.uniform(-0.1, 0.1, 3)
    s, c = math.sin(half_angle), math.cos(half_angle)
    return rng.permutation(np.stack([s * np.cos(azimuth), s * np.sin(azimuth), np.full(len(azimuth), c)], axis=1))


def arc(rng, count, half_angle):
    """Return vectors on one great circle, the outermost at both half-angles from +z."""
    angle = rng.uniform(-half_angle, half_angle, max(count, 2))
    angle[:2] = -half_angle, half_angle
    return rng.permutation(np.stack([np.sin(angle), np.zeros(len(angle)), np.cos(angle)], axis=1))


def filled(rng, count, half_angle):
    """Return vectors all over a cap, three of them on its rim."""
    inside = np.concatenate([ring(rng, 3, half_angle * share) for share in rng.uniform(0.0, 1.0, 1 + count // 3)])
    return rng.permutation(np.concatenate([ring(rng, 3, half_angle), inside]))


KINDS = {"on a circle": ring, "on a great circle": arc, "all over a cap": filled}


@pytest.mark.parametrize("kind", KINDS)
def test_caps_of_known_half_angles(ledger, amount, rng, kind):
    """From 1e-15 radians to 90 degrees less 1e-13."""
    worst = 0.0
    count = amount(600, 12_000)
    sizes = rng.choice([2, 3, 4, 7, 20, 60], count)
    ends = 10.0 ** rng.uniform(-15.0, 0.0, count)
    for k, turn in enumerate(turns(rng, count)):
        half_angle = ends[k] if k % 2 else 0.5 * math.pi - max(ends[k], 1e-13)
        vectors = unit(KINDS[kind](rng, int(sizes[k]), half_angle) @ turn.T)
        worst = max(worst, excess(vectors, half_angle))
    ledger.record(
        "kernels",
        "optimal cones",
        "2 to 60 normals on a circle, on a great circle and all over a cap; half-angles from 1e-15 to 90 degrees less "
        "1e-13 radians; random ones against brute force; all inside",
        cases=count,
        worst=worst * COSINE,
        bound=COSINE,
        unit="too low a cosine",
    )


def test_caps_of_random_normals_are_those_of_brute_force(ledger, amount, rng):
    worst, count = 0.0, amount(150, 3_000)
    for _ in range(count):
        spread = 10.0 ** rng.uniform(-9.0, 0.7)
        vectors = unit(unit(rng.normal(size=3)) + spread * rng.normal(size=(rng.integers(1, 9), 3)))
        vectors = rng.permutation(np.repeat(vectors, rng.integers(1, 3, len(vectors)), axis=0))
        _, half_angle = minimum_cap(vectors)
        if abs(half_angle - 0.5 * math.pi) > 1e-12:
            worst = max(worst, excess(vectors, half_angle))
    ledger.record(
        "kernels", "optimal cones", "", cases=count, worst=worst * COSINE, bound=COSINE, unit="too low a cosine"
    )


def test_normals_that_no_cap_below_90_degrees_holds(amount, rng):
    for turn in turns(rng, amount(300, 10_000)):
        lift = 10.0 ** rng.uniform(-14.0, -0.1)
        # Four directions with the centre inside their hull, and opposite ones.
        around = ring(rng, 3, 0.5 * math.pi + lift)
        assert cap_of(unit(np.concatenate([around, [[0.0, 0.0, 1.0]]]) @ turn.T))[1] == EVERYTHING
        assert cap_of(np.concatenate([turn, -turn]))[1] == EVERYTHING
        assert cap_of(np.stack([turn[0], -turn[0]]))[1] == EVERYTHING


@pytest.mark.parametrize("digits", range(1, 15))
def test_nearly_opposite_normals_have_a_cap(rng, digits):
    """Two normals pi - 1e-2 apart once had none: their sum is short, and leant towards one of them."""
    apart = math.pi - 10.0**-digits
    for turn in turns(rng, 50):
        pair = np.array([[0.0, 0.0, 1.0], [math.sin(apart), 0.0, math.cos(apart)]]) @ turn.T
        axis, cosine = cap_of(unit(pair))
        assert cosine != EVERYTHING
        np.testing.assert_allclose(unit(pair) @ axis, cosine, rtol=0, atol=1e-15)
        assert math.acos(cosine) <= 0.5 * apart + 1e-15


def test_wide_rings_of_many_normals_have_a_cap(rng):
    """Of 50 on a ring of 89.9 degrees, one ring in ten once had none."""
    for turn in turns(rng, 200):
        half_angle = 0.5 * math.pi - 1e-3
        assert cap_of(unit(ring(rng, 50, half_angle) @ turn.T))[1] == pytest.approx(math.cos(half_angle), abs=1e-15)


def test_stored_cones_hold_every_normal(ledger, amount, rng):
    """Many cones of float32 normals at once, as a hierarchy has them."""
    count, size = amount(4_000, 100_000), 9
    spread = 10.0 ** rng.uniform(-9.0, 0.5, (count, 1, 1))
    vectors = unit(unit(rng.normal(size=(count, 1, 3))) + spread * rng.normal(size=(count, size, 3)))
    normals = vectors.astype(np.float32)
    begin = np.arange(count, dtype=np.int32) * size
    axes, cosines = normal_cones(normals.reshape(-1, 3), begin, begin + size)
    assert np.isfinite(axes).all()
    assert np.isfinite(cosines).all()
    stored = unit(normals.astype(np.float64))
    widest = angles(axes[:, None].astype(np.float64), stored).max(axis=1)
    held = cosines != EVERYTHING
    assert (cosines[held] >= 0.0).all()
    outside = np.where(held, widest - np.arccos(np.maximum(cosines.astype(np.float64), 0.0)), 0.0)
    ledger.record(
        "kernels",
        "stored cones",
        "normals spread over 1e-9 radians to all over the sphere, as float32: how far one lies outside",
        cases=count,
        worst=max(outside.max(), 0.0),
        bound=0.0,
        unit="radians",
    )
    worst = 0.0
    for k in np.flatnonzero(held)[: amount(200, 3_000)]:
        _, half_angle = minimum_cap(stored[k])
        allowed = max(math.cos(half_angle + STORED_AXIS) - STORED_COSINE, 0.0)
        worst = max(worst, math.acos(min(max(cosines[k], 0.0), 1.0)) - math.acos(allowed))
    ledger.record(
        "kernels",
        "stored cones, width",
        "the same: beyond the optimum, 4.1e-7 radians and a cosine lower by 9.5e-8",
        cases=amount(200, 3_000),
        worst=worst,
        bound=0.0,
        unit="radians",
    )


@pytest.mark.parametrize("count", [1, 2, 3, 10_000])
@pytest.mark.parametrize("jitter", [0.0, 1e-17, 1e-16, 1e-15, 1e-12])
def test_thousands_of_nearly_equal_normals(rng, count, jitter):
    vectors = unit(np.array([0.48, -0.6, 0.64]) + jitter * rng.normal(size=(count, 3)))
    axis, cosine = cap_of(vectors)
    assert (vectors @ axis).min() >= cosine - 1e-15
    assert cosine >= 1.0 - 1e-14


def test_widening_outweighs_storing(laws):
    @laws
    @given(st.floats(0.0, 1.0))
    def law(cosine):
        stored = np.float64(np.float32(widened_cosine(cosine)))
        assert max(math.cos(math.acos(cosine) + STORED_AXIS) - STORED_COSINE, 0.0) <= stored <= max(cosine, 0.0)

    law()
