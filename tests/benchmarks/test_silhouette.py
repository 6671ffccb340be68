"""Outlines and the distances between them, on shapes whose answers are known and against a search of all segments."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.silhouette import (
    BORDER,
    Displacement,
    displacement,
    distances,
    intersection_over_union,
    outline_length,
    outline_segments,
)
from hierarchy.model import Float32Array, Float64Array

SIZE, RADIUS, CENTRE = 128, 40.0, (64.3, 63.6)


def disc_coverage(radius: float, samples: int = 8, centre: tuple[float, float] = CENTRE) -> Float32Array:
    """Return the share of samples x samples points of each pixel that lie in a disc."""
    ticks = (np.arange(SIZE * samples) + 0.5) / samples
    inside = (ticks[None, :] - centre[0]) ** 2 + (ticks[:, None] - centre[1]) ** 2 < radius**2
    return inside.reshape(SIZE, samples, SIZE, samples).mean(axis=(1, 3)).astype(np.float32)


def half_plane(edge: float, width: int = 40, height: int = 30) -> Float32Array:
    """Return the coverage of all that lies left of column `edge`, which may be any number."""
    return np.tile(np.clip(edge - np.arange(width), 0.0, 1.0), (height, 1)).astype(np.float32)


def brute_distances(points: Float64Array, segments: Float64Array) -> Float64Array:
    """Return the distances to the nearest of 1,001 points along any of the segments."""
    t = np.linspace(0.0, 1.0, 1001)[:, None, None]
    along = ((1.0 - t) * segments[:, 0] + t * segments[:, 1]).reshape(-1, 2)
    return np.array([np.hypot(*(along - point).T).min() for point in points])


@pytest.mark.parametrize("samples", [1, 3, 16])
def test_outline_of_a_disc_is_its_circumference(samples: int) -> None:
    # Coverage in few steps makes the curve ragged: a little too long, never shorter.
    length = outline_length(disc_coverage(RADIUS, samples)) / (2.0 * math.pi * RADIUS)
    assert 0.995 < length < {1: 1.10, 3: 1.05, 16: 1.005}[samples]


def test_outline_of_a_half_plane_ends_at_the_border_of_the_picture() -> None:
    coverage = np.zeros((20, 30), np.float32)
    coverage[:, 12:] = 1.0
    assert outline_length(coverage) == pytest.approx(19.0, abs=1e-6)


def test_outline_of_a_saddle_is_that_of_the_corners_its_centre_hangs_with() -> None:
    # Two diagonal corners at 1: cuts of half a cell's diagonal at each of the two others or of these two.
    for high in (0.9, 0.6):
        coverage = np.array([[high, 0.2], [0.2, high]], np.float32)
        crossing = (high - 0.5) / (high - 0.2)  # from a high corner
        expected = 2.0 * math.sqrt(2.0) * (1.0 - crossing if 0.5 * (high + 0.2) > 0.5 else crossing)
        assert outline_length(coverage) == pytest.approx(expected, abs=1e-6)
        assert outline_length(coverage[::-1].copy()) == pytest.approx(expected, abs=1e-6)


def test_outline_of_nothing_and_of_everything_is_zero() -> None:
    assert outline_length(np.zeros((8, 8), np.float32)) == 0.0
    assert outline_length(np.ones((8, 8), np.float32)) == 0.0


def test_outline_of_a_disc_is_where_the_disc_ends() -> None:
    segments = outline_segments(disc_coverage(RADIUS, 16))
    radii = np.linalg.norm(segments - np.array(CENTRE), axis=-1)
    # Between pixel centres an edge is found up to 0.09 pixels beside its place; 16 x 16 samples add a little.
    assert np.abs(radii - RADIUS).max() < 0.11
    assert np.mean(radii) == pytest.approx(RADIUS, abs=0.01)
    # Every point is the end of two segments: the curve is closed.
    _, counts = np.unique(np.round(segments.reshape(-1, 2), 9), axis=0, return_counts=True)
    assert (counts == 2).all()


@pytest.mark.parametrize("growth", [-3.0, -0.5, 0.1, 2.0])
def test_displacement_of_a_disc_is_its_change_of_radius(growth: float) -> None:
    moved = displacement(disc_coverage(RADIUS + growth), disc_coverage(RADIUS))
    assert moved.mean == pytest.approx(abs(growth), abs=0.02)
    # Both edges are found up to 0.1 pixels beside their places.
    assert moved.mean <= moved.p95 <= moved.hausdorff <= abs(growth) + 0.2


def test_displacement_of_a_shifted_disc() -> None:
    shift = 2.0
    moved = displacement(disc_coverage(RADIUS, centre=(CENTRE[0] + shift, CENTRE[1])), disc_coverage(RADIUS))
    # |shift cos(angle)| to first order, all round: mean 2 / pi of it, and 95 of 100 angles below cos(0.05 pi / 2).
    assert moved.mean == pytest.approx(shift * 2.0 / math.pi, abs=0.03)
    assert moved.p95 == pytest.approx(shift * math.cos(0.025 * math.pi), abs=0.06)
    assert moved.hausdorff == pytest.approx(shift, abs=0.09)


def test_displacement_is_the_same_in_both_orders_and_zero_of_equals() -> None:
    a, b = disc_coverage(RADIUS), disc_coverage(RADIUS - 1.0, centre=(65.0, 62.0))
    there, back = displacement(a, b), displacement(b, a)
    assert there.mean == pytest.approx(back.mean)
    assert (there.p95, there.hausdorff) == pytest.approx((back.p95, back.hausdorff))
    assert displacement(a, a).hausdorff == pytest.approx(0.0, abs=1e-12)


def test_one_sample_a_pixel_costs_a_seventh_of_a_pixel() -> None:
    moved = displacement(disc_coverage(RADIUS, 1), disc_coverage(RADIUS, 4))
    assert 0.12 < moved.mean < 0.17


@pytest.mark.parametrize(
    ("edge", "found"), [(20.0, 20.0), (20.5, 20.5), (20.3, 19.5 + 0.5 / 0.7), (20.7, 21.5 - 0.5 / 0.7)]
)
def test_an_edge_is_found_to_a_tenth_of_a_pixel(edge: float, found: float) -> None:
    moved = displacement(half_plane(edge), half_plane(15.0))
    for value in (moved.mean, moved.p95, moved.hausdorff):
        assert value == pytest.approx(found - 15.0, abs=1e-6)
    assert abs(found - edge) < 0.1


def test_mean_is_that_of_both_directions_and_weighted_by_length() -> None:
    # A spot of circumference 2 pi 5, its outline 15 to 25 from the disc's; the disc's own is in place.
    disc, spot = disc_coverage(20.0, centre=(40.0, 64.0)), disc_coverage(5.0, centre=(80.0, 64.0))
    moved = displacement(disc + spot, disc)
    # Mean distance of a circle of radius 5 from a point 40 away: 40 + 25 / (4 * 40); less the disc's radius.
    far = 40.0 + 25.0 / 160.0 - 20.0
    assert moved.mean == pytest.approx(0.5 * (5.0 / 25.0) * far, rel=0.02)
    assert moved.hausdorff == pytest.approx(25.0, abs=0.1)
    # The spot is 5 of 45 parts of both outlines together: 95 of 100 are reached within it.
    assert 15.0 < moved.p95 < 25.0


def test_rims_of_holes_are_outline_where_the_reference_has_them_too() -> None:
    disc = disc_coverage(RADIUS)
    pierced = disc - disc_coverage(6.0)
    # Closed in the picture: the reference's rim is missing.
    assert displacement(disc, pierced).hausdorff == pytest.approx(RADIUS - 6.0, abs=0.2)
    # Only in the picture: that is a hole, not a displaced outline.
    assert displacement(pierced, disc) == displacement(disc, disc)
    # A notch is no hole.
    notched = disc.copy()
    notched[64, 64:] = 0.0
    assert displacement(notched, disc).hausdorff == pytest.approx(RADIUS, abs=1.0)


def test_without_outlines_on_both_sides_there_is_nothing_to_measure() -> None:
    empty, full, disc = np.zeros((SIZE, SIZE), np.float32), np.ones((SIZE, SIZE), np.float32), disc_coverage(RADIUS)
    for a, b in ((empty, empty), (full, full), (empty, full)):
        assert displacement(a, b) == Displacement(0.0, 0.0, 0.0)
    for a, b in ((disc, empty), (empty, disc), (full, disc), (disc, full)):
        assert displacement(a, b) == Displacement(None, None, None)


def test_a_model_that_leaves_the_picture_has_no_outline_along_its_border() -> None:
    # The left half, above and below cut off by the border: only the edge at column 20 counts.
    segments = outline_segments(half_plane(20.0))
    assert np.allclose(segments[..., 0], 20.0)
    # The edge of one has just left the picture, the other's is just inside: not a displacement of 30 pixels.
    reference, picture = half_plane(20.0), half_plane(20.0)
    picture[0] = 0.0  # its upper edge at row 1, which the reference has beyond the picture
    moved = displacement(picture, reference)
    assert moved.hausdorff < 0.2
    picture[: int(BORDER) + 2] = 0.0
    assert displacement(picture, reference).hausdorff > 10.0


def test_an_outline_that_stays_within_the_border_leaves_the_other_direction() -> None:
    near, inside = half_plane(1.5), half_plane(4.0)
    moved = displacement(near, inside)
    assert (moved.mean, moved.hausdorff) == pytest.approx((2.5, 2.5), abs=0.01)
    assert displacement(near, near) == Displacement(0.0, 0.0, 0.0)


@given(st.integers(0, 10_000), st.sampled_from([0.05, 1.0, 30.0]), st.integers(1, 60))
@settings(max_examples=25, deadline=None)
def test_distances_are_those_of_a_search_of_all(seed: int, scale: float, count: int) -> None:
    rng = np.random.default_rng(seed)
    start = rng.random((count, 2)) * scale
    segments = np.stack([start, start + rng.normal(size=(count, 2)) * rng.random((count, 1)) * 2.0], axis=1)
    segments[0, 1] = segments[0, 0]  # a segment of no length
    points = rng.random((12, 2)) * scale
    assert np.allclose(distances(points, segments), brute_distances(points, segments), atol=6e-3)


def test_distances_where_many_segments_are_equally_far() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 400)
    circle = 50.0 * np.stack([np.cos(angle), np.sin(angle)], -1)
    segments = np.stack([circle[:-1], circle[1:]], axis=1)
    # From the centre to the middle of any chord; from outside to a corner.
    chord = 50.0 * math.cos(math.pi / 399)
    assert distances(np.array([[0.0, 0.0], [70.0, 0.0]]), segments) == pytest.approx([chord, 20.0])


def test_overlap_counts_pixels_that_are_half_covered() -> None:
    a = np.array([[1.0, 0.5, 0.49, 0.0]], np.float32)
    b = np.array([[1.0, 0.0, 1.0, 0.0]], np.float32)
    assert intersection_over_union(a, b) == pytest.approx(1.0 / 3.0)
    assert intersection_over_union(a, a) == 1.0
    assert intersection_over_union(np.zeros_like(a), np.zeros_like(a)) == 1.0


def test_pictures_of_two_sizes_are_refused() -> None:
    with pytest.raises(ValueError, match="the picture is"):
        displacement(half_plane(9.0), half_plane(9.0, width=41))
