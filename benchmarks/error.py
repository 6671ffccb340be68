"""How far a picture is from what it should show: normals, silhouette, holes and depth against a `Reference`.

What the shades look like is measured in benchmarks/picture_quality.py.

Terms used below:

- A pixel is *drawn* where the picture's coverage is above 0, *full* where the reference's coverage is 1.
- Pixels are *compared* where both hold: there the picture has a normal and the reference's is not cut off.
- The *outline* is the curve where coverage is one half (benchmarks/silhouette.py). Counts of pixels along it would
  depend on the samples: the outline touches some 4 / pi pixels per pixel of its length, of which 3 x 3 samples find two
  thirds partly covered.
- *Area* is the sum of coverage: a partly covered pixel is a part of a pixel.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt

from benchmarks.reference import Reference
from benchmarks.silhouette import Displacement, displacement, intersection_over_union, outline_length
from hierarchy.model import BoolArray, Float32Array, Float64Array

# A full pixel whose coverage in the picture is below this shows more background than surface: a hole.
HOLE_COVERAGE = 0.5
# Neighbouring pixels whose depths differ by more than this many pixel widths belong to different sheets of the surface
# (or to one seen at more than 83 degrees from its normal).
DEPTH_JUMP_PIXELS = 8.0


@dataclass(frozen=True)
class Distribution:
    """Figures of a set of values; all 0 where the set is empty (count says so)."""

    count: int
    mean: float
    median: float
    p95: float
    p99: float
    max: float


@dataclass(frozen=True)
class PictureError:
    """What separates a picture from its reference.

    normal_degrees : angle between the normals over the compared pixels
    smooth_normal_degrees : the same without the pixels within one pixel of a jump of depth or of the outline
    depth_relative : |difference| / reference depth over the compared pixels
    silhouette : how far the outlines lie apart, in pixels. A picture with one sample a pixel has a mean of about 0.15
        at best
    iou : area that both cover by at least one half over that which either does
    outline_length : of the reference, in pixels
    growth : (area of the picture - area of the reference) / outline length, in pixels; positive is too large
    growth_drawn : the same where every drawn pixel counts as a whole one, however faint
    mismatch : sum of |difference of coverage| / outline length; growth without cancelling. A picture with one sample a
        pixel has about 0.23 at best
    holes : full pixels with coverage below one half all of whose eight neighbours are full as well
    holes_with_border : full pixels with coverage below one half, those at the outline included
    spill : drawn pixels where the reference has nothing at all
    """

    normal_degrees: Distribution
    smooth_normal_degrees: Distribution
    depth_relative: Distribution
    silhouette: Displacement
    iou: float
    outline_length: float
    growth: float
    growth_drawn: float
    mismatch: float
    holes: int
    holes_with_border: int
    spill: int

    def to_dict(self) -> dict[str, object]:
        """Return plain nested dictionaries of numbers, for JSON."""
        return asdict(self)


def measure(normal: Float32Array, depth: Float32Array, coverage: Float32Array, reference: Reference) -> PictureError:
    """Measure a picture against the reference of the same view.

    normal : (H, W, 3) float32, unit, zero where nothing is drawn; in the reference's axes (model space)
    depth : (H, W) float32, distance along the view axis, inf where nothing is drawn
    coverage : (H, W) float32 in 0..1
    Raises ValueError where the shapes differ or nothing in the reference was hit.
    """
    if normal.shape != reference.normal.shape or not depth.shape == coverage.shape == reference.coverage.shape:
        raise ValueError(f"the picture is {coverage.shape}, the reference {reference.coverage.shape}")
    if not (reference.coverage > 0.0).any():
        raise ValueError("the reference is empty")
    drawn, full = coverage > 0.0, reference.coverage >= 1.0
    compared = drawn & full
    degrees = angle_degrees(normal[compared], reference.normal[compared])
    smooth = ~near_depth_jump(reference)[compared]
    reference_depth = reference.depth[compared].astype(np.float64)
    depth_error = np.abs(depth[compared] - reference_depth) / reference_depth

    length = outline_length(reference.coverage)
    per_outline = 1.0 / length if length > 0.0 else 0.0
    difference = coverage.astype(np.float64) - reference.coverage
    missing = full & (coverage < HOLE_COVERAGE)
    return PictureError(
        normal_degrees=distribution(degrees),
        smooth_normal_degrees=distribution(degrees[smooth]),
        depth_relative=distribution(depth_error),
        silhouette=displacement(coverage, reference.coverage),
        iou=intersection_over_union(coverage, reference.coverage),
        outline_length=length,
        growth=float(difference.sum()) * per_outline,
        growth_drawn=float((drawn - reference.coverage.astype(np.float64)).sum()) * per_outline,
        mismatch=float(np.abs(difference).sum()) * per_outline,
        holes=int((missing & _surrounded(full)).sum()),
        holes_with_border=int(missing.sum()),
        spill=int((drawn & (reference.coverage <= 0.0)).sum()),
    )


def normal_error_image(normal: Float32Array, coverage: Float32Array, reference: Reference) -> Float32Array:
    """Return the angle between the normals in degrees, float32 (H, W), nan outside the compared pixels."""
    compared = (coverage > 0.0) & (reference.coverage >= 1.0)
    image = np.full(coverage.shape, np.nan, np.float32)
    image[compared] = angle_degrees(normal[compared], reference.normal[compared])
    return image


def angle_degrees(a: npt.ArrayLike, b: npt.ArrayLike) -> Float64Array:
    """Return the angles between vectors (..., 3) of any length in degrees; 90 where one is zero."""
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)
    # atan2 keeps its digits at small angles, where the arc cosine of a float32 dot product loses them.
    sine, cosine = np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1)
    zero = (sine == 0.0) & (cosine == 0.0)
    return np.where(zero, 90.0, np.degrees(np.arctan2(sine, cosine)))


def distribution(values: Float64Array) -> Distribution:
    """Return the figures of float64 (N,) values."""
    if values.size == 0:
        return Distribution(0, 0.0, 0.0, 0.0, 0.0, 0.0)
    median, p95, p99 = np.percentile(values, [50.0, 95.0, 99.0])
    return Distribution(
        int(values.size), float(values.mean()), float(median), float(p95), float(p99), float(values.max())
    )


def near_depth_jump(reference: Reference) -> BoolArray:
    """Return the pixels within one pixel of a jump of depth or of a pixel that is not full, bool (H, W)."""
    from scipy import ndimage

    # A pixel that is not full counts as infinitely far: the outline is a jump as well. `finite` keeps inf - inf out.
    finite = np.isfinite(reference.depth)
    depth = np.where(finite, reference.depth, 0.0).astype(np.float64)
    jump = reference.coverage < 1.0
    for axis in (0, 1):
        ahead, behind = _pairs(axis)
        step = np.abs(depth[ahead] - depth[behind])
        width = (1.0 if reference.parallel else np.minimum(depth[ahead], depth[behind])) / reference.focal_pixels
        apart = step > DEPTH_JUMP_PIXELS * width
        jump[ahead] |= apart
        jump[behind] |= apart
    result: BoolArray = ndimage.binary_dilation(jump, np.ones((3, 3), np.bool_))
    return result


def _pairs(axis: int) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Return indices of every pixel but the first and of every pixel but the last along `axis`."""
    every = slice(None)
    if axis == 0:
        return (slice(1, None), every), (slice(None, -1), every)
    return (every, slice(1, None)), (every, slice(None, -1))


def _surrounded(mask: BoolArray) -> BoolArray:
    """Return the pixels of `mask` all of whose eight neighbours are in it; the picture's border does not end it."""
    from scipy import ndimage

    result: BoolArray = ndimage.binary_erosion(mask, np.ones((3, 3), np.bool_), border_value=1)
    return result
