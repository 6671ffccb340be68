"""What selection culls, against exact arithmetic: nothing that the eye sees, where there is no room for rounding."""

from __future__ import annotations

import math

import numba as nb
import numpy as np
import pytest
from brute_selection import side_as_printed
from cone_cases import Cases, random_cones, tiny, too_wide, too_wide_exactly, units
from edge_on import EDGE_ON, PIXELS, visible_thickness

from hierarchy.cones import EVERYTHING
from hierarchy.facing import BACK, FRONT, SILHOUETTE, classify_cone, classify_cone_printed, faces_away
from hierarchy.lod import frustum_planes
from hierarchy.traversal import NOT_SEEN, _crossed
from hierarchy.view import View, look_at

# Nearer to its limit than this (radians), a cone is judged in sixty digits: long doubles have nineteen.
DOUBTFUL = 1e-8
# By how much a cone may face away (radians) and still be taken for silhouette: 2.5e-7 of a cosine near 1 is the margin
# for the rounding of what nodes store, which itself is half of that.
MISSED = math.sqrt(2.0 * (2.5e-7 + 1.2e-7))
# What rounding may take off the largest picture at its border: some tens of units in the last place.
SLIVER = 64 * 2.0**-53 * PIXELS


@nb.njit
def _classify_all(axes, towards, spheres, sines, cosines, sides):  # type: ignore[no-untyped-def]
    for i in range(len(axes)):
        x, y, z = towards[i, 0], towards[i, 1], towards[i, 2]
        facing = axes[i, 0] * x + axes[i, 1] * y + axes[i, 2] * z
        sphere, sine, cosine = np.float64(spheres[i]), np.float64(sines[i]), np.float64(cosines[i])
        sides[i] = classify_cone(facing, x * x + y * y + z * z, sphere, sine, cosine)


def sides_of(cases: Cases) -> np.ndarray:
    """Classify as the selection does, with sines as the hierarchy stores them."""
    axes, towards, spheres, cosines = cases
    sines = np.sqrt(np.maximum(1.0 - cosines.astype(np.float64) ** 2, 0.0)).astype(np.float32)
    sides = np.empty(len(axes), np.int64)
    _classify_all(axes, towards, spheres, np.where(cosines == EVERYTHING, np.float32(0.0), sines), cosines, sides)
    return sides


def falsely(cases: Cases, sides: np.ndarray, side: int, excess: np.ndarray) -> float:
    """Return the largest angle by which a cone that was given a side is too wide for it, 0 where none is."""
    doubtful = np.flatnonzero((sides == side) & (excess > -DOUBTFUL))
    exact = [too_wide_exactly(cases, int(i), for_back=side == BACK) for i in doubtful]
    return max([*exact, 0.0])


def test_no_conefaces_away_or_the_eye_that_does_not(ledger, amount, rng):
    cases = random_cones(rng, amount(10_000, 600_000))
    sides = sides_of(cases)
    back, front = too_wide(cases)
    assert {BACK, FRONT, SILHOUETTE} == set(sides.tolist())
    worst = max(falsely(cases, sides, BACK, back), falsely(cases, sides, FRONT, front))
    tried = "cones of 0 to 90 degrees and of everything, 1e6 radii away to inside the sphere, on their limits to 1e-17"
    ledger.record("kernels", "false culls by cone", tried, cases=len(sides), worst=worst, bound=0.0, unit="rad")
    missed = max(float(-back[sides != BACK].min()), float(-front[sides != FRONT].min()))
    tried = "the same: how far past its limit a cone still counts as silhouette"
    ledger.record("kernels", "cones missed", tried, cases=len(sides), worst=missed, bound=MISSED, unit="rad")


def test_a_long_axis_of_a_cone_just_below_a_right_angle_culls_nothing_that_is_seen():
    """float32 axes are up to 9e-8 too long; beside a cone of next to 90 degrees that is an angle of 4e-4."""
    axis = np.array([0.57735026, 0.57735026, 0.57735032], np.float32)
    axis = np.nextafter(axis, np.float32(2.0))
    assert np.linalg.norm(axis.astype(np.float64)) > 1.0 + 5e-8
    aside = np.cross(axis, [1.0, 0.0, 0.0])
    aside /= np.linalg.norm(aside)
    towards = axis.astype(np.float64) + 2e-4 * aside
    cases = axis[None], towards[None], np.zeros(1, np.float32), np.array([1e-6], np.float32)
    assert too_wide_exactly(cases, 0, for_back=True) > 1e-4
    assert sides_of(cases).tolist() == [SILHOUETTE]


@pytest.mark.parametrize("seed", range(4))
def test_a_sphere_without_a_size_and_a_cone_without_an_angle_have_two_sides(seed):
    axis = units(np.random.default_rng(seed), 1).astype(np.float32)
    zero, one = np.zeros(1, np.float32), np.ones(1, np.float32)
    for distance in (1e-6, 1.0, 1e6):
        assert sides_of((axis, distance * axis.astype(np.float64), zero, one)).tolist() == [BACK]
        assert sides_of((axis, -distance * axis.astype(np.float64), zero, one)).tolist() == [FRONT]
    # The eye in the point itself.
    assert sides_of((axis, np.zeros((1, 3)), zero, one)).tolist() == [SILHOUETTE]


def test_the_printed_cone_test_at_its_poles(ledger, amount, rng):
    count = amount(4_000, 100_000)
    half = np.where(rng.random(count) < 0.5, rng.uniform(0.0, 0.5 * np.pi, count), tiny(rng, count))
    alpha = np.where(rng.random(count) < 0.5, rng.uniform(0.02, 2.97, count), 0.5 * np.pi - half + tiny(rng, count))
    axes, aside = units(rng, count), units(rng, count)
    sights = np.where(rng.random((count, 1)) < 0.2, axes * rng.choice([-1.0, 1.0], (count, 1)), aside)
    worst = 0.0
    for axis, sight, beta, angle in zip(axes, sights, half, alpha, strict=True):
        facing, cosine = float(axis @ sight), math.cos(beta)
        found = classify_cone_printed(facing, math.sin(beta), cosine, math.sin(angle), math.cos(angle))
        if found != side_as_printed(axis, beta, sight, angle):
            worst = max(worst, min(abs(abs(facing) - math.sin(beta + angle)), abs(beta + angle - 0.5 * math.pi)))
    tried = "fov 1 to 170 degrees, cones of 0 to 90 degrees along and across the line of sight, on the pole"
    ledger.record("kernels", "printed cone test", tried, cases=count, worst=worst, bound=1e-15, unit="cosine")


def random_view(rng: np.random.Generator) -> View:
    """Return a view of 1 to 170 degrees, or a parallel one, of up to 16,384 pixels, up to 1e6 radii away."""
    distance = 10.0 ** rng.uniform(-3, 6)
    size = (int(rng.integers(1, PIXELS)), int(rng.integers(1, PIXELS)))
    scale = 10.0 ** rng.uniform(-3, 1) if rng.random() < 0.3 else None
    (eye, up), aside = units(rng, 2), rng.normal(size=3)
    angle = math.radians(rng.choice([1.0, 170.0, rng.uniform(1, 170)]))
    bounds = ((0.0, 0.0, 0.0), 1.0)
    return look_at(distance * eye, 0.2 * min(distance, 1) * aside, up, angle, size, bounds=bounds, parallel_scale=scale)


def pixels_inside(view: View, points: np.ndarray) -> np.ndarray:
    """Return by how many pixels points (N, 3) are inside of the sides, in long doubles; -inf where nearer than near."""
    matrix, move = (part.astype(np.longdouble) for part in np.split(view.eye_from_model[:3], [3], axis=1))
    x, y, z = matrix @ points.T.astype(np.longdouble) + move
    pixels = view.focal_pixels / (np.ones_like(z) if view.is_parallel else -z)
    sides = np.minimum(0.5 * view.width - np.abs(x) * pixels, 0.5 * view.height - np.abs(y) * pixels)
    return np.where(-z > view.near, sides, -np.inf)


def test_the_frustum_culls_no_visible_point(ledger, amount, rng):
    views, points, worst = amount(60, 6_000), 40, 0.0
    for _ in range(views):
        view = random_view(rng)
        planes = frustum_planes(view)
        # Points on the border of the picture, and spheres that touch or hold them.
        depth = rng.uniform(view.near, view.far, points)
        reach = 1.0 if view.is_parallel else depth
        across = rng.uniform(-1, 1, (2, points))
        across[rng.integers(0, 2, points), np.arange(points)] = rng.choice([-1, 1], points) * (1 - tiny(rng, points))
        half = view.half_height * np.array([view.width / view.height, 1.0])
        eye_points = np.stack([half[0] * across[0] * reach, half[1] * across[1] * reach, -depth], 1)
        move = view.eye_from_model[:3, 3]
        at = (eye_points - move) @ view.eye_from_model[:3, :3]
        radii = np.where(rng.random(points) < 0.3, 0.0, tiny(rng, points)).astype(np.float32)
        outwards = np.where(rng.random((points, 1)) < 0.7, -planes[rng.integers(1, 5, points), :3], units(rng, points))
        centres = (at + radii[:, None] * outwards).astype(np.float32)
        # The point of the sphere nearest to the one on the border.
        offset = at - centres
        length = np.linalg.norm(offset, axis=1)
        share = np.divide(np.minimum(radii, length), length, out=np.zeros(points), where=length > 0.0)
        inside = pixels_inside(view, centres + share[:, None] * offset)
        for centre, radius, depth_inside in zip(centres, radii, inside, strict=True):
            x, y, z = centre - view.eye
            if depth_inside > worst and _crossed(planes, 31, x, y, z, np.float64(radius)) == NOT_SEEN:
                worst = float(depth_inside)
    tried = "points and spheres on the border, fov 1 to 170 degrees and parallel, 1e6 radii away, 16,384 pixels"
    ledger.record("kernels", "frustum culling", tried, cases=views * points, worst=worst, bound=SLIVER, unit="px")


def test_no_leaf_triangle_that_is_seenfaces_away(ledger, amount, rng):
    count, worst, culled = amount(2_000, 60_000), 0.0, 0
    for _ in range(count):
        a, u, v = rng.normal(size=(3, 3)) * [[0.5], [10.0 ** rng.uniform(-6, 0)], [10.0 ** rng.uniform(-6, 0)]]
        if rng.random() < 0.4:
            # A needle: the corners next to a line.
            v = rng.uniform(-1, 1) * u + tiny(rng, 1)[0] * v
        corners = np.stack([a, a + u, a + v]).astype(np.float32)
        a, u, v = corners[0].astype(float), *(corners[k].astype(float) - corners[0] for k in (1, 2))
        # An eye in the triangle's plane, or next to it, from within it to 1e6 away; or parallel rays along it.
        s, t = rng.normal(size=2) * 10.0 ** rng.uniform(-2, 7)
        normal = np.cross(u, v)
        beside = rng.choice([0.0, 1.0, -1.0]) * tiny(rng, 1)[0] * normal
        if rng.random() < 0.3:
            sight = s * u + t * v + beside
            length = np.linalg.norm(sight)
            eye = np.append(sight / length if length > 0.0 else [0.0, 0.0, 1.0], 0.0)
        else:
            eye = np.append(a + s * u + t * v + beside, 1.0)
        if faces_away(corners, 0, 1, 2, eye):
            culled += 1
            worst = max(worst, visible_thickness(corners.astype(float), eye))
    assert count // 4 < culled < count
    tried = "needles to 1e-17, eyes in their planes or 1e-17 before them, from within to 1e7 edges away, parallel rays"
    what = "front of a culled leaf triangle"
    ledger.record("kernels", what, tried, cases=count, worst=worst, bound=EDGE_ON, unit="px thick")
