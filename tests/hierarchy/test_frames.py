"""Orthonormal frames all over the sphere and at the seams of the branch-free basis."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hierarchy.frames import tangents

TINY = 5e-324

SEAMS = {
    "north pole": (0.0, 0.0, 1.0),
    "south pole": (0.0, 0.0, -1.0),
    "equator": (1.0, 0.0, 0.0),
    "equator, z = -0.0": (0.0, 1.0, -0.0),
    "just above the equator": (math.sqrt(0.5), -math.sqrt(0.5), TINY),
    "just below the equator": (math.sqrt(0.5), -math.sqrt(0.5), -TINY),
    "nearly the north pole": (1e-8, -1e-8, 1.0),
    "nearly the south pole": (-1e-8, 1e-8, -1.0),
    "y axis, where eq. 8 loses all digits": (1e-9, 1.0, 1e-9),
    "minus y": (0.0, -1.0, 0.0),
}


def frame(n):
    values = tangents(*(float(v) for v in n))
    return np.array(values[:3]), np.array(values[3:])


def assert_frame(n, tolerance):
    """Check that (o1, o2, n) is orthonormal and right-handed."""
    matrix = np.stack([*frame(n), np.asarray(n, float)])
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), rtol=0, atol=tolerance)
    assert np.linalg.det(matrix) == pytest.approx(1.0, abs=tolerance)


@pytest.mark.parametrize("name", SEAMS)
def test_frames_are_right_handed_at(name):
    assert_frame(SEAMS[name], 1e-12)


@settings(derandomize=True, deadline=None, max_examples=150)
@given(st.floats(-1.0, 1.0), st.floats(-math.pi, math.pi))
def test_frames_are_right_handed_all_over_the_sphere(z, phi):
    ring = math.sqrt(1.0 - z * z)
    n = np.array([ring * math.cos(phi), ring * math.sin(phi), z])
    assert_frame(n / np.linalg.norm(n), 1e-12)


@settings(derandomize=True, deadline=None, max_examples=150)
@given(st.floats(-1.0, 1.0), st.floats(-math.pi, math.pi))
def test_single_precision_normals_keep_six_digits(z, phi):
    ring = math.sqrt(1.0 - z * z)
    assert_frame(np.array([ring * math.cos(phi), ring * math.sin(phi), z], np.float32), 1e-6)


@pytest.mark.parametrize("x", [1.0, -1.0, 0.6])
def test_negative_zero_takes_the_branch_of_zero(x):
    y = math.sqrt(1.0 - x * x)
    assert tangents(x, y, -0.0) == tangents(x, y, 0.0)


def test_a_surfel_that_faces_z_has_the_axes_as_tangents():
    o1, o2 = frame((0.0, 0.0, 1.0))
    np.testing.assert_array_equal(o1, [1, 0, 0])
    np.testing.assert_array_equal(o2, [0, 1, 0])


def test_frames_turn_smoothly_within_each_half():
    rng = np.random.default_rng(1)
    for half in (1.0, -1.0):
        n = rng.normal(size=(500, 3))
        n[:, 2] = half * np.abs(n[:, 2])
        n /= np.linalg.norm(n, axis=1, keepdims=True)
        step = 1e-5 * rng.normal(size=n.shape)
        step[:, 2] = half * np.abs(step[:, 2])
        near = (n + step) / np.linalg.norm(n + step, axis=1, keepdims=True)
        for a, b in zip(n, near, strict=True):
            moved = np.linalg.norm(frame(a)[0] - frame(b)[0])
            # The basis turns at most twice as fast as the normal does.
            assert moved <= 2.1 * np.linalg.norm(a - b) + 1e-12


def test_the_equator_belongs_to_the_upper_half():
    # Both branches would do there; the drawing takes this one, too.
    np.testing.assert_array_equal(np.array(tangents(1.0, 0.0, 0.0)), [0, 0, -1, 0, 1, 0])
    np.testing.assert_array_equal(np.array(tangents(0.0, 1.0, 0.0)), [1, 0, 0, 0, 0, -1])
