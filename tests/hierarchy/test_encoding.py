"""The hemi-octahedral code: small errors, an exact centre, no seam."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hierarchy.encoding import decode_hemisphere, encode_hemisphere

LAWS = settings(derandomize=True, deadline=None, max_examples=150)

# Directions of the upper hemisphere, rim and pole included.
azimuths = st.floats(-math.pi, math.pi)
heights = st.floats(0.0, 1.0)


def direction(z, phi):
    ring = math.sqrt(1.0 - z * z)
    return np.array([ring * math.cos(phi), ring * math.sin(phi), z])


def encode(v):
    return np.array(encode_hemisphere(*(float(x) for x in v)))


def round_trip(v):
    return decode_hemisphere(encode(v).astype(np.uint8))


def degrees_between(a, b):
    return np.degrees(2.0 * np.arcsin(np.minimum(0.5 * np.linalg.norm(a - b, axis=-1), 1.0)))


def test_mean_and_largest_error_over_the_hemisphere():
    # Equal areas: equal steps in height and in azimuth.
    n = 20_000
    k = np.arange(n) + 0.5
    directions = np.array([direction(z, phi) for z, phi in zip(k / n, 2.399963 * k, strict=True)])
    codes = np.array([encode(v) for v in directions])
    errors = degrees_between(directions, decode_hemisphere(codes.astype(np.uint8)))
    assert errors.mean() < 0.25
    assert errors.max() < 0.57


def test_the_own_normal_of_the_surfel_survives_exactly():
    assert encode_hemisphere(0.0, 0.0, 1.0) == (128.0, 128.0)
    np.testing.assert_array_equal(round_trip((0.0, 0.0, 1.0)), [0, 0, 1])
    np.testing.assert_array_equal(round_trip((0.0, 0.0, 1e-30)), [0, 0, 1])


@LAWS
@given(heights, azimuths, st.floats(1e-6, 1e6))
def test_the_length_does_not_matter(z, phi, scale):
    v = direction(z, phi)
    assert np.abs(encode(v) - encode(scale * v)).max() <= 1.0
    assert degrees_between(v, round_trip(scale * v)) < 0.57


@LAWS
@given(st.floats(-1.0, 0.0), azimuths)
def test_below_the_horizon_goes_to_the_rim(z, phi):
    v = direction(z, phi)
    rim = np.array([v[0], v[1], 0.0])
    # A vector that points straight down has no nearest rim.
    if np.linalg.norm(rim) < 1e-9:
        return
    np.testing.assert_array_equal(encode(v), encode(rim))
    assert degrees_between(round_trip(v), rim / np.linalg.norm(rim)) < 0.57


@pytest.mark.parametrize("v", [(0.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 0.0, -0.0)])
def test_a_vector_without_a_direction_becomes_the_own_normal(v):
    assert encode_hemisphere(*v) == (128.0, 128.0)


@LAWS
@given(heights, azimuths)
def test_codes_are_whole_bytes_and_zero_is_never_used(z, phi):
    code = encode(direction(z, phi))
    assert (code == np.rint(code)).all()
    assert code.min() >= 1.0
    assert code.max() <= 255.0


@LAWS
@given(heights, azimuths, st.floats(0.0, 0.5), azimuths)
def test_no_seam_between_neighbours(z, phi, step, turn):
    """Half way between two codes stands a direction between the two: a linear filter never crosses a fold."""
    a = direction(z, phi)
    b = a + step * np.array([math.cos(turn), math.sin(turn), 0.3])
    b[2] = max(b[2], 0.0)
    b /= np.linalg.norm(b)
    middle = 0.5 * (encode(a) + encode(b))
    between = degrees_between(a, b)
    decoded = decode_hemisphere(middle)
    # The map stretches by sqrt(2) and more between pole and rim, so the middle leans, but never out of the span.
    assert degrees_between(decoded, a) <= between + 1.2
    assert degrees_between(decoded, b) <= between + 1.2
    # And a code moves with its direction: at most 3 steps of 127 a radian.
    assert np.abs(encode(a) - encode(b)).max() <= 3.0 * 127.0 * math.radians(between) + 1.0


def test_arrays_of_codes_keep_their_shape():
    codes = np.array([[[128, 128], [255, 128]], [[128, 255], [1, 128]]], np.uint8)
    decoded = decode_hemisphere(codes)
    assert decoded.shape == (2, 2, 3)
    np.testing.assert_allclose(np.linalg.norm(decoded, axis=-1), 1.0)
    # The corners' middles of the square are the diagonals of the surfel's frame.
    half = math.sqrt(0.5)
    np.testing.assert_allclose(decoded[0, 1], [half, half, 0], atol=1e-12)
    np.testing.assert_allclose(decoded[1, 0], [half, -half, 0], atol=1e-12)
