"""How far a picture is from what it should show: normals, silhouette, holes and depth against a `Reference`.

Terms used below:

- A pixel is *drawn* where the picture's coverage is above 0, *full* where the reference's coverage is 1.
- Pixels are *compared* where both hold: there the picture has a normal and the reference's is not cut off.
- *Outline length* is the length in the plane of the picture of the curve where the reference's coverage is one half, by
  marching squares over the pixel centres. Counts of pixels would depend on the samples: the outline touches some 4 / pi
  pixels per pixel of its length, of which 3 x 3 samples find two thirds partly covered.
- *Area* is the sum of coverage: a partly covered pixel is a part of a pixel.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt

from benchmarks.reference import Reference
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
    outline_length : pixels, see the head of this file
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
        width = np.minimum(depth[ahead], depth[behind]) / reference.focal_pixels
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


def outline_length(coverage: Float32Array) -> float:
    """Return the length in pixels of the curve where coverage (H, W), bilinear between pixel centres, is one half.

    Marching squares (Lorensen and Cleveland 1987 in the plane). Where the shape leaves the picture there is no outline.
    """
    # Move values of exactly one half off the level, so that every corner is on one side.
    level = coverage.astype(np.float64) - 0.5
    level[level == 0.0] = 1e-9
    corners = [level[:-1, :-1], level[:-1, 1:], level[1:, 1:], level[1:, :-1]]
    cells = np.nonzero(~_same_sign(corners))
    c = np.stack([corner[cells] for corner in corners])  # (4, C), around the cell
    ahead = np.roll(c, -1, axis=0)
    crossed = (c > 0.0) != (ahead > 0.0)
    along = np.divide(c, c - ahead, out=np.zeros_like(c), where=crossed)
    # Point on edge k of the unit cell: its start corner plus `along` times its direction.
    start = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    direction = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    points = start[:, None] + along[..., None] * direction[:, None]  # (4, C, 2)

    two = crossed.sum(axis=0) == 2
    ends = points.swapaxes(0, 1)[two][crossed.T[two]].reshape(-1, 2, 2)
    length = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum())
    # A saddle has four crossings. Its centre decides which corners hang together: where the centre is on the side of
    # corner 0, the cuts go round corners 1 and 3 (edges 0-1 and 2-3), else round corners 0 and 2 (edges 3-0 and 1-2).
    saddle = points[:, ~two]
    around_odd = (c[:, ~two].mean(axis=0) > 0.0) == (c[0, ~two] > 0.0)
    odd = np.linalg.norm(saddle[0] - saddle[1], axis=1) + np.linalg.norm(saddle[2] - saddle[3], axis=1)
    even = np.linalg.norm(saddle[3] - saddle[0], axis=1) + np.linalg.norm(saddle[1] - saddle[2], axis=1)
    return length + float(np.where(around_odd, odd, even).sum())


def _same_sign(corners: list[Float64Array]) -> BoolArray:
    """Return the cells whose four corners are all above or all below zero."""
    above = np.sum([corner > 0.0 for corner in corners], axis=0)
    return np.asarray((above == 0) | (above == 4))
