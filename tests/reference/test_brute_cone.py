"""The brute-force cap against caps known in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from brute_cone import minimum_cap

AXES = np.eye(3)


def unit(vectors: object) -> np.ndarray:
    vectors = np.asarray(vectors, np.float64)
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def test_one_direction_is_its_own_cap() -> None:
    axis, angle = minimum_cap([[0.0, 0.6, 0.8]])
    assert np.allclose(axis, [0.0, 0.6, 0.8])
    assert angle == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("apart", [1e-7, 0.3, 1.5, 3.0])
def test_two_directions_span_half_their_angle(apart: float) -> None:
    axis, angle = minimum_cap([[1.0, 0.0, 0.0], [math.cos(apart), math.sin(apart), 0.0]])
    assert angle == pytest.approx(0.5 * apart, rel=1e-8)
    assert np.allclose(axis, [math.cos(0.5 * apart), math.sin(0.5 * apart), 0.0])


def test_three_axes_span_the_angle_to_the_diagonal() -> None:
    axis, angle = minimum_cap(AXES)
    assert angle == pytest.approx(math.acos(1.0 / math.sqrt(3.0)))
    assert np.allclose(axis, 1.0 / math.sqrt(3.0))


@pytest.mark.parametrize(
    "directions",
    [
        [[0, 0, 1], [0, 0, -1]],
        [[0, 0, 1], [0, 0, -1], [1, 0, 0], [0, 1, 0]],
        [[math.cos(k), math.sin(k), 0.0] for k in np.linspace(0.0, 2.0 * math.pi, 7)],
    ],
    ids=["a line", "a line and two more", "a great circle"],
)
def test_directions_that_fill_a_hemisphere_exactly_need_ninety_degrees(directions: list[list[float]]) -> None:
    axis, angle = minimum_cap(directions)
    assert angle == pytest.approx(0.5 * math.pi)
    assert (np.asarray(directions) @ axis).min() > -1e-12


def test_directions_all_around_fit_into_no_cap() -> None:
    tetrahedron = unit([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    assert minimum_cap(tetrahedron)[1] == math.pi
    assert minimum_cap(np.concatenate([AXES, -AXES]))[1] == math.pi


@pytest.mark.parametrize("seed", range(6))
def test_a_cap_with_three_on_its_rim_is_found_and_no_other_axis_does_better(seed: int) -> None:
    rng = np.random.default_rng(seed)
    half_angle = rng.uniform(0.05, 1.5)
    around = rng.uniform(0.0, 0.5) + np.array([0.0, 2.1, 4.2])
    rim = np.stack([np.cos(around), np.sin(around)], 1) * math.sin(half_angle)
    inside = rng.uniform(-1.0, 1.0, (12, 2))
    inside = inside[np.linalg.norm(inside, axis=1) < 1.0] * math.sin(half_angle)
    flat = np.concatenate([rim, inside])
    local = np.concatenate([flat, np.sqrt(1.0 - (flat**2).sum(axis=1))[:, None]], axis=1)
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    # Both turns round the rim: the order of three points must not matter.
    directions = (local @ rotation.T)[:: 1 if seed % 2 else -1]
    axis, angle = minimum_cap(directions)
    assert angle == pytest.approx(half_angle, rel=1e-9)
    assert np.allclose(axis, rotation[:, 2], atol=1e-8)
    others = unit(axis + 0.1 * rng.normal(size=(200, 3)))
    assert np.arccos((others @ directions.T).min(axis=1)).min() > angle
