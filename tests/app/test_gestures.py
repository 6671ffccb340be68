"""What the mouse does, without a window: which button moves the camera how, and what is a double click."""

import numpy as np
import pytest

from app.gestures import FARTHEST, NEAREST, Button, Gestures
from app.orbit_camera import orbit_from_pose

SIZE = (640, 480)
CAMERA = orbit_from_pose((0.0, 0.0, 5.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.8)


def no_surface(x, y):
    return None


def press(gestures, button, at=(100.0, 100.0), *, shift=False, now=0.0):
    return gestures.press(CAMERA, button, at, shift=shift, now=now, size=SIZE)


@pytest.mark.parametrize(
    ("button", "shift", "pans"),
    [(Button.LEFT, False, False), (Button.LEFT, True, True), (Button.MIDDLE, False, True), (Button.RIGHT, False, True)],
)
def test_buttons_orbit_or_pan(button, shift, pans):
    gestures = Gestures(no_surface)
    press(gestures, button, shift=shift)
    moved = gestures.drag(CAMERA, 30.0, 20.0, SIZE)
    assert np.array_equal(moved.pivot, CAMERA.pivot) != pans
    assert (moved.azimuth == CAMERA.azimuth) == pans


def test_nothing_moves_before_a_press_and_after_the_release():
    gestures = Gestures(no_surface)
    assert gestures.drag(CAMERA, 30.0, 20.0, SIZE) is CAMERA
    press(gestures, Button.LEFT)
    assert gestures.dragging
    gestures.release(Button.MIDDLE)
    assert gestures.dragging
    gestures.release(Button.LEFT)
    assert gestures.drag(CAMERA, 30.0, 20.0, SIZE) is CAMERA


def test_second_button_does_not_change_the_drag():
    gestures = Gestures(no_surface)
    press(gestures, Button.LEFT)
    press(gestures, Button.MIDDLE)
    assert np.array_equal(gestures.drag(CAMERA, 30.0, 20.0, SIZE).pivot, CAMERA.pivot)


def test_double_click_puts_the_pivot_on_the_surface():
    gestures = Gestures(lambda x, y: 4.0)
    press(gestures, Button.LEFT, (200.0, 300.0), now=1.0)
    turned = press(gestures, Button.LEFT, (201.0, 300.0), now=1.2)
    assert np.allclose(turned.pivot, CAMERA.point_at(201.0, 300.0, 4.0, SIZE))
    # A third press begins anew.
    assert press(gestures, Button.LEFT, (201.0, 300.0), now=1.3) is CAMERA


@pytest.mark.parametrize(("at", "now"), [((200.0, 300.0), 2.0), ((230.0, 300.0), 1.2)])
def test_late_or_distant_presses_are_no_double_click(at, now):
    gestures = Gestures(lambda x, y: 4.0)
    press(gestures, Button.LEFT, (200.0, 300.0), now=1.0)
    assert press(gestures, Button.LEFT, at, now=now) is CAMERA


def test_double_click_beside_the_model_changes_nothing():
    gestures = Gestures(no_surface)
    press(gestures, Button.LEFT, now=1.0)
    assert press(gestures, Button.LEFT, now=1.1) is CAMERA


def test_wheel_brings_what_is_under_the_cursor_nearer():
    near = Gestures(lambda x, y: 3.0).wheel(CAMERA, 2.0, (100.0, 50.0), radius=1.0, size=SIZE)
    fixed = CAMERA.point_at(100.0, 50.0, 3.0, SIZE)
    assert np.linalg.norm(near.position - fixed) < np.linalg.norm(CAMERA.position - fixed)
    assert np.allclose(near.point_at(100.0, 50.0, 3.0 * near.distance / CAMERA.distance, SIZE), fixed)


def test_wheel_there_and_back_is_no_move():
    gestures = Gestures(no_surface)
    there = gestures.wheel(CAMERA, 3.0, (100.0, 50.0), radius=1.0, size=SIZE)
    back = gestures.wheel(there, -3.0, (100.0, 50.0), radius=1.0, size=SIZE)
    assert np.allclose(back.position, CAMERA.position)


@pytest.mark.parametrize(("notches", "limit"), [(1000.0, NEAREST), (-1000.0, FARTHEST)])
def test_wheel_stops(notches, limit):
    zoomed = Gestures(no_surface).wheel(CAMERA, notches, (320.0, 240.0), radius=2.0, size=SIZE)
    assert zoomed.distance == pytest.approx(limit * 2.0)
