"""The measures of `benchmarks.error` on shapes whose answers are known."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from benchmarks.error import angle_degrees, measure, near_depth_jump, normal_error_image
from benchmarks.reference import Reference
from hierarchy.model import Float32Array

SIZE, RADIUS, CENTRE = 128, 40.0, (64.3, 63.6)


def disc_coverage(radius: float, samples: int = 3) -> Float32Array:
    """Return the share of samples x samples points of each pixel that lie in a disc around CENTRE."""
    ticks = (np.arange(SIZE * samples) + 0.5) / samples
    inside = (ticks[None, :] - CENTRE[0]) ** 2 + (ticks[:, None] - CENTRE[1]) ** 2 < radius**2
    return inside.reshape(SIZE, samples, SIZE, samples).mean(axis=(1, 3)).astype(np.float32)


def flat_picture(coverage: Float32Array, normal: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> Reference:
    """Return a picture of a plane at depth 2 with one normal wherever coverage is positive."""
    hit = coverage > 0.0
    normals = np.where(hit[..., None], np.asarray(normal, np.float32), np.float32(0.0)).astype(np.float32)
    depth = np.where(hit, np.float32(2.0), np.float32(np.inf)).astype(np.float32)
    return Reference(normals, depth, coverage, focal_pixels=100.0)


@pytest.fixture(scope="module")
def reference() -> Reference:
    return flat_picture(disc_coverage(RADIUS))


def test_a_picture_equal_to_the_reference_has_no_error(reference: Reference) -> None:
    error = measure(reference.normal, reference.depth, reference.coverage, reference)
    assert error.normal_degrees.max == error.depth_relative.max == 0.0
    assert error.normal_degrees.count == (reference.coverage == 1.0).sum()
    assert (error.growth, error.mismatch, error.iou) == (0.0, 0.0, 1.0)
    assert error.silhouette.hausdorff == pytest.approx(0.0, abs=1e-12)
    assert (error.holes, error.holes_with_border, error.spill) == (0, 0, 0)


@pytest.mark.parametrize("growth", [-0.5, 0.2, 1.5])
def test_growth_of_a_disc_is_its_change_of_radius(reference: Reference, growth: float) -> None:
    picture = flat_picture(disc_coverage(RADIUS + growth, samples=16))
    error = measure(picture.normal, picture.depth, picture.coverage, reference)
    # The area of the ring over the circumference, and some per cent for the ragged outline of 3 x 3 samples.
    expected = growth * (1.0 + 0.5 * growth / RADIUS)
    assert error.growth == pytest.approx(expected, rel=0.06, abs=0.005)
    assert error.mismatch >= abs(error.growth)


def test_growth_cancels_where_mismatch_does_not(reference: Reference) -> None:
    shifted = flat_picture(np.roll(reference.coverage, 3, axis=1))
    error = measure(shifted.normal, shifted.depth, shifted.coverage, reference)
    assert error.growth == pytest.approx(0.0, abs=1e-9)
    # A shift by s sweeps 2 s times the height of the disc, on both sides.
    assert error.mismatch == pytest.approx(2.0 * 3.0 * 2.0 * RADIUS / error.outline_length, rel=0.01)
    assert error.spill > 0


def test_faint_pixels_count_whole_in_growth_drawn(reference: Reference) -> None:
    coverage = np.maximum(reference.coverage, 0.1 * disc_coverage(RADIUS + 5.0, samples=1)).astype(np.float32)
    picture = flat_picture(coverage)
    error = measure(picture.normal, picture.depth, picture.coverage, reference)
    assert error.growth < 0.6
    assert error.growth_drawn == pytest.approx(5.0, rel=0.15)


def test_one_sample_a_pixel_keeps_the_area_and_has_a_quarter_of_mismatch(reference: Reference) -> None:
    picture = flat_picture(disc_coverage(RADIUS, samples=1))
    error = measure(picture.normal, picture.depth, picture.coverage, reference)
    assert abs(error.growth) < 0.03
    assert 0.2 < error.mismatch < 0.3
    assert error.holes_with_border == 0


def test_normals_turned_by_a_known_angle(reference: Reference) -> None:
    angle = math.radians(3.0)
    picture = flat_picture(reference.coverage, (math.sin(angle), 0.0, math.cos(angle)))
    error = measure(picture.normal, picture.depth, picture.coverage, reference)
    for value in (error.normal_degrees.mean, error.normal_degrees.median, error.normal_degrees.max):
        assert value == pytest.approx(3.0, abs=1e-4)


def test_percentiles_of_two_normals_mixed(reference: Reference) -> None:
    normal = reference.normal.copy()
    normal[64:] = np.where(normal[64:] != 0.0, np.array([0.0, 1.0, 0.0], np.float32), 0.0)
    error = measure(normal, reference.depth, reference.coverage, reference).normal_degrees
    share = (reference.coverage[64:] == 1.0).sum() / error.count
    assert error.mean == pytest.approx(90.0 * share)
    assert (error.p95, error.p99, error.max) == (90.0, 90.0, 90.0)


def test_holes_are_counted_inside_and_at_the_border(reference: Reference) -> None:
    coverage = reference.coverage.copy()
    coverage[60:62, 60:63] = 0.0  # six pixels inside
    coverage[64, 60] = 0.4  # more background than surface
    coverage[66, 60] = 0.6
    row = int(CENTRE[1])
    first = int(np.flatnonzero(reference.coverage[row] == 1.0)[0])
    coverage[row, first] = 0.0  # at the outline
    picture = flat_picture(coverage)
    error = measure(picture.normal, picture.depth, picture.coverage, reference)
    assert (error.holes, error.holes_with_border) == (7, 8)


def test_a_hole_at_the_border_of_the_picture_is_inside() -> None:
    full = flat_picture(np.ones((8, 8), np.float32))
    coverage = full.coverage.copy()
    coverage[0, 0] = 0.0
    picture = flat_picture(coverage)
    error = measure(picture.normal, picture.depth, picture.coverage, full)
    assert (error.holes, error.outline_length, error.growth) == (1, 0.0, 0.0)


def test_depth_error_is_relative(reference: Reference) -> None:
    error = measure(reference.normal, (reference.depth * 1.01).astype(np.float32), reference.coverage, reference)
    assert error.depth_relative.median == pytest.approx(0.01, rel=1e-4)


def test_smooth_pixels_leave_out_both_sides_of_a_jump_of_depth() -> None:
    picture = flat_picture(np.ones((9, 12), np.float32))
    picture.depth[:, 6:] = 3.0  # one unit is 50 pixels wide there
    near = near_depth_jump(picture)
    assert near.any(axis=0).tolist() == near.all(axis=0).tolist() == [4 <= column <= 7 for column in range(12)]
    # A plane seen at 80 degrees is no jump: its depth changes by tan(80 deg) pixels a pixel.
    sloped = flat_picture(np.ones((9, 12), np.float32))
    sloped.depth[:] = 2.0 + np.arange(12) * (2.0 / 100.0) * math.tan(math.radians(80.0))
    assert not near_depth_jump(sloped).any()


def test_smooth_pixels_leave_out_the_outline(reference: Reference) -> None:
    error = measure(reference.normal, reference.depth, reference.coverage, reference)
    ring = error.normal_degrees.count - error.smooth_normal_degrees.count
    assert 0.5 < ring / (2.0 * math.pi * RADIUS) < 2.0


def test_error_image_is_nan_outside_the_compared_pixels(reference: Reference) -> None:
    image = normal_error_image(reference.normal, reference.coverage, reference)
    assert np.array_equal(np.isfinite(image), reference.coverage == 1.0)
    assert np.nanmax(image) == 0.0


def test_angle_keeps_small_angles_and_calls_a_missing_normal_a_right_angle() -> None:
    small = 1e-6
    a = np.array([[1.0, 0.0, 0.0]])
    assert angle_degrees(a, [[math.cos(small), math.sin(small), 0.0]])[0] == pytest.approx(math.degrees(small))
    assert angle_degrees(a, -5.0 * a)[0] == 180.0
    assert angle_degrees(a, 0.0 * a)[0] == 90.0


def test_figures_are_json(reference: Reference) -> None:
    figures = measure(reference.normal, reference.depth, reference.coverage, reference).to_dict()
    read = json.loads(json.dumps(figures, allow_nan=False))
    assert read["normal_degrees"]["p95"] == 0.0
    assert read["silhouette"]["p95"] == pytest.approx(0.0, abs=1e-12)
    nothing = flat_picture(np.zeros((SIZE, SIZE), np.float32))
    figures = measure(nothing.normal, nothing.depth, nothing.coverage, reference).to_dict()
    read = json.loads(json.dumps(figures, allow_nan=False))
    assert (read["silhouette"], read["iou"]) == ({"mean": None, "p95": None, "hausdorff": None}, 0.0)


def test_silhouette_and_overlap_of_a_larger_disc(reference: Reference) -> None:
    picture = flat_picture(disc_coverage(RADIUS + 2.0, samples=16))
    error = measure(picture.normal, picture.depth, picture.coverage, reference)
    assert error.silhouette.mean == pytest.approx(2.0, abs=0.03)
    assert error.iou == pytest.approx((RADIUS / (RADIUS + 2.0)) ** 2, abs=0.005)


def test_pictures_that_cannot_be_compared_are_refused(reference: Reference) -> None:
    with pytest.raises(ValueError, match="the picture is"):
        measure(reference.normal[:9], reference.depth[:9], reference.coverage[:9], reference)
    empty = flat_picture(np.zeros((4, 4), np.float32))
    with pytest.raises(ValueError, match="empty"):
        measure(empty.normal, empty.depth, empty.coverage, empty)
