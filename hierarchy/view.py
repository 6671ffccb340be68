"""A pinhole camera: where the eye is, what it sees, and how long a length is in pixels there."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hierarchy.model import Float64Array

# The near plane stands at least this fraction of the far distance before the eye: a 24-bit depth buffer then
# still resolves far / 2000 at the far end.
NEAR_OVER_FAR = 1e-4


@dataclass(frozen=True, eq=False)
class View:
    """A perspective view of model space; eye space is right-handed and looks down -z.

    eye_from_model : float64 (4, 4), rigid (rotation and translation only)
    view_angle : full vertical field of view in radians, in (0, pi)
    width, height : resolution in pixels
    near, far : positive distances of the clip planes along the view axis
    """

    eye_from_model: Float64Array
    view_angle: float
    width: int
    height: int
    near: float
    far: float

    @property
    def eye(self) -> Float64Array:
        """Position of the eye in model space, float64 (3,)."""
        rotation, translation = self.eye_from_model[:3, :3], self.eye_from_model[:3, 3]
        return -rotation.T @ translation

    @property
    def focal_pixels(self) -> float:
        """Pixels that a unit length perpendicular to the axis covers at unit depth (Holst 2007, eq. 6)."""
        return self.height / (2.0 * math.tan(0.5 * self.view_angle))

    @property
    def clip_from_eye(self) -> Float64Array:
        """The perspective projection of OpenGL, float64 (4, 4)."""
        f = 1.0 / math.tan(0.5 * self.view_angle)
        depth = self.near - self.far
        matrix = np.zeros((4, 4))
        matrix[0, 0] = f * self.height / self.width
        matrix[1, 1] = f
        matrix[2, 2] = (self.far + self.near) / depth
        matrix[2, 3] = 2.0 * self.far * self.near / depth
        matrix[3, 2] = -1.0
        return matrix


def look_at(
    position: npt.ArrayLike,
    focal_point: npt.ArrayLike,
    view_up: npt.ArrayLike,
    view_angle: float,
    resolution: tuple[int, int],
    *,
    origin: npt.ArrayLike = (0.0, 0.0, 0.0),
    bounds: tuple[npt.ArrayLike, float],
) -> View:
    """Make the view of an eye at `position` that looks at `focal_point`.

    position, focal_point : (3,), in the file's own space
    view_up : (3,), a direction; where it is parallel to the line of sight another one is chosen
    view_angle : radians, full vertical field of view
    resolution : width and height in pixels
    origin : (3,), the model's origin in the file's space
    bounds : centre (3,), model space, and radius of a sphere that holds the model; sets the clip planes
    Raises ValueError where the eye is at the focal point, a number is not finite or an angle out of range.
    """
    origin = np.asarray(origin, np.float64)
    eye = np.asarray(position, np.float64) - origin
    back = eye - (np.asarray(focal_point, np.float64) - origin)
    up = np.asarray(view_up, np.float64)
    if not (np.isfinite(eye).all() and np.isfinite(back).all() and np.isfinite(up).all()):
        raise ValueError("the camera's position, focal point and view-up must be finite")
    length = float(np.linalg.norm(back))
    if not length > 0.0:
        raise ValueError("the camera's position and focal point are the same point")
    if not 0.0 < view_angle < math.pi:
        raise ValueError("the view angle must lie between 0 and 180 degrees")
    width, height = resolution
    if width < 1 or height < 1:
        raise ValueError("the resolution must be at least 1 x 1")

    back = back / length
    right = np.cross(up, back)
    if np.linalg.norm(right) <= 1e-12 * max(1.0, float(np.linalg.norm(up))):
        # Looking along view-up: any direction across the line of sight will do.
        right = np.cross(np.eye(3)[np.argmin(np.abs(back))], back)
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(back, right), back])
    eye_from_model = np.eye(4)
    eye_from_model[:3, :3] = rotation
    eye_from_model[:3, 3] = -rotation @ eye

    near, far = clip_planes(eye_from_model, bounds)
    return View(eye_from_model, float(view_angle), int(width), int(height), near, far)


def clip_planes(eye_from_model: Float64Array, bounds: tuple[npt.ArrayLike, float]) -> tuple[float, float]:
    """Return near and far distances that hold a sphere (centre in model space, radius)."""
    centre, radius = np.asarray(bounds[0], np.float64), float(bounds[1])
    radius = radius if radius > 0.0 else 1.0
    depth = -float((eye_from_model[:3, :3] @ centre + eye_from_model[:3, 3])[2])
    # A margin of 5% keeps the nearest nodes, whose spheres reach beyond the model's, off the near plane.
    far = max(depth + 1.05 * radius, 1e-3 * radius)
    near = max(depth - 1.05 * radius, NEAR_OVER_FAR * far)
    # From so far away that the model's size is lost in the rounding of its distance, a slab around it must do.
    return min(near, (1.0 - 1e-6) * far), far


def screen_box(view: View, half_extents: Float64Array) -> tuple[int, int, int, int]:
    """Return left, top, right and bottom of the pixels that a box around the model space's origin can cover.

    half_extents : float64 (3,). A box that reaches the near plane covers the whole picture.
    """
    corners = half_extents * (np.indices((2, 2, 2)).reshape(3, 8).T * 2.0 - 1.0)
    eye = corners @ view.eye_from_model[:3, :3].T + view.eye_from_model[:3, 3]
    if (-eye[:, 2] <= view.near).any():
        return 0, 0, view.width, view.height
    size = np.array([view.width, view.height])
    pixels = 0.5 * size + eye[:, :2] * np.array([1.0, -1.0]) * (view.focal_pixels / -eye[:, 2:])
    low = np.clip(np.floor(pixels.min(axis=0)), 0, size).astype(int)
    high = np.clip(np.ceil(pixels.max(axis=0)), 0, size).astype(int)
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])
