"""Where the camera stands when nobody says."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.framing import frame_scene, view_of_pose
from app.options import CameraOptions
from app.scene import ModelSource, open_scene

SIZE = (300, 200)


@pytest.fixture(scope="module")
def scene(torus):
    return open_scene(ModelSource(torus))


@pytest.fixture(scope="module")
def far_scene(far_torus):
    return open_scene(ModelSource(far_torus))


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("size", [(300, 200), (100, 400)])
def test_whole_model_is_in_the_picture(scene, size, orthographic):
    view = view_of_pose(frame_scene(scene, CameraOptions(orthographic=orthographic), size), scene, size)
    points = scene.hierarchy.leaves.positions
    eye_points = points @ view.eye_from_model[:3, :3].T + view.eye_from_model[:3, 3]
    clip = np.column_stack([eye_points, np.ones(len(points))]) @ view.clip_from_eye.T
    across = np.abs(clip[:, :2] / clip[:, 3:]).max(axis=0)
    assert np.all(across <= 1.0)
    assert across.max() > 0.6
    assert np.all((-eye_points[:, 2] >= view.near) & (-eye_points[:, 2] <= view.far))


def test_scans_are_seen_along_z(scene):
    pose = frame_scene(scene, CameraOptions(), SIZE)
    assert np.allclose((pose.position - pose.focal_point)[:2], 0.0)
    assert pose.position[2] > pose.focal_point[2]
    assert np.allclose(pose.view_up, (0, 1, 0))


def test_built_in_model_is_seen_from_three_quarters(scene):
    pose = frame_scene(replace(scene, source=ModelSource()), CameraOptions(), SIZE)
    assert np.all(pose.position - pose.focal_point > 0.0)


@pytest.mark.parametrize("name", ["ground.las", "ground.LAZ", "ground.copc.laz"])
def test_laser_scans_stand_on_the_ground(scene, name):
    pose = frame_scene(replace(scene, source=ModelSource(Path(name))), CameraOptions(), SIZE)
    x, y, z = pose.position - pose.focal_point
    assert np.allclose(pose.view_up, (0, 0, 1))
    assert y < 0.0 < z
    assert x > 0.0


def test_what_is_given_is_kept(scene):
    given = CameraOptions((3.0, 2.0, 1.0), (0.1, 0.2, 0.3), (0.0, 0.0, 1.0), 30.0)
    pose = frame_scene(scene, given, SIZE)
    assert (*pose.position, *pose.focal_point, *pose.view_up) == (3.0, 2.0, 1.0, 0.1, 0.2, 0.3, 0.0, 0.0, 1.0)
    assert pose.view_angle == pytest.approx(math.radians(30.0))


def test_position_alone_looks_at_the_middle(far_scene):
    position = np.add(far_scene.hierarchy.origin, (0.0, 5.0, 5.0))
    pose = frame_scene(far_scene, CameraOptions(position=tuple(position)), SIZE)
    assert np.allclose(pose.focal_point, (4.0e6, 5.5e6, 100.0), atol=0.1)


def test_focal_point_alone_moves_the_eye_along(scene):
    middle = frame_scene(scene, CameraOptions(), SIZE)
    moved = frame_scene(scene, CameraOptions(focal_point=(1.0, 0.0, 0.0)), SIZE)
    assert np.allclose(moved.position - moved.focal_point, middle.position - middle.focal_point)
