"""What a mouse does to the camera: presses, drags, the wheel and double clicks; knows no window."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum, auto

from app.orbit_camera import OrbitCamera

# Two presses are a double click when they are this close in time (seconds) and place (pixels).
DOUBLE_CLICK_SECONDS = 0.4
DOUBLE_CLICK_PIXELS = 6.0

# One notch of the wheel brings the eye this much nearer.
ZOOM_PER_NOTCH = 0.86

# The eye keeps between these multiples of the model's radius from the pivot.
NEAREST, FARTHEST = 1e-4, 1e3

DepthAt = Callable[[float, float], float | None]


class Button(Enum):
    """A button of the mouse."""

    LEFT = auto()
    MIDDLE = auto()
    RIGHT = auto()


class Gestures:
    """Turns what the mouse does into cameras.

    All positions are pixels of the picture from its top left corner. `depth_at` gives the depth of the surface under
    such a position, None where there is none.
    """

    def __init__(self, depth_at: DepthAt) -> None:
        self._depth_at = depth_at
        self._button: Button | None = None
        self._pans = False
        self._last_press = (-1e9, 0.0, 0.0)

    @property
    def dragging(self) -> bool:
        """A button that was pressed over the picture is still down."""
        return self._button is not None

    def press(
        self,
        camera: OrbitCamera,
        button: Button,
        at: tuple[float, float],
        *,
        shift: bool,
        now: float,
        size: tuple[int, int],
    ) -> OrbitCamera:
        """Begin a drag; the second press of a double click puts the pivot on the surface below."""
        if self._button is None:
            self._button, self._pans = button, shift or button is not Button.LEFT
        if button is not Button.LEFT:
            return camera
        then, x, y = self._last_press
        near = abs(at[0] - x) <= DOUBLE_CLICK_PIXELS and abs(at[1] - y) <= DOUBLE_CLICK_PIXELS
        if not near or now - then > DOUBLE_CLICK_SECONDS:
            self._last_press = (now, *at)
            return camera
        self._last_press = (-1e9, 0.0, 0.0)
        depth = self._depth_at(*at)
        return camera if depth is None else camera.turn_around(camera.point_at(*at, depth, size))

    def release(self, button: Button) -> None:
        """End the drag that this button began."""
        if button is self._button:
            self._button = None

    def drag(self, camera: OrbitCamera, dx: float, dy: float, size: tuple[int, int]) -> OrbitCamera:
        """Move with the button held by (dx, dy) pixels, dy down."""
        if self._button is None:
            return camera
        return camera.pan(dx, dy, size[1]) if self._pans else camera.orbit(dx, dy, size[1])

    def wheel(
        self, camera: OrbitCamera, notches: float, at: tuple[float, float], *, radius: float, size: tuple[int, int]
    ) -> OrbitCamera:
        """Zoom towards what is under the cursor; beside the model, towards the point as deep as the pivot."""
        wanted = camera.distance * ZOOM_PER_NOTCH**notches
        factor = min(max(wanted, NEAREST * radius), FARTHEST * radius) / camera.distance
        return camera.zoom(factor, camera.point_at(*at, self._depth_at(*at), size))
