"""Smallest circle around points in the plane, by trying every circle that few of them can span.

The smallest circle has two of the points at the ends of a diameter or three on its rim. Every such candidate's centre
is tried with the radius that it needs to hold all: the least of these is the answer, without any tolerance.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
import numpy.typing as npt

Float64Array = npt.NDArray[np.float64]


def minimum_circle(points: npt.ArrayLike) -> tuple[Float64Array, float]:
    """Return centre, float64 (2,), and radius of the smallest circle around `points` (N, 2), N >= 1. O(N^4)."""
    points = np.asarray(points, np.float64)
    centres = [points]
    pairs = np.array(list(combinations(range(len(points)), 2)), np.intp).reshape(-1, 2)
    triples = np.array(list(combinations(range(len(points)), 3)), np.intp).reshape(-1, 3)
    centres.append(0.5 * (points[pairs[:, 0]] + points[pairs[:, 1]]))
    centres.append(_circumcentres(points[triples]))
    candidates = np.concatenate(centres)
    radii = np.linalg.norm(candidates[:, None] - points, axis=-1).max(axis=1)
    best = int(radii.argmin())
    return candidates[best], float(radii[best])


def _circumcentres(corners: Float64Array) -> Float64Array:
    """Return the circumcentres (T, 2) of those triangles (M, 3, 2) that have an area."""
    a = corners[:, 0]
    b, c = corners[:, 1] - a, corners[:, 2] - a
    area = 2.0 * (b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0])
    kept = area != 0.0
    a, b, c, area = a[kept], b[kept], c[kept], area[kept]
    bb, cc = (b**2).sum(axis=1), (c**2).sum(axis=1)
    centre = np.stack([c[:, 1] * bb - b[:, 1] * cc, b[:, 0] * cc - c[:, 0] * bb], axis=1)
    circumcentres: Float64Array = a + centre / area[:, None]
    return circumcentres
