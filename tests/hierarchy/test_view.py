"""The camera: rigid, right-handed, looking down -z, with clip planes around the model."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from hierarchy.view import clip_planes, look_at

LAWS = settings(derandomize=True, deadline=None, max_examples=100)

UNIT_SPHERE = ((0.0, 0.0, 0.0), 1.0)
seeds = st.integers(0, 2**32 - 1)
angles = st.floats(0.01, 3.1)


def view_of(seed, view_angle=0.8, resolution=(64, 48), bounds=UNIT_SPHERE):
    eye, focus, up = np.random.default_rng(seed).normal(size=(3, 3)) * [[5.0], [1.0], [1.0]]
    return look_at(eye, focus, up, view_angle, resolution, bounds=bounds), eye, focus, up


def in_eye_space(view, point):
    return view.eye_from_model[:3, :3] @ np.asarray(point, float) + view.eye_from_model[:3, 3]


def project(view, point):
    """Return column and row, from the top left corner, of a point of model space."""
    clip = view.clip_from_eye @ np.append(in_eye_space(view, point), 1.0)
    x, y = clip[:2] / clip[3]
    return 0.5 * (x + 1.0) * view.width, 0.5 * (1.0 - y) * view.height


@LAWS
@given(seeds)
def test_look_at_is_rigid_and_right_handed(seed):
    view, eye, _, _ = view_of(seed)
    rotation = view.eye_from_model[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    np.testing.assert_array_equal(view.eye_from_model[3], [0, 0, 0, 1])
    np.testing.assert_allclose(view.eye, eye, atol=1e-9)


@LAWS
@given(seeds)
def test_the_focal_point_lies_straight_ahead_and_up_is_up(seed):
    view, eye, focus, up = view_of(seed)
    ahead = in_eye_space(view, focus)
    np.testing.assert_allclose(ahead, [0, 0, -np.linalg.norm(eye - focus)], atol=1e-9)
    turned_up = view.eye_from_model[:3, :3] @ up
    assert turned_up[0] == pytest.approx(0.0, abs=1e-9)
    assert turned_up[1] > 0.0
    np.testing.assert_allclose(project(view, focus), (32.0, 24.0), atol=1e-6)


def test_the_usual_view_is_the_usual_matrix():
    view = look_at((0, 0, 5), (0, 0, 0), (0, 1, 0), 0.8, (10, 10), bounds=UNIT_SPHERE)
    expected = np.eye(4)
    expected[2, 3] = -5.0
    np.testing.assert_allclose(view.eye_from_model, expected, atol=1e-15)
    # What is to the right, and above, is so in the picture.
    column, row = project(view, (0.5, 0.25, 0.0))
    assert column > 5.0
    assert row < 5.0


def test_the_models_origin_is_taken_off():
    origin = np.array([4.5e5, 5.2e6, 100.0])
    near = look_at((1, 2, 3), (0, 0, 1), (0, 0, 1), 0.8, (10, 10), bounds=UNIT_SPHERE)
    eye, focus = origin + np.array([1, 2, 3]), origin + np.array([0, 0, 1])
    far = look_at(eye, focus, (0, 0, 1), 0.8, (10, 10), origin=origin, bounds=UNIT_SPHERE)
    np.testing.assert_allclose(far.eye_from_model, near.eye_from_model, atol=1e-8)
    assert far.near == pytest.approx(near.near)


@LAWS
@given(seeds, angles, st.integers(1, 4000), st.integers(1, 4000))
def test_focal_pixels_is_the_size_of_a_unit_length_at_unit_depth(seed, view_angle, width, height):
    view, _, _, _ = view_of(seed, view_angle, (width, height))
    right, up, back = view.eye_from_model[:3, :3]
    middle = project(view, view.eye - 2.0 * back)
    np.testing.assert_allclose(middle, (0.5 * width, 0.5 * height), rtol=1e-9)
    aside = project(view, view.eye - 2.0 * back + 0.1 * right)
    above = project(view, view.eye - 2.0 * back + 0.1 * up)
    # Pixels are square; 0.1 at depth 2.
    assert aside[0] - middle[0] == pytest.approx(0.05 * view.focal_pixels, rel=1e-6)
    assert middle[1] - above[1] == pytest.approx(0.05 * view.focal_pixels, rel=1e-6)


@LAWS
@given(seeds, angles)
def test_the_view_angle_spans_the_height(seed, view_angle):
    view, _, _, _ = view_of(seed, view_angle)
    _, up, back = view.eye_from_model[:3, :3]
    _, row = project(view, view.eye - back + math.tan(0.5 * view_angle) * up)
    assert row == pytest.approx(0.0, abs=1e-6)


@LAWS
@given(seeds, st.floats(1e-3, 1e3))
def test_projected_depth_runs_from_near_to_far(seed, radius):
    view, _, _, _ = view_of(seed, bounds=((0.1, 0.2, -0.3), radius))
    back = view.eye_from_model[2, :3]
    for depth, expected in ((view.near, -1.0), (view.far, 1.0)):
        clip = view.clip_from_eye @ np.append(in_eye_space(view, view.eye - depth * back), 1.0)
        assert clip[2] / clip[3] == pytest.approx(expected, abs=1e-6)


@LAWS
@given(seeds, st.floats(1e-6, 1e6), st.sampled_from([0.0, 0.5, 1.5, 10.0, 1e6]))
def test_clip_planes_hold_the_sphere(seed, radius, distance):
    """From outside, from inside and from far away."""
    rng = np.random.default_rng(seed)
    centre = rng.normal(size=3) * radius
    away = rng.normal(size=3)
    eye = centre + distance * radius * away / np.linalg.norm(away)
    # Towards anything, not only the sphere.
    focus = eye + rng.normal(size=3) * radius
    view = look_at(eye, focus, rng.normal(size=3), 0.8, (10, 10), bounds=(centre, radius))
    assert 0.0 < view.near < view.far
    points = rng.normal(size=(50, 3))
    points = centre + radius * points / np.linalg.norm(points, axis=1, keepdims=True)
    depth = (points - eye) @ -view.eye_from_model[2, :3]
    if (depth > 0.0).any():
        assert depth.max() <= view.far
    # What is closer than the near plane is closer than a ten-thousandth of the far distance.
    assert depth[depth > 1e-4 * view.far].min(initial=view.far) >= view.near


def test_a_sphere_behind_the_eye_leaves_planes_that_can_be_used():
    near, far = clip_planes(np.eye(4), (np.array([0, 0, 100.0]), 1.0))
    assert 0.0 < near < far


@pytest.mark.parametrize("radius", [0.0, math.nan])
def test_a_model_without_a_size(radius):
    near, far = clip_planes(np.eye(4), (np.array([0, 0, -5.0]), radius))
    assert 0.0 < near < 5.0 < far


@pytest.mark.parametrize("up", [(0, 0, 1), (0, 0, -3), (0, 0, 0), (0, 1e-15, 1)])
def test_up_along_the_line_of_sight(up):
    view = look_at((0, 0, 4), (0, 0, 0), up, 0.8, (10, 10), bounds=UNIT_SPHERE)
    rotation = view.eye_from_model[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(rotation[2], [0, 0, 1], atol=1e-12)


@LAWS
@given(seeds, st.floats(-8.0, 8.0))
def test_the_length_of_up_does_not_matter(seed, exponent):
    view, eye, focus, up = view_of(seed)
    assume(np.linalg.norm(np.cross(up, eye - focus)) > 1e-3)
    scaled = look_at(eye, focus, up * 10.0**exponent, 0.8, (64, 48), bounds=UNIT_SPHERE)
    np.testing.assert_allclose(scaled.eye_from_model, view.eye_from_model, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"position": (0, 0, 0)}, "same point"),
        ({"position": (math.nan, 0, 1)}, "finite"),
        ({"focal_point": (math.inf, 0, 1)}, "finite"),
        ({"view_up": (0, math.nan, 0)}, "finite"),
        ({"view_angle": 0.0}, "view angle"),
        ({"view_angle": -0.5}, "view angle"),
        ({"view_angle": math.pi}, "view angle"),
        ({"view_angle": math.nan}, "view angle"),
        ({"resolution": (0, 10)}, "resolution"),
        ({"resolution": (10, -1)}, "resolution"),
    ],
)
def test_views_that_cannot_be(change, message):
    values = {
        "position": (0, 0, 3),
        "focal_point": (0, 0, 0),
        "view_up": (0, 1, 0),
        "view_angle": 0.8,
        "resolution": (10, 10),
    }
    with pytest.raises(ValueError, match=message):
        look_at(**{**values, **change}, bounds=UNIT_SPHERE)


@pytest.mark.parametrize("distance", [1e3, 1e15, 1e16, 1e30])
def test_clip_planes_far_away_stay_apart(distance):
    view = look_at((0, 0, distance), (0, 0, 0), (0, 1, 0), 0.8, (64, 64), bounds=((0, 0, 0), 1.0))
    assert 0.0 < view.near < view.far
    assert np.isfinite(view.clip_from_eye).all()


scales = st.floats(1e-3, 1e3)


def parallel_view(seed, scale=1.5, distance=1.0, size=(64, 48)):
    eye, focus, up = np.random.default_rng(seed).normal(size=(3, 3)) * [[5.0], [1.0], [1.0]]
    eye = focus + distance * (eye - focus)
    return look_at(eye, focus, up, 0.8, size, bounds=((0.1, -0.2, 0.3), 2.0), parallel_scale=scale), eye, focus


@LAWS
@given(seeds, scales, st.sampled_from([(64, 48), (1, 1), (7, 500)]))
def test_parallel_rays_show_lengths_alike_at_any_depth(seed, scale, size):
    view, eye, _ = parallel_view(seed, scale, size=size)
    right, up, back = view.eye_from_model[:3, :3]
    for depth in (-3.0, 0.0, 8.0):
        point = eye - depth * back
        assert project(view, point) == pytest.approx((0.5 * size[0], 0.5 * size[1]), abs=1e-9 * size[1] / scale)
        above, aside = project(view, point + scale * up), project(view, point + scale * right)
        assert above[1] == pytest.approx(0.0, abs=1e-9 * size[1] / scale)
        assert aside[0] - 0.5 * size[0] == pytest.approx(view.focal_pixels * scale, rel=1e-6)
    np.testing.assert_array_equal(view.pixels_of_unit([0.5, 7.0]), [view.focal_pixels] * 2)


@LAWS
@given(seeds, st.sampled_from([0.1, 1.0, 1e3, 1e6]))
def test_parallel_depths_are_those_from_the_position(seed, distance):
    view, eye, _ = parallel_view(seed, distance=distance)
    back = view.eye_from_model[2, :3]
    centre = np.array([0.1, -0.2, 0.3])
    for offset in (-2.0, 0.0, 2.0):
        point = centre + offset * back
        clip = view.clip_from_eye @ np.append(in_eye_space(view, point), 1.0)
        assert -1.0 < clip[2] < 1.0
        assert clip[3] == 1.0
        depth = view.depth_of_ndc(clip[2]) + view.depth_of_eye
        assert depth == pytest.approx((eye - point) @ back, abs=1e-12 * 10.0 * distance + 1e-12)


@LAWS
@given(seeds)
def test_from_a_million_diagonals_parallel_rays_show_what_they_show_near_by(seed):
    near, _, _ = parallel_view(seed)
    far, _, _ = parallel_view(seed, distance=1e6)
    # As float32, in which the GPU has it.
    np.testing.assert_allclose(far.eye_from_model, near.eye_from_model, atol=1e-7)
    assert (far.near, far.far) == (near.near, near.far)


@LAWS
@given(seeds)
def test_perspective_depths_come_back_from_the_projection(seed):
    view, _, _, _ = view_of(seed)
    for depth in (view.near, 0.5 * (view.near + view.far), view.far):
        clip = view.clip_from_eye @ [0.0, 0.0, -depth, 1.0]
        assert view.depth_of_ndc(clip[2] / clip[3]) == pytest.approx(depth, rel=1e-6)


@pytest.mark.parametrize("scale", [0.0, -1.0, math.inf, math.nan])
def test_a_parallel_scale_that_is_no_length_is_refused(scale):
    with pytest.raises(ValueError, match="parallel scale"):
        look_at((0, 0, 4), (0, 0, 0), (0, 1, 0), 0.8, (8, 8), bounds=UNIT_SPHERE, parallel_scale=scale)


def test_a_parallel_scale_is_a_length_of_the_file():
    in_file = {"origin": (1e7, 0, 0), "scale": 4.0, "parallel_scale": 2.0}
    view = look_at((1e7, 0, 40), (1e7, 0, 0), (0, 1, 0), 0.8, (8, 8), bounds=UNIT_SPHERE, **in_file)
    assert view.parallel_scale == 0.5


@pytest.mark.parametrize("size", [1e-320, 1e-200, 1e-3, 1e200, 1e308])
def test_directions_of_any_length_are_directions(size):
    expected, _, _, _ = view_of(3)
    eye, focus, up = np.random.default_rng(3).normal(size=(3, 3)) * [[5.0], [1.0], [1.0]]
    view = look_at(eye, focus, 0.25 * size * up, 0.8, (64, 48), bounds=UNIT_SPHERE)
    np.testing.assert_allclose(view.eye_from_model, expected.eye_from_model, atol=1e-3 if size < 1e-300 else 1e-12)


@pytest.mark.parametrize("distance", [1e-320, 1e-170])
def test_an_eye_next_to_the_focal_point_looks_at_it(distance):
    view = look_at((0, 0, distance), (0, 0, 0), (0, 1, 0), 0.8, (8, 8), bounds=UNIT_SPHERE)
    np.testing.assert_array_equal(view.eye_from_model[:3, :3], np.eye(3))


@pytest.mark.parametrize("scale", [None, 1.0])
@pytest.mark.parametrize("distance", [1e31, 1e154, 1e200, 1e308])
def test_an_eye_beyond_all_numbers_is_refused(distance, scale):
    with pytest.raises(ValueError, match="too far away"):
        look_at((0, distance, 0), (0, 0, 0), (0, 0, 1), 0.8, (8, 8), bounds=UNIT_SPHERE, parallel_scale=scale)
    with pytest.raises(ValueError, match="finite"), np.errstate(all="raise"):
        look_at((0, 1e308, 0), (0, 0, 0), (0, 0, 1), 0.8, (8, 8), bounds=UNIT_SPHERE, scale=1e-10)


@pytest.mark.parametrize(
    "what",
    [{"view_angle": 1e-10}, {"view_angle": math.pi - 1e-10}, {"parallel_scale": 1e-40}, {"parallel_scale": 1e300}],
)
def test_what_float32_cannot_project_is_refused(what):
    with pytest.raises(ValueError, match="too small or too large"):
        look_at((0, 0, 4), (0, 0, 0), (0, 1, 0), **({"view_angle": 0.8} | what), resolution=(8, 8), bounds=UNIT_SPHERE)
