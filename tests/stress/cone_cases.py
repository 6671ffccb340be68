"""Cones and spheres before an eye, most of them where they only just face away, and by how much they do not."""

from __future__ import annotations

import math

import mpmath
import numpy as np
from exact import DIGITS

from hierarchy.cones import EVERYTHING

Cases = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Axes float32 (N, 3), float64 vectors from the eye to the spheres (N, 3), radii and cosines float32 (N,)."""


def units(rng: np.random.Generator, count: int) -> np.ndarray:
    vectors = rng.normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def tiny(rng: np.random.Generator, count: int) -> np.ndarray:
    """Return numbers from 1e-17 to 1, of each magnitude as many."""
    return 10.0 ** rng.uniform(-17, 0, count)


def random_cones(rng: np.random.Generator, count: int) -> Cases:
    """Return cones whose limits lie near the line of sight, and among them every degenerate one."""
    # No angle, the least that is stored, a right angle less next to nothing, a right angle, everything.
    kinds = [np.ones(count), 1.0 - tiny(rng, count), tiny(rng, count), rng.uniform(0.0, 1.0, count)]
    kinds += [np.full(count, value) for value in (1.0 - 2.0**-24, 0.0, EVERYTHING)]
    cosines = np.choose(rng.integers(0, len(kinds), count), kinds).astype(np.float32)
    spheres = (10.0 ** rng.uniform(-6, 6, count)).astype(np.float32)
    # From a million radii away to on the sphere, and inside.
    sines = [10.0 ** rng.uniform(-6, 0, count), 1.0 - tiny(rng, count), np.ones(count), rng.uniform(1.0, 2.0, count)]
    distances = spheres / np.choose(rng.integers(0, len(sines), count), sines)
    spheres[rng.random(count) < 0.2] = 0.0
    spread = np.arccos(np.clip(cosines.astype(np.float64), 0.0, 1.0)) + np.arcsin(np.minimum(spheres / distances, 1.0))
    beside = 0.5 * np.pi - spread + rng.choice([-1.0, 1.0], count) * tiny(rng, count)
    along = np.where(rng.random(count) < 0.8, np.abs(beside), rng.uniform(0.0, np.pi, count))
    along = np.where(rng.random(count) < 0.5, along, np.pi - along)
    axes = units(rng, count)
    aside = np.cross(axes, units(rng, count))
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    towards = distances[:, None] * (np.cos(along)[:, None] * axes + np.sin(along)[:, None] * aside)
    return axes.astype(np.float32), towards, spheres, cosines


def too_wide(cases: Cases) -> tuple[np.ndarray, np.ndarray]:
    """Return by what angle (radians) cones are too wide to face away, and to face the eye; long doubles (N,) each.

    Infinite where a cone contains everything, or its sphere the eye.
    """
    axes, towards, spheres, cosines = (each.astype(np.longdouble) for each in cases)
    along = np.arctan2(np.linalg.norm(np.cross(axes, towards), axis=1), (axes * towards).sum(axis=1))
    distances = np.sqrt((towards * towards).sum(axis=1))
    tangents = np.sqrt(np.maximum((distances - spheres) * (distances + spheres), 0))
    spread = np.arctan2(np.sqrt(np.maximum((1 - cosines) * (1 + cosines), 0)), cosines) + np.arctan2(spheres, tangents)
    spread = np.where((cosines < 0) | (spheres > distances), np.inf, spread)
    right = 2 * np.arctan(np.longdouble(1))
    return along + spread - right, right + spread - along


def too_wide_exactly(cases: Cases, i: int, *, for_back: bool) -> float:
    """Return the same of one of the cones, in sixty digits."""
    axis, towards, sphere, cosine = (each[i] for each in cases)
    with mpmath.workdps(DIGITS):
        a, v = ([mpmath.mpf(float(k)) for k in vector] for vector in (axis, towards))
        s, c = mpmath.mpf(float(sphere)), mpmath.mpf(float(cosine))
        dot = sum(p * q for p, q in zip(a, v, strict=True))
        lengths2 = sum(p * p for p in a) * sum(q * q for q in v)
        tangent2 = sum(q * q for q in v) - s * s
        if tangent2 < 0 or c < 0:
            return math.inf
        along = mpmath.atan2(mpmath.sqrt(lengths2 - dot * dot), dot if for_back else -dot)
        return float(along + mpmath.acos(c) + mpmath.atan2(s, mpmath.sqrt(tangent2)) - mpmath.pi / 2)
