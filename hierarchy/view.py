"""A camera, perspective or parallel: where the eye is, what it sees, and how long a length is in pixels there."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from hierarchy.model import Float64Array

# The near plane stands at least this fraction of the far distance before the eye: a 24-bit depth buffer then
# still resolves far / 2000 at the far end.
NEAR_OVER_FAR = 1e-4

# A parallel view's eye stands this many radii of the model from its centre, and what lies within 1.5 radii of that
# depth is between the clip planes: also discs and spheres that reach beyond the model.
PARALLEL_DEPTH, PARALLEL_REACH = 2.0, 1.5

# What is drawn with float32: an eye at most so many radii away from the model; so much or little of it, over its
# radius, or over the distance in perspective, as half the height of the picture.
FARTHEST = 1e30
SMALLEST, LARGEST = 1e-9, 1e9


@dataclass(frozen=True, eq=False)
class View:
    """A view of model space; eye space is right-handed and looks down -z.

    eye_from_model : float64 (4, 4), rigid (rotation and translation only)
    view_angle : full vertical field of view in radians, in (0, pi); a parallel view makes no use of it
    width, height : resolution in pixels
    near, far : positive distances of the clip planes along the view axis
    parallel_scale : half the height of what is seen, in model space, if all view rays are parallel; None: they meet in
        the eye, which makes the view a perspective one
    depth_of_eye : depth of the eye as seen from the camera's position, 0 in perspective. What a parallel view shows
        does not depend on where on the axis its eye stands, so it is brought to where float32 resolves the model
    """

    eye_from_model: Float64Array
    view_angle: float
    width: int
    height: int
    near: float
    far: float
    parallel_scale: float | None = None
    depth_of_eye: float = 0.0

    @property
    def is_parallel(self) -> bool:
        """All view rays have the direction of the axis."""
        return self.parallel_scale is not None

    @cached_property
    def eye(self) -> Float64Array:
        """Position of the eye in model space, float64 (3,)."""
        rotation, translation = self.eye_from_model[:3, :3], self.eye_from_model[:3, 3]
        return -rotation.T @ translation

    @property
    def homogeneous_eye(self) -> Float64Array:
        """(eye, 1), or (direction to the viewer, 0) where the rays are parallel, float64 (4,).

        It lies before the plane of a point p and a normal n where n.(e - w p) > 0, (e, w) being its parts.
        """
        return np.append(self.eye_from_model[2, :3], 0.0) if self.is_parallel else np.append(self.eye, 1.0)

    @property
    def half_height(self) -> float:
        """Half the height of what is seen: at unit depth, or at any where the rays are parallel."""
        return math.tan(0.5 * self.view_angle) if self.parallel_scale is None else self.parallel_scale

    @property
    def focal_pixels(self) -> float:
        """Pixels that a unit length perpendicular to the axis covers at unit depth (Holst 2007, eq. 6).

        Where the rays are parallel it covers as many at any depth.
        """
        return self.height / (2.0 * self.half_height)

    def pixels_of_unit(self, depth: npt.ArrayLike) -> Float64Array:
        """Return the pixels that a unit length perpendicular to the axis covers at depths > 0, float64 of any shape."""
        depth = np.asarray(depth, np.float64)
        return np.full(depth.shape, self.focal_pixels) if self.is_parallel else self.focal_pixels / depth

    def depth_of_ndc(self, z: float) -> float:
        """Return the depth, seen from the eye, of a z of normalised device coordinates, -1 to 1."""
        if self.is_parallel:
            return 0.5 * (self.near + self.far + z * (self.far - self.near))
        return 2.0 * self.far * self.near / (self.far + self.near - z * (self.far - self.near))

    @property
    def clip_from_eye(self) -> Float64Array:
        """The projection of OpenGL, float64 (4, 4)."""
        f = 1.0 / self.half_height
        depth = self.near - self.far
        matrix = np.zeros((4, 4))
        if self.is_parallel:
            np.fill_diagonal(matrix, (f * self.height / self.width, f, 2.0 / depth, 1.0))
            matrix[2, 3] = (self.far + self.near) / depth
            return matrix
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
    scale: float = 1.0,
    bounds: tuple[npt.ArrayLike, float],
    parallel_scale: float | None = None,
) -> View:
    """Make the view of an eye at `position` that looks at `focal_point`.

    position, focal_point : (3,), in the file's own space
    view_up : (3,), a direction; where it is parallel to the line of sight another one is chosen
    view_angle : radians, full vertical field of view
    resolution : width and height in pixels
    origin, scale : (3,) and > 0, the model's
    bounds : centre (3,), model space, and radius of a sphere that holds the model; sets the clip planes
    parallel_scale : half the height of what is seen, in the file's own space, for parallel view rays; None: they meet
        in the eye. Clip planes of a parallel view hold the whole model, on both sides of the position
    Raises ValueError where the eye is at the focal point, a number is not finite or an angle out of range, and where
    the camera is so far away, or what it sees so small or large, that it cannot be drawn.
    """
    origin, focus = np.asarray(origin, np.float64), np.asarray(focal_point, np.float64)
    with np.errstate(over="ignore"):
        eye = (np.asarray(position, np.float64) - origin) / scale
        back = eye - (focus - origin) / scale
    up, radius = np.asarray(view_up, np.float64), _radius(bounds)
    if not (np.isfinite(eye).all() and np.isfinite(back).all() and np.isfinite(up).all()):
        raise ValueError("the camera's position, focal point and view-up must be finite")
    if not back.any():
        raise ValueError("the camera's position and focal point are the same point")
    if np.abs(eye).max() > FARTHEST * radius:
        raise ValueError("the camera is too far away from the model to draw it")
    if not 0.0 < view_angle < math.pi:
        raise ValueError("the view angle must lie between 0 and 180 degrees")
    if parallel_scale is not None and not 0.0 < parallel_scale / scale < math.inf:
        raise ValueError("the parallel scale must be a finite length greater than 0")
    seen = math.tan(0.5 * view_angle) if parallel_scale is None else parallel_scale / scale / radius
    if not SMALLEST <= seen <= LARGEST:
        raise ValueError("what the camera sees is too small or too large to draw")
    if min(resolution) < 1:
        raise ValueError("the resolution must be at least 1 x 1")

    eye_from_model = np.eye(4)
    eye_from_model[:3, :3] = rotation = _rotation(back, up)
    eye_from_model[:3, 3] = -rotation @ eye
    size = int(resolution[0]), int(resolution[1])
    if parallel_scale is not None:
        return _parallel_view(eye_from_model, view_angle, size, bounds, float(parallel_scale) / scale)
    return View(eye_from_model, float(view_angle), *size, *clip_planes(eye_from_model, bounds))


def _rotation(back: Float64Array, up: Float64Array) -> Float64Array:
    """Return the axes right, up and back of eye space, float64 (3, 3), from directions of any length."""
    back, up = _of_usual_size(back), _of_usual_size(up)
    back = back / np.linalg.norm(back)
    right = np.cross(up, back)
    if np.linalg.norm(right) <= 1e-12:
        # Looking along view-up: any direction across the line of sight will do.
        right = np.cross(np.eye(3)[np.argmin(np.abs(back))], back)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(back, right), back])


def _of_usual_size(vector: Float64Array) -> Float64Array:
    """Return a vector times the power of two that makes it about 1 long: its squares neither overflow nor vanish."""
    with np.errstate(under="ignore"):
        scaled: Float64Array = np.ldexp(vector, -math.frexp(float(np.abs(vector).max()))[1])
    return scaled


def _parallel_view(
    eye_from_model: Float64Array,
    view_angle: float,
    resolution: tuple[int, int],
    bounds: tuple[npt.ArrayLike, float],
    parallel_scale: float,
) -> View:
    """Move the eye along the axis to before the whole model."""
    radius, depth = _radius(bounds), _depth_of_centre(eye_from_model, bounds)
    moved = eye_from_model.copy()
    # Not by a difference to where it was: that may be so far away that the model's size is lost in its rounding.
    moved[2, 3] = -PARALLEL_DEPTH * radius - float(moved[2, :3] @ np.asarray(bounds[0], np.float64))
    return View(
        moved,
        float(view_angle),
        *resolution,
        near=(PARALLEL_DEPTH - PARALLEL_REACH) * radius,
        far=(PARALLEL_DEPTH + PARALLEL_REACH) * radius,
        parallel_scale=parallel_scale,
        depth_of_eye=depth - PARALLEL_DEPTH * radius,
    )


def _radius(bounds: tuple[npt.ArrayLike, float]) -> float:
    return float(bounds[1]) if bounds[1] > 0.0 else 1.0


def _depth_of_centre(eye_from_model: Float64Array, bounds: tuple[npt.ArrayLike, float]) -> float:
    centre = np.asarray(bounds[0], np.float64)
    return -float((eye_from_model[:3, :3] @ centre + eye_from_model[:3, 3])[2])


def clip_planes(eye_from_model: Float64Array, bounds: tuple[npt.ArrayLike, float]) -> tuple[float, float]:
    """Return near and far distances that hold a sphere (centre in model space, radius)."""
    radius, depth = _radius(bounds), _depth_of_centre(eye_from_model, bounds)
    # A margin of 5% keeps the nearest nodes, whose spheres reach beyond the model's, off the near plane.
    far = max(depth + 1.05 * radius, 1e-3 * radius)
    near = max(depth - 1.05 * radius, NEAR_OVER_FAR * far)
    # From so far away that the model's size is lost in the rounding of its distance, a slab around it must do.
    return min(near, (1.0 - 1e-6) * far), far
