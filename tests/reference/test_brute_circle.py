"""The brute-force circle against circles known in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from brute_circle import minimum_circle


@pytest.mark.parametrize(
    ("points", "centre", "radius"),
    [
        ([[2, 3]], (2, 3), 0.0),
        ([[2, 3], [2, 3], [2, 3]], (2, 3), 0.0),
        ([[0, 0], [4, 0]], (2, 0), 2.0),
        ([[0, 0], [1, 1], [3, 3], [2, 2]], (1.5, 1.5), 1.5 * math.sqrt(2.0)),
        ([[0, 0], [4, 0], [2, 0.5]], (2, 0), 2.0),
        ([[0, 0], [2, 0], [1, math.sqrt(3.0)]], (1, 1 / math.sqrt(3.0)), 2.0 / math.sqrt(3.0)),
        ([[0, 0], [1, 0], [1, 1], [0, 1]], (0.5, 0.5), math.sqrt(0.5)),
    ],
    ids=["a point", "one point thrice", "two points", "a line", "obtuse", "equilateral", "a square"],
)
def test_known_circles(points: list[list[float]], centre: tuple[float, float], radius: float) -> None:
    found_centre, found_radius = minimum_circle(points)
    assert np.allclose(found_centre, centre)
    assert found_radius == pytest.approx(radius)


@pytest.mark.parametrize("seed", range(6))
def test_circle_holds_all_and_no_other_centre_does_better(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(14, 2)) * [1.0, rng.uniform(0.05, 1.0)] + 10.0
    centre, radius = minimum_circle(points)
    distance = np.linalg.norm(points - centre, axis=1)
    assert distance.max() <= radius
    assert (distance > radius * (1.0 - 1e-9)).sum() >= 2
    others = centre + radius * 0.05 * rng.normal(size=(300, 2))
    assert np.linalg.norm(points - others[:, None], axis=-1).max(axis=1).min() > radius
