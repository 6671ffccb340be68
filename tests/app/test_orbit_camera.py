"""The laws of the orbit camera, checked against the view that pictures are drawn with."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.orbit_camera import OrbitCamera, axes_of_up, fitting_distance, orbit_from_pose
from hierarchy.view import View, look_at

SIZE = (640, 480)

numbers = st.floats(-3.0, 3.0)
points = st.tuples(numbers, numbers, numbers).map(np.array)
pixels = st.tuples(st.floats(0.0, SIZE[0]), st.floats(0.0, SIZE[1]))
drags = st.floats(-900.0, 900.0)
ups = st.sampled_from([(0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.3, 0.8, -0.4)])
cameras = st.builds(
    OrbitCamera,
    pivot=points,
    distance=st.floats(0.1, 50.0),
    azimuth=st.floats(-math.pi, math.pi),
    elevation=st.floats(-0.5 * math.pi, 0.5 * math.pi),
    axes=ups.map(axes_of_up),
    view_angle=st.floats(0.2, 2.0),
    orthographic=st.booleans(),
)


def view_of(camera: OrbitCamera) -> View:
    return look_at(
        camera.position, camera.pivot, camera.view_up, camera.view_angle, SIZE,
        bounds=((0.0, 0.0, 0.0), 1.0), parallel_scale=camera.parallel_scale,
    )  # fmt: skip


def project(camera: OrbitCamera, point: np.ndarray) -> tuple[float, float, float]:
    """Return column and row in pixels from the top left corner, and the depth, as the picture has them."""
    view = view_of(camera)
    eye_point = view.eye_from_model[:3, :3] @ point + view.eye_from_model[:3, 3]
    clip = view.clip_from_eye @ np.append(eye_point, 1.0)
    x, y = clip[:2] / clip[3]
    return 0.5 * (x + 1.0) * SIZE[0], 0.5 * (1.0 - y) * SIZE[1], view.depth_of_eye - eye_point[2]


@given(cameras)
def test_pivot_is_in_the_middle_at_the_distance(camera):
    assert project(camera, camera.pivot) == pytest.approx((320.0, 240.0, camera.distance), abs=1e-6)


@given(cameras, pixels, st.floats(0.05, 20.0))
def test_point_under_a_pixel_is_drawn_there(camera, pixel, depth):
    point = camera.point_at(*pixel, depth, SIZE)
    assert project(camera, point) == pytest.approx((*pixel, depth), abs=1e-5)


@given(cameras, drags, drags)
def test_orbit_keeps_pivot_and_distance(camera, dx, dy):
    turned = camera.orbit(dx, dy, SIZE[1])
    assert np.array_equal(turned.pivot, camera.pivot)
    assert np.linalg.norm(turned.position - turned.pivot) == pytest.approx(camera.distance)


@given(cameras, drags, drags)
def test_orbit_keeps_up_upright(camera, dx, dy):
    """What is up in the model never points down on the screen, however far one drags."""
    turned = camera.orbit(dx, dy, SIZE[1])
    assert turned.view_up @ turned.axes[1] >= -1e-9
    assert turned.right @ turned.axes[1] == pytest.approx(0.0, abs=1e-9)


def test_orbit_drags_the_near_side_along():
    camera = orbit_from_pose((0.0, 0.0, 5.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.8)
    near_side = np.array([0.0, 0.0, 1.0])
    column, row, _ = project(camera.orbit(40.0, 25.0, SIZE[1]), near_side)
    assert column > 320.0
    assert row > 240.0


@given(cameras, pixels, drags, drags)
def test_pan_moves_the_pivots_depth_with_the_cursor(camera, pixel, dx, dy):
    grabbed = camera.point_at(*pixel, None, SIZE)
    column, row, depth = project(camera.pan(dx, dy, SIZE[1]), grabbed)
    assert (column, row) == pytest.approx((pixel[0] + dx, pixel[1] + dy), abs=1e-5)
    assert depth == pytest.approx(camera.distance)


@given(cameras, pixels, st.floats(0.1, 20.0), st.floats(0.2, 5.0))
def test_zoom_keeps_the_point_under_the_cursor(camera, pixel, depth, factor):
    target = camera.point_at(*pixel, depth, SIZE)
    column, row, new_depth = project(camera.zoom(factor, target), target)
    assert (column, row) == pytest.approx(pixel, abs=1e-4)
    assert new_depth == pytest.approx(factor * depth)


@given(cameras, pixels, st.floats(0.1, 20.0))
def test_turn_around_brings_a_point_into_the_middle(camera, pixel, depth):
    target = camera.point_at(*pixel, depth, SIZE)
    turned = camera.turn_around(target)
    # An orthographic camera keeps its distance, which is the size of the picture.
    new_depth = camera.distance if camera.orthographic else depth
    assert project(turned, target) == pytest.approx((320.0, 240.0, new_depth), abs=1e-5)
    assert np.allclose(turned.back, camera.back)


def test_turn_around_a_point_behind_the_eye_keeps_the_distance():
    camera = orbit_from_pose((0.0, 0.0, 5.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.8)
    assert camera.turn_around((0.0, 0.0, 9.0)).distance == 5.0


@given(cameras, points, st.floats(0.01, 20.0))
def test_fit_shows_a_whole_sphere(camera, centre, radius):
    fitted = camera.fit(centre, radius, SIZE[0] / SIZE[1])
    for direction in np.vstack([np.eye(3), -np.eye(3)]):
        column, row, _ = project(fitted, centre + radius * direction)
        assert 0.0 <= column <= SIZE[0]
        assert 0.0 <= row <= SIZE[1]


def test_fit_of_a_tall_picture_leaves_room_at_the_sides():
    assert fitting_distance(1.0, 0.8, 0.5) > fitting_distance(1.0, 0.8, 1.0) == fitting_distance(1.0, 0.8, 2.0)


@given(cameras, pixels)
def test_the_projection_keeps_the_size_at_the_pivot(camera, pixel):
    at_pivot = camera.point_at(*pixel, None, SIZE)
    other = replace(camera, orthographic=not camera.orthographic)
    assert project(other, at_pivot) == pytest.approx(project(camera, at_pivot), abs=1e-5)


@given(cameras, st.floats(0.01, 20.0), st.sampled_from([0.4, 1.0, 2.5]))
def test_fit_fills_the_picture(camera, radius, aspect):
    """As far as the sphere reaches to both sides, and up and down: the narrower of the two is nearly filled."""
    fitted = camera.fit((0.1, 0.2, 0.3), radius, aspect)
    half = math.tan(0.5 * fitted.view_angle) * min(aspect, 1.0)
    if fitted.orthographic:
        share = radius / (fitted.distance * half)
    else:
        share = math.tan(math.asin(radius / fitted.distance)) / half
    assert 0.8 < share < 1.0


@given(cameras)
def test_pose_round_trip(camera):
    again = orbit_from_pose(
        camera.position, camera.pivot, camera.axes[1], camera.view_angle, orthographic=camera.orthographic
    )
    assert again.orthographic == camera.orthographic
    assert np.allclose(again.position, camera.position)
    assert np.allclose(again.back, camera.back, atol=1e-6)


@given(points, points, ups)
def test_pose_gives_the_same_picture_as_look_at(position, focal_point, up):
    back = position - focal_point
    # Along view-up the roll is anybody's choice.
    if np.linalg.norm(np.cross(back, up)) < 1e-3:
        return
    view = look_at(position, focal_point, up, 0.8, SIZE, bounds=((0.0, 0.0, 0.0), 1.0))
    assert np.allclose(view_of(orbit_from_pose(position, focal_point, up, 0.8)).eye_from_model, view.eye_from_model)


@pytest.mark.parametrize(("up", "front"), [((0, 1, 0), (0, 0, 1)), ((0, 0, 1), (0, -1, 0))])
def test_front_of_the_usual_ups(up, front):
    side, axis, forward = axes_of_up(up)
    assert np.allclose(side, (1, 0, 0))
    assert np.allclose(axis, up)
    assert np.allclose(forward, front)


@given(ups)
def test_axes_are_a_rotation(up):
    axes = axes_of_up(up)
    assert np.allclose(axes @ axes.T, np.eye(3))
    assert np.linalg.det(axes) == pytest.approx(1.0)


def test_eye_at_the_focal_point_is_no_pose():
    with pytest.raises(ValueError, match="same point"):
        orbit_from_pose((1.0, 2.0, 3.0), (1.0, 2.0, 3.0), (0.0, 1.0, 0.0), 0.8)
