"""Where the camera stands when the user does not say, or says only a part of it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from app.options import CameraOptions
from app.orbit_camera import axes_of_up, fitting_distance
from app.scene import Scene
from hierarchy.model import Float64Array, in_file_space
from hierarchy.view import View, look_at

# Three quarters from the front and slightly from above, as one holds a thing in the hand: azimuth, elevation.
THREE_QUARTERS = (math.radians(35.0), math.radians(20.0))


@dataclass(frozen=True, eq=False)
class Pose:
    """A camera: float64 (3,) position and focal point in the file's own space, view-up, view angle in radians.

    orthographic : the view rays are parallel, and what is at the focal point is as large as in perspective
    """

    position: Float64Array
    focal_point: Float64Array
    view_up: Float64Array
    view_angle: float
    orthographic: bool = False


def frame_scene(scene: Scene, camera: CameraOptions, resolution: tuple[int, int]) -> Pose:
    """Choose what the camera options leave open so that the whole model is seen.

    Scans of things are seen along their z axis, as scanners leave them; the built-in model and the ground, whose z is
    up, from three quarters.
    """
    hierarchy = scene.hierarchy
    centre, radius = hierarchy.bounds
    view_angle = math.radians(camera.view_angle)
    default_up = (0.0, 0.0, 1.0) if scene.source.z_up else (0.0, 1.0, 0.0)
    view_up = np.asarray(camera.view_up or default_up, np.float64)
    focal_point = np.asarray(camera.focal_point, np.float64) if camera.focal_point else in_file_space(hierarchy, centre)
    if camera.position is not None:
        position = np.asarray(camera.position, np.float64)
    else:
        from_front = scene.source.path is not None and not scene.source.z_up
        azimuth, elevation = (0.0, 0.0) if from_front else THREE_QUARTERS
        flat = math.cos(elevation)
        weights = np.array([flat * math.sin(azimuth), math.sin(elevation), flat * math.cos(azimuth)])
        aspect = resolution[0] / resolution[1]
        size = hierarchy.scale * radius
        distance = fitting_distance(size, view_angle, aspect, orthographic=camera.orthographic)
        position = focal_point + distance * (weights @ axes_of_up(default_up))
    return Pose(position, focal_point, view_up, view_angle, camera.orthographic)


def view_of_pose(pose: Pose, scene: Scene, resolution: tuple[int, int]) -> View:
    """Return the view of a pose; raises ValueError where the pose is none."""
    distance = float(np.linalg.norm(pose.position - pose.focal_point))
    return look_at(
        pose.position,
        pose.focal_point,
        pose.view_up,
        pose.view_angle,
        resolution,
        origin=scene.hierarchy.origin,
        scale=scene.hierarchy.scale,
        bounds=scene.hierarchy.bounds,
        parallel_scale=distance * math.tan(0.5 * pose.view_angle) if pose.orthographic else None,
    )
