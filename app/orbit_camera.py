"""A camera that turns around a point: pure mathematics, knows no window.

It is a turntable: the direction that is up stays upright on the screen, and the eye runs over a sphere around the
pivot in azimuth and elevation. All points are in the file's own space; pixels are counted from the top left corner of
the picture, so that the centre of the first pixel is at (0.5, 0.5).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from hierarchy.model import Float64Array

# Dragging across the whole height of the picture turns the model by half a turn.
TURN_PER_HEIGHT = math.pi

# A little air around a model that has been fitted into the picture.
FIT_MARGIN = 1.04


@dataclass(frozen=True, eq=False)
class OrbitCamera:
    """An eye that looks at a pivot.

    pivot : float64 (3,), what the camera turns around; it stands in the middle of the picture
    distance : from the eye to the pivot, greater than 0
    azimuth, elevation : radians; 0, 0 puts the eye on the front axis, elevation pi/2 above the pivot
    axes : float64 (3, 3), rows: the side, up and front axis, orthonormal, side x up = front
    view_angle : radians, full vertical field of view
    orthographic : the view rays are parallel. What stands at the pivot is as large as in perspective, so the distance
        sets the size of the picture, too
    """

    pivot: Float64Array
    distance: float
    azimuth: float
    elevation: float
    axes: Float64Array
    view_angle: float
    orthographic: bool = False

    @property
    def parallel_scale(self) -> float | None:
        """Half the height of what an orthographic camera sees; None: it is in perspective."""
        return self.distance * math.tan(0.5 * self.view_angle) if self.orthographic else None

    @property
    def back(self) -> Float64Array:
        """Unit vector from the pivot to the eye, (3,)."""
        flat = math.cos(self.elevation)
        weights = np.array([flat * math.sin(self.azimuth), math.sin(self.elevation), flat * math.cos(self.azimuth)])
        return weights @ self.axes

    @property
    def right(self) -> Float64Array:
        """Unit vector that points right on the screen, (3,)."""
        return np.array([math.cos(self.azimuth), 0.0, -math.sin(self.azimuth)]) @ self.axes

    @property
    def view_up(self) -> Float64Array:
        """Unit vector that points up on the screen, (3,); perpendicular to the line of sight."""
        return np.cross(self.back, self.right)

    @property
    def position(self) -> Float64Array:
        """Where the eye is, (3,)."""
        return self.pivot + self.distance * self.back

    def orbit(self, dx: float, dy: float, height: int) -> OrbitCamera:
        """Turn with a drag of (dx, dy) pixels, dy down, in a picture `height` pixels high; stops at the poles."""
        turn = TURN_PER_HEIGHT / height
        elevation = min(max(self.elevation + dy * turn, -0.5 * math.pi), 0.5 * math.pi)
        return replace(self, azimuth=math.remainder(self.azimuth - dx * turn, 2.0 * math.pi), elevation=elevation)

    def pan(self, dx: float, dy: float, height: int) -> OrbitCamera:
        """Shift with a drag of (dx, dy) pixels, dy down: what is as deep as the pivot follows the cursor."""
        scale = self._length_per_pixel(height)
        return replace(self, pivot=self.pivot + scale * (dy * self.view_up - dx * self.right))

    def zoom(self, factor: float, towards: npt.ArrayLike) -> OrbitCamera:
        """Scale the camera's place by `factor` (< 1: nearer) about a point, which stays where it is on the screen."""
        fixed = np.asarray(towards, np.float64)
        return replace(self, pivot=fixed + factor * (self.pivot - fixed), distance=factor * self.distance)

    def look_from(self, azimuth: float, elevation: float) -> OrbitCamera:
        """Look from another direction at the same pivot."""
        return replace(self, azimuth=azimuth, elevation=elevation)

    def turn_around(self, pivot: npt.ArrayLike) -> OrbitCamera:
        """Slide sideways until `pivot`, a point before the eye, is in the middle, and turn around it from now on."""
        target = np.asarray(pivot, np.float64)
        if self.orthographic:
            return replace(self, pivot=target)
        depth = float((self.position - target) @ self.back)
        return replace(self, pivot=target, distance=depth if depth > 0.0 else self.distance)

    def fit(self, centre: npt.ArrayLike, radius: float, aspect: float) -> OrbitCamera:
        """Show a whole sphere from the same direction; aspect is width over height."""
        distance = fitting_distance(radius, self.view_angle, aspect, orthographic=self.orthographic)
        return replace(self, pivot=np.asarray(centre, np.float64), distance=distance)

    def point_at(self, x: float, y: float, depth: float | None, resolution: tuple[int, int]) -> Float64Array:
        """Return the point (3,) under pixel (x, y) at `depth` along the view axis; None: as deep as the pivot."""
        width, height = resolution
        depth = self.distance if depth is None else depth
        scale = self._length_per_pixel(height) * (1.0 if self.orthographic else depth / self.distance)
        across = (x - 0.5 * width) * self.right - (y - 0.5 * height) * self.view_up
        return self.position - depth * self.back + scale * across

    def _length_per_pixel(self, height: int) -> float:
        """How long a pixel is at the pivot's depth."""
        return 2.0 * self.distance * math.tan(0.5 * self.view_angle) / height


def orbit_from_pose(
    position: npt.ArrayLike,
    focal_point: npt.ArrayLike,
    view_up: npt.ArrayLike,
    view_angle: float,
    *,
    orthographic: bool = False,
) -> OrbitCamera:
    """Return the orbit camera that sees what an eye at `position` sees; its pivot is the focal point.

    Raises ValueError where the eye is at the focal point.
    """
    focal_point = np.asarray(focal_point, np.float64)
    back = np.asarray(position, np.float64) - focal_point
    distance = float(np.linalg.norm(back))
    if not distance > 0.0:
        raise ValueError("the camera's position and focal point are the same point")
    axes = axes_of_up(view_up)
    side, up, front = axes @ (back / distance)
    elevation = math.asin(min(max(float(up), -1.0), 1.0))
    # Looking straight down or up, any azimuth would do; 0 puts the side axis to the right.
    azimuth = math.atan2(float(side), float(front)) if math.hypot(side, front) > 1e-9 else 0.0
    return OrbitCamera(focal_point, distance, azimuth, elevation, axes, view_angle, orthographic)


def axes_of_up(view_up: npt.ArrayLike) -> Float64Array:
    """Return the side, up and front axes (3, 3) for a direction that is up: x, y, z for +y and x, z, -y for +z."""
    up = np.asarray(view_up, np.float64)
    up = up / np.linalg.norm(up)
    front = np.array([0.0, -1.0, 0.0]) if abs(up[2]) > 0.9 else np.array([0.0, 0.0, 1.0])
    side = np.cross(up, front)
    side /= np.linalg.norm(side)
    return np.stack([side, up, np.cross(side, up)])


def fitting_distance(radius: float, view_angle: float, aspect: float, *, orthographic: bool = False) -> float:
    """Return how far from a sphere's centre a camera sees it whole, with a little air around it."""
    half = 0.5 * view_angle
    narrower = min(half, math.atan(math.tan(half) * aspect))
    size = FIT_MARGIN * (radius if radius > 0.0 else 1.0)
    return size / (math.tan(narrower) if orthographic else math.sin(narrower))
