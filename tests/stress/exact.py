"""Geometry in exact rationals and in sixty digits: what kernels in floating point are compared with."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import mpmath
import numpy as np
import numpy.typing as npt

DIGITS = 60
Float64Array = npt.NDArray[np.float64]


def rational(values: npt.ArrayLike) -> np.ndarray:
    """Return floats as exact Fractions, an object array of the same shape."""
    array = np.asarray(values, np.float64)
    return np.array([Fraction(value) for value in array.ravel().tolist()], object).reshape(array.shape)


def cross(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the cross product of vectors (..., 3) of any type of number."""
    (a, b, c), (d, e, f) = np.moveaxis(u, -1, 0), np.moveaxis(v, -1, 0)
    return np.stack([b * f - c * e, c * d - a * f, a * e - b * d], axis=-1)


def root(value: Fraction) -> Any:
    """Return the square root of a rational in sixty digits."""
    with mpmath.workdps(DIGITS):
        return mpmath.sqrt(mpmath.mpf(value.numerator) / value.denominator)


def smallest_circle_radius(corners: npt.ArrayLike) -> Any:
    """Return the radius of the smallest circle around a triangle (3, 3), in sixty digits."""
    a, b, c = rational(corners)
    squares = []
    for p, q, opposite in ((a, b, c), (b, c, a), (c, a, b)):
        edge2 = ((p - q) ** 2).sum()
        if ((p - opposite) * (q - opposite)).sum() <= 0:
            return root(edge2 / 4)
        squares.append(edge2)
    area = cross(b - a, c - a)
    return root(squares[0] * squares[1] * squares[2] / (4 * (area * area).sum()))


def face_vectors(positions: npt.ArrayLike, faces: np.ndarray) -> np.ndarray:
    """Return exact area vectors (T, 3) of triangles, Fractions."""
    corners = rational(positions)[faces]
    return cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def six_volumes(positions: npt.ArrayLike, faces: np.ndarray) -> Fraction:
    """Return six times the volume that closed faces enclose, exactly."""
    a, b, c = np.moveaxis(rational(positions)[faces], 1, 0)
    total = (a * cross(b, c)).sum()
    assert isinstance(total, Fraction)
    return total


def angle_weighted_normal(positions: npt.ArrayLike, faces: np.ndarray, vertex: int) -> Float64Array:
    """Return the sum of angle times unit normal over the faces around a vertex, worked out in sixty digits."""
    exact = rational(positions)
    with mpmath.workdps(DIGITS):
        total = [mpmath.mpf(0)] * 3
        for face in faces:
            for k in np.flatnonzero(face == vertex):
                a, b, c = (exact[face[(k + j) % 3]] for j in range(3))
                normal = cross(b - a, c - a)
                length = root((normal * normal).sum())
                if length == 0:
                    continue
                along = ((b - a) * (c - a)).sum()
                angle = mpmath.atan2(length, mpmath.mpf(along.numerator) / along.denominator)
                total = [
                    t + angle * (mpmath.mpf(n.numerator) / n.denominator) / length
                    for t, n in zip(total, normal, strict=True)
                ]
        norm = mpmath.sqrt(sum(t * t for t in total))
        return np.array([float(t / norm) if norm else 0.0 for t in total] + [float(norm)])
