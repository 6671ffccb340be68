"""Smallest cap of the unit sphere that holds directions, by trying every cap that few of them can span.

The smallest cap is fixed by one, two or three of its directions (as the smallest circle of points in the plane is;
Barequet and Elber 2005). Every such candidate's axis is tried with the half-angle that it needs to hold all: the least
of these is the answer, without any tolerance.
"""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import numpy.typing as npt

Float64Array = npt.NDArray[np.float64]


def minimum_cap(directions: npt.ArrayLike) -> tuple[Float64Array, float]:
    """Return axis, float64 (3,) unit, and half-angle in radians of the smallest cap over unit `directions` (N, 3).

    The half-angle is pi where no closed hemisphere holds all; the axis then means nothing. O(N^4): for N up to some 40.
    """
    points = np.asarray(directions, np.float64)
    axes = _candidate_axes(points)
    angles = _angles(axes, points).max(axis=1)
    best = int(angles.argmin())
    # Directions that fill a hemisphere exactly need 90 degrees; rounding may say a little more.
    if angles[best] > 0.5 * math.pi + 1e-9:
        return axes[best], math.pi
    return axes[best], float(angles[best])


def _candidate_axes(points: Float64Array) -> Float64Array:
    """Return the axes (C, 3) of all caps spanned by one, two or three points, and the borders of hemispheres."""
    candidates = [points]
    pairs = np.array(list(combinations(range(len(points)), 2)), np.intp).reshape(-1, 2)
    triples = np.array(list(combinations(range(len(points)), 3)), np.intp).reshape(-1, 3)
    a, b = points[pairs[:, 0]], points[pairs[:, 1]]
    candidates.append(a + b)
    # Hemispheres with both points on the border: the smallest cap where it needs 90 degrees.
    candidates += [np.cross(a, b), np.cross(b, a)]
    # A single line of directions, d and -d, fits into any hemisphere whose axis is perpendicular to it.
    candidates.append(np.cross(points, np.eye(3)[np.abs(points).argmin(axis=1)]))
    a, b, c = points[triples[:, 0]], points[triples[:, 1]], points[triples[:, 2]]
    normal = np.cross(b - a, c - a)
    candidates += [normal, -normal]
    axes = np.concatenate(candidates)
    length = np.linalg.norm(axes, axis=1)
    unit: Float64Array = axes[length > 0.0] / length[length > 0.0, None]
    return unit


def _angles(axes: Float64Array, points: Float64Array) -> Float64Array:
    """Return the angles (C, N) between axes and points, accurate when small as when near pi."""
    apart = np.linalg.norm(axes[:, None] - points, axis=-1)
    together = np.linalg.norm(axes[:, None] + points, axis=-1)
    angles: Float64Array = 2.0 * np.arctan2(apart, together)
    return angles
