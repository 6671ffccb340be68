"""The viewer without its window: models come and go in the background, and what is open survives what fails."""

import threading
import time

import numpy as np
import pytest

from app.commands import Command
from app.errors import GraphicsError
from app.options import CameraOptions, Options
from app.state import FrameReport
from app.viewer import Viewer
from hierarchy import spans, tile_sizes
from hierarchy.model import PointCloud, in_file_space

SIZE = (320, 240)


def wait(viewer: Viewer, until, seconds: float = 60.0) -> None:
    """Poll as the window does."""
    end = time.monotonic() + seconds
    while not until():
        assert time.monotonic() < end, "waited in vain"
        viewer.poll(SIZE)
        time.sleep(0.005)


def settle(viewer: Viewer) -> None:
    viewer.poll(SIZE)
    wait(viewer, lambda: viewer.task is None)


@pytest.fixture
def viewer(torus):
    viewer = Viewer(Options(model=torus, texels=4), lambda: None, lambda scene: None)
    yield viewer
    viewer.close()


def test_bad_file_leaves_the_open_model_there(viewer, tmp_path):
    settle(viewer)
    scene, camera = viewer.scene, viewer.camera
    bad = tmp_path / "empty.ply"
    bad.write_bytes(b"")
    viewer.open_path(bad)
    settle(viewer)
    assert viewer.scene is scene
    assert viewer.camera is camera
    (message,) = viewer.state.messages
    assert message.is_error
    assert "empty.ply" in message.text


def test_unforeseen_error_is_a_message(viewer, torus, monkeypatch):
    settle(viewer)
    scene = viewer.scene

    def break_down(*args, **kwargs):
        raise RuntimeError("surprise")

    monkeypatch.setattr("hierarchy.load.load_model", break_down)
    viewer.open_path(torus)
    settle(viewer)
    assert viewer.scene is scene
    assert "surprise" in viewer.state.messages[0].text


def test_cancelled_opening_leaves_the_open_model_there(viewer, far_torus):
    settle(viewer)
    scene = viewer.scene
    viewer.open_path(far_torus)
    assert viewer.cancel()
    settle(viewer)
    assert viewer.scene is scene
    assert not viewer.cancel()


def test_camera_of_the_command_line_holds_for_its_own_model_only(torus, far_torus):
    options = Options(model=torus, texels=2, camera=CameraOptions(position=(0.0, -7.0, 1.0), view_up=(0.0, 0.0, 1.0)))
    viewer = Viewer(options, lambda: None, lambda scene: None)
    settle(viewer)
    assert np.allclose(viewer.camera.position, (0.0, -7.0, 1.0))
    assert viewer.state.settings.ground_up == (0.0, 0.0, 1.0)
    viewer.open_path(far_torus)
    settle(viewer)
    assert np.allclose(viewer.camera.pivot, in_file_space(viewer.scene.hierarchy, viewer.scene.hierarchy.bounds[0]))
    viewer.close()


def test_axis_views_and_fit(viewer):
    settle(viewer)
    viewer.look_along_axis(Command.TOP)
    assert np.allclose(viewer.camera.back, (0.0, 1.0, 0.0))
    viewer.look_along_axis(Command.RIGHT)
    assert np.allclose(viewer.camera.back, (1.0, 0.0, 0.0))
    viewer.camera = viewer.camera.pan(500.0, 0.0, SIZE[1])
    viewer.fit(SIZE)
    assert np.allclose(viewer.camera.pivot, in_file_space(viewer.scene.hierarchy, viewer.scene.hierarchy.bounds[0]))


def test_flipped_projection_keeps_the_size_at_the_pivot_and_outlives_the_model(viewer, torus):
    settle(viewer)
    before = viewer.view(SIZE)
    viewer.flip_projection()
    after = viewer.view(SIZE)
    assert (before.is_parallel, after.is_parallel) == (False, True)
    distance = viewer.camera.distance / viewer.scene.hierarchy.scale
    assert after.focal_pixels == pytest.approx(before.focal_pixels / distance)
    viewer.open_path(torus)
    settle(viewer)
    assert viewer.camera.orthographic
    assert viewer.state.orthographic
    viewer.flip_projection()
    assert not viewer.view(SIZE).is_parallel


def test_a_camera_that_cannot_be_drawn_is_a_message(torus):
    options = Options(model=torus, texels=2, camera=CameraOptions(position=(0.0, 1e40, 0.0)))
    viewer = Viewer(options, lambda: None, lambda scene: None)
    settle(viewer)
    assert [message.text for message in viewer.state.messages] == [
        "the camera is too far away from the model to draw it"
    ]
    assert np.linalg.norm(viewer.camera.position) < 100.0
    viewer.close()


def test_command_line_sets_the_projection(torus):
    options = Options(model=torus, texels=2, camera=CameraOptions(orthographic=True))
    viewer = Viewer(options, lambda: None, lambda scene: None)
    settle(viewer)
    assert viewer.state.orthographic
    assert viewer.view(SIZE).is_parallel
    viewer.close()


def test_far_coordinates_reach_the_view(far_torus):
    viewer = Viewer(Options(model=far_torus, texels=2), lambda: None, lambda scene: None)
    settle(viewer)
    view = viewer.view(SIZE)
    centre, radius = viewer.scene.hierarchy.bounds
    # The view is in model space, where the numbers are small again.
    distance = viewer.scene.hierarchy.scale * np.linalg.norm(view.eye - centre)
    assert distance == pytest.approx(viewer.camera.distance, rel=1e-6)
    assert np.linalg.norm(view.eye) < 10.0 * radius
    viewer.close()


def test_model_that_does_not_fit_the_gpu_is_a_message(viewer, far_torus):
    settle(viewer)
    scene = viewer.scene

    def refuse(scene):
        raise GraphicsError("too large")

    viewer._upload = refuse
    viewer.open_path(far_torus)
    settle(viewer)
    assert viewer.scene is scene
    assert [message.text for message in viewer.state.messages] == ["too large"]


def test_command_line_sets_the_goals(torus):
    options = Options(model=torus, max_error=(0.7, 0.3), fps=25.0, splat="sprite", printed_cone_test=True)
    viewer = Viewer(options, lambda: None, lambda scene: None)
    state = viewer.state
    assert (state.limit_error, state.max_degrees, state.max_pixels) == (True, 0.7, 0.3)
    assert (state.hold_rate, state.frames_per_second) == (True, 25.0)
    assert (state.settings.splat, state.printed_cone_test) == ("sprite", True)
    viewer.close()


def test_error_goal_chooses_the_tiles(viewer):
    settle(viewer)
    viewer.state.limit_error, viewer.state.max_degrees = True, 0.3
    wait(viewer, lambda: viewer.steering.next_change is None)
    assert viewer.steering.texels == viewer.state.steered.texels > 0
    # The user's own choice waits until the goal is switched off.
    assert viewer.state.texels == 4
    viewer.state.limit_error = False
    viewer.poll(SIZE)
    assert viewer.steering.texels == 4


def test_frames_reach_history_and_budget(viewer):
    settle(viewer)
    viewer.state.hold_rate, viewer.state.frames_per_second = True, 50.0
    report = FrameReport(1, 2, 3, 4, (1.0, 1.0, 1.0, 1.0), 100.0)
    for _ in range(12):
        viewer.camera = viewer.camera.orbit(3.0, 0.0, SIZE[1])
        viewer.poll(SIZE)
        viewer.drawn(report)
    assert len(viewer.state.history) == 12
    viewer.camera = viewer.camera.orbit(3.0, 0.0, SIZE[1])
    viewer.poll(SIZE)
    assert viewer.steering.r_inner > 4.0 * viewer.state.r_inner


@pytest.fixture
def held_build(monkeypatch):
    """Models of any size have a stand-in, and what comes after it waits until the event is set."""
    from hierarchy import build

    go_on, whole = threading.Event(), build.build_hierarchy

    def build_hierarchy(model, **keywords):
        if not isinstance(model, PointCloud):
            assert go_on.wait(60.0)
        return whole(model, **keywords)

    monkeypatch.setattr("app.scene.WORTH_A_STAND_IN", 1)
    monkeypatch.setattr("hierarchy.build.build_hierarchy", build_hierarchy)
    yield go_on
    go_on.set()


def test_stand_in_is_shown_until_the_model_is_there(viewer, far_torus, held_build):
    held_build.set()
    settle(viewer)
    held_build.clear()
    viewer.open_path(far_torus)
    wait(viewer, lambda: viewer.scene.hierarchy.name == "far_torus.ply")
    assert viewer.scene.hierarchy.leaf_kind == "surfels"
    assert viewer.task is not None
    # Whoever looks around meanwhile is not sent back.
    viewer.camera = camera = viewer.camera.orbit(30.0, 10.0, SIZE[1])
    held_build.set()
    settle(viewer)
    assert viewer.scene.hierarchy.leaf_kind == "triangles"
    assert viewer.camera is camera
    assert viewer.state.messages == []


@pytest.mark.parametrize("cancelled", [True, False])
def test_model_that_fails_after_its_stand_in_brings_the_last_one_back(
    viewer, far_torus, held_build, monkeypatch, cancelled
):
    held_build.set()
    settle(viewer)
    scene, camera = viewer.scene, viewer.camera
    held_build.clear()
    viewer.open_path(far_torus)
    wait(viewer, lambda: viewer.scene is not scene)
    if cancelled:
        assert viewer.cancel()
    else:
        monkeypatch.setattr("hierarchy.build.leaf_order", lambda model: 1 / 0)
    held_build.set()
    settle(viewer)
    assert (viewer.scene, viewer.camera) == (scene, camera)
    assert len(viewer.state.messages) == 1


def test_other_model_opened_during_a_stand_in_gets_a_camera_of_its_own(viewer, torus, far_torus, held_build):
    held_build.set()
    settle(viewer)
    before = viewer.camera
    held_build.clear()
    viewer.open_path(far_torus)
    wait(viewer, lambda: viewer.scene.hierarchy.name == "far_torus.ply")
    far = viewer.camera
    viewer.open_path(torus)
    held_build.set()
    settle(viewer)
    assert viewer.scene.hierarchy.name == torus.name
    assert np.allclose(viewer.camera.position, before.position)
    assert not np.allclose(viewer.camera.position, far.position)


def test_opening_compiles_every_kernel_of_a_frame(viewer, monkeypatch):
    """The window waited 39 s for one: whoever bakes the first tiles compiles at the same time, behind one lock."""
    ready = []
    for module, name in ((spans, "_spans"), (tile_sizes, "_texels_seen")):
        kernel = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *a, name=name, kernel=kernel: ready.append(name) or kernel(*a))
    settle(viewer)
    assert viewer.scene is not None
    assert set(ready) == {"_spans", "_texels_seen"}
