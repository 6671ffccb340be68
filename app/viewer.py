"""The viewer without its window: which model is open, what is being worked on, where the camera stands."""

from __future__ import annotations

import queue
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from app.background import BackgroundTask
from app.cache import Cache
from app.commands import Command
from app.errors import GraphicsError, unforeseen
from app.framing import Pose, frame_scene, view_of_pose
from app.keeper import Keeper
from app.options import CameraOptions, Options
from app.orbit_camera import OrbitCamera, orbit_from_pose
from app.scene import ModelSource, Scene, open_scene
from app.state import FrameReport, ViewerState
from app.steering import Steering
from hierarchy.model import Cancelled, ModelError, Progress, in_file_space
from hierarchy.view import View, look_at
from renderer.settings import Settings

if TYPE_CHECKING:
    from hierarchy.tile_shelf import ShownTiles

QUARTER = 1.5707963267948966

# What the user waits for when the window closes (seconds): the next report of progress is seldom farther away.
LAST_MOMENT = 0.5

# Azimuth and elevation of the axes' views.
AXIS_VIEWS = {
    Command.FRONT: (0.0, 0.0),
    Command.BACK: (2.0 * QUARTER, 0.0),
    Command.RIGHT: (QUARTER, 0.0),
    Command.LEFT: (-QUARTER, 0.0),
    Command.TOP: (0.0, QUARTER),
    Command.BOTTOM: (0.0, -QUARTER),
}


_Shown = tuple[Scene | None, OrbitCamera | None, Settings]


class Viewer:
    """Opens models in the background and keeps the one that is shown.

    scene, camera : None until the first model has been built
    steering : has the radii of the next frame
    wake : called from the background, to have `poll` called soon
    upload : called with every new scene before it becomes the one that is shown; may raise GraphicsError
    cache : where models are looked for, and what they are kept in
    """

    def __init__(
        self,
        options: Options,
        wake: Callable[[], None],
        upload: Callable[[Scene], None],
        cache: Cache | None = None,
    ) -> None:
        self.state = _state_of_options(options)
        self.steering = Steering()
        self.scene: Scene | None = None
        self.camera: OrbitCamera | None = None
        self.task: BackgroundTask[Scene] | None = None
        self._wake = wake
        self._upload = upload
        self._points = options.points
        self._texture = options.texture
        # What the command line fixed of the camera holds for its own model, not for those opened later.
        self._camera_options = options.camera
        self._cache = cache
        self._keeper = None if cache is None else Keeper(cache)
        self._stand_ins: queue.SimpleQueue[Scene] = queue.SimpleQueue()
        self._stand_in_of: BackgroundTask[Scene] | None = None
        self._stand_in_camera: OrbitCamera | None = None
        # What was shown before the stand-in that is shown, and from where; None: no stand-in is shown.
        self._before: _Shown | None = None
        # What goes into the cache once it has been drawn: the first picture comes first.
        self._unkept: Scene | None = None
        self.open(ModelSource(options.model, options.texture, options.points))

    def open_path(self, path: Path) -> None:
        """Open a file that the user chose, with the options of the command line but for its camera."""
        self.open(ModelSource(path, None, self._points))

    def open(self, source: ModelSource) -> None:
        """Load and build another model in the background; the one that is open stays until then."""
        running = self.task
        if running is not None:
            running.cancel()

        stand_ins: queue.SimpleQueue[Scene] = queue.SimpleQueue()

        def work(progress: Progress) -> Scene:
            return _open_ready_to_select(source, progress, self._cache, stand_ins.put)

        self.task = BackgroundTask(work, self._wake, after=running)
        self._stand_ins = stand_ins

    def poll(self, resolution: tuple[int, int]) -> None:
        """Take over what the background has finished, and decide what is drawn next."""
        task = self.task
        if task is not None and task.finished:
            self.task = None
            self._take(task, resolution)
        elif task is not None and not task.cancelled and not self._stand_ins.empty():
            self._show_stand_in(task, self._stand_ins.get(), resolution)
        if self.scene is not None and self.camera is not None:
            now = time.monotonic()
            self.steering.update(self.state, self.scene, self.camera, resolution, lambda: self.view(resolution), now)

    def drawn(self, report: FrameReport) -> None:
        """Take in what the last frame took."""
        self.state.history.append(report)
        self.steering.drawn(self.state, report, time.monotonic())
        if self._unkept is not None and self._keeper is not None:
            self._keeper.keep(self._unkept)
        self._unkept = None

    def keep_tiles(self, shown: ShownTiles) -> None:
        """Put the tiles of the last picture into the cache."""
        if self.scene is not None and self._keeper is not None:
            self._keeper.keep_tiles(self.scene, shown)

    def cancel(self) -> bool:
        """Stop the work in the background; False: there is none."""
        if self.task is None:
            return False
        self.task.cancel()
        return True

    def close(self) -> bool:
        """Stop the work and give it a moment to end; False: it still runs."""
        if self.task is not None:
            self.task.cancel()
            self.task.wait(LAST_MOMENT)
        if self._keeper is not None:
            self._keeper.close()
        return self.task is None or self.task.finished

    def fit(self, resolution: tuple[int, int]) -> None:
        """Show the whole model from the same direction."""
        if self.camera is not None and self.scene is not None:
            hierarchy = self.scene.hierarchy
            centre, radius = hierarchy.bounds
            aspect = resolution[0] / resolution[1]
            self.camera = self.camera.fit(in_file_space(hierarchy, centre), hierarchy.scale * radius, aspect)

    def look_along_axis(self, command: Command) -> None:
        """Look at the pivot along one of the axes."""
        if self.camera is not None:
            self.camera = self.camera.look_from(*AXIS_VIEWS[command])

    def flip_projection(self) -> None:
        """Change between perspective and parallel view rays; what is as deep as the pivot keeps its size."""
        self.state.orthographic = not self.state.orthographic
        if self.camera is not None:
            self.camera = replace(self.camera, orthographic=self.state.orthographic)

    def view(self, resolution: tuple[int, int]) -> View:
        """Return what the camera sees of the scene; both have to be there."""
        assert self.scene is not None
        assert self.camera is not None
        camera, hierarchy = self.camera, self.scene.hierarchy
        return look_at(
            camera.position,
            camera.pivot,
            camera.view_up,
            camera.view_angle,
            resolution,
            origin=hierarchy.origin,
            scale=hierarchy.scale,
            bounds=hierarchy.bounds,
            parallel_scale=camera.parallel_scale,
        )

    def _take(self, task: BackgroundTask[Scene], resolution: tuple[int, int]) -> None:
        # Who has looked around at the stand-in goes on from there.
        framed = self._stand_in_of is task and self.camera is not self._stand_in_camera
        self._stand_in_of = None
        before, self._before = self._before, None
        try:
            scene = task.result()
            self._upload(scene)
        except Cancelled:
            self.state.say("Cancelled")
        except (ModelError, GraphicsError) as error:
            self.state.say(str(error), is_error=True)
        except MemoryError:
            self.state.say("There is not enough memory for this", is_error=True)
        except BaseException as error:
            # The window has to outlive whatever a reader of files stumbles over; one in Rust panics with an exception
            # that is none to Python. Neither an interrupt nor the window's end come this way.
            self.state.say(unforeseen(error), is_error=True)
        else:
            self.state.dismiss_error()
            self._show(scene, resolution, framed=framed)
            for warning in scene.hierarchy.warnings:
                self.state.say(warning)
            self._unkept = scene
            return
        if before is not None:
            self._bring_back(before, resolution)

    def _show(self, scene: Scene, resolution: tuple[int, int], *, framed: bool) -> None:
        """Make a scene that has been uploaded the one that is shown; framed: the camera looks at it already."""
        self.state.history.clear()
        self.steering = Steering()
        if framed:
            self._camera_options = CameraOptions()
        else:
            self._frame(scene, resolution)
        # The inside of an open surface shows; a closed one's does not.
        self.state.settings = replace(self.state.settings, two_sided=not scene.content.closed)
        self.scene = scene

    def _show_stand_in(self, task: BackgroundTask[Scene], stand_in: Scene, resolution: tuple[int, int]) -> None:
        """Show a coarse stand-in for what a task opens, and remember what was shown before."""
        shown = (self.scene, self.camera, self.state.settings)
        try:
            self._upload(stand_in)
        except Exception:
            # Then there will be a message about the model itself.
            return
        self._stand_in_of = task
        # Another stand-in is nothing to come back to.
        self._before = self._before or shown
        # The command line's camera is for the model itself.
        options = self._camera_options
        self._show(stand_in, resolution, framed=False)
        self._camera_options, self._stand_in_camera = options, self.camera

    def _bring_back(self, before: _Shown, resolution: tuple[int, int]) -> None:
        """Show what was shown before a stand-in whose model could not be opened; nothing, if nothing was."""
        scene, camera, settings = before
        self.scene, self.camera = None, None
        if scene is not None:
            try:
                self._upload(scene)
            except Exception as error:
                self.state.say(str(error) if isinstance(error, GraphicsError) else unforeseen(error), is_error=True)
                return
            self._show(scene, resolution, framed=True)
            self.camera, self.state.settings = camera, settings

    def _frame(self, scene: Scene, resolution: tuple[int, int]) -> None:
        options, self._camera_options = self._camera_options, CameraOptions()
        # The projection stays what the user chose last.
        orthographic = self.state.orthographic
        pose = frame_scene(scene, replace(options, orthographic=orthographic), resolution)
        try:
            self.camera = _camera_of_pose(pose)
            view_of_pose(pose, scene, resolution)
        except ValueError as error:
            # No error of the work in the background, whose success would take it back.
            self.state.say(str(error))
            self.camera = _camera_of_pose(frame_scene(scene, CameraOptions(orthographic=orthographic), resolution))
        x, y, z = (float(value) for value in self.camera.axes[1])
        self.state.settings = replace(self.state.settings, ground_up=(x, y, z))


def _camera_of_pose(pose: Pose) -> OrbitCamera:
    """Return the camera of a pose; raises ValueError where the pose is none."""
    return orbit_from_pose(
        pose.position, pose.focal_point, pose.view_up, pose.view_angle, orthographic=pose.orthographic
    )


def _state_of_options(options: Options) -> ViewerState:
    """Return the state that a command line asks for."""
    settings = Settings(normal_mapping=options.normal_mapping, splat=options.splat)
    state = ViewerState(options.r_sil, options.r_inner, options.texels, settings)
    state.printed_cone_test = options.printed_cone_test
    state.orthographic = options.camera.orthographic
    if options.max_error is not None:
        state.limit_error = True
        state.max_degrees, state.max_pixels = options.max_error
    if options.fps is not None:
        state.hold_rate, state.frames_per_second = True, options.fps
    return state


def _open_ready_to_select(
    source: ModelSource, progress: Progress, cache: Cache | None, show: Callable[[Scene], None]
) -> Scene:
    """Open a scene without tiles and choose a first cut, so that every kernel of a frame is compiled by then.

    Otherwise the window would wait for them, and for those that bake tiles besides: one thread compiles at a time.
    show : called with a coarse stand-in, ready as well, where there is one
    """
    from hierarchy.drawn_rows import records_of
    from hierarchy.lod import select_cut
    from hierarchy.spans import reached_spans
    from hierarchy.tile_sizes import texels_seen

    def ready(scene: Scene) -> Scene:
        progress("Preparing the selection", 1.0)
        resolution, hierarchy = (64, 64), scene.hierarchy
        view = view_of_pose(frame_scene(scene, CameraOptions(), resolution), scene, resolution)
        cut = select_cut(hierarchy, view, 2.0, 16.0, two_sided=False)
        reached_spans(records_of(hierarchy, cut.splats), hierarchy.leaves, cut.indices, view, 0.0)
        texels_seen(hierarchy, view, cut.splats[:0], 1)
        return scene

    return ready(open_scene(source, progress, cache=cache, show=lambda stand_in: show(ready(stand_in))))
