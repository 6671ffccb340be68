"""What the next frame is drawn with: the sliders' radii or what an error goal asks for, coarsened while it moves."""

from __future__ import annotations

import math
from collections.abc import Callable

from app.budget import Budget, coarsened
from app.follower import Follower
from app.orbit_camera import OrbitCamera
from app.scene import Scene
from app.state import FrameReport, Steered, ViewerState
from hierarchy.view import View

# A camera, a model and goals that have been the same for so long (seconds) rest.
REST = 0.15

Size = tuple[int, int]


class Steering:
    """Turns what the user allows into the radii of the next frame. Times are seconds of the caller's clock.

    r_sil, r_inner : pixels, of the next frame
    texels : along one side of the tiles to draw with, 0: none
    blends : splats that overlap are blended. While a mesh with tiles moves the nearest one shows, which takes one pass
        instead of two: their tiles differ by half a degree, which nobody sees before the next frame
    """

    def __init__(self) -> None:
        self.r_sil = self.r_inner = 0.0
        self.texels = 0
        self.blends = True
        self._budget = Budget()
        self._follower = Follower()
        self._situation: tuple[Scene | None, OrbitCamera | None, object] = (None, None, None)
        self._changed = -math.inf
        # Texels of the tiles that all splats of the last frame had, 0: not all had any.
        self._tiled = 0
        self._has_tiles = False
        # The camera has moved, and has not stood still for a while since.
        self._moves = False
        # What the last frame was drawn of.
        self._drawn: tuple[object, ...] = ()

    @property
    def next_change(self) -> float | None:
        """When `update` has to be called even if nothing happens; None: never."""
        done = self._budget.coarseness == 1.0 and self._follower.is_done and self.blends
        return None if self._budget.rests or done else self._changed + REST

    def update(
        self, state: ViewerState, scene: Scene, camera: OrbitCamera, size: Size, view: Callable[[], View], now: float
    ) -> None:
        """Decide what is drawn next, and show it in the state.

        size : width and height of the picture in pixels
        view : makes the camera's view of the scene
        """
        goal = (state.max_degrees, state.max_pixels) if state.limit_error else None
        situation = (scene, camera, (size, goal))
        moved = self._situation[1] is not None and self._situation[1] is not camera
        if situation != self._situation:
            self._situation, self._changed = situation, now
        rests = now - self._changed >= REST
        self._follower.follow(goal, scene, (camera, size), view, rests=rests, now=now)
        self._budget.controller.set_goal(1e3 / state.frames_per_second if state.hold_rate else None)
        self._budget.update(moved=moved, rests=rests)
        # Without a tile a splat has one normal: blending is all that makes a surface of it. And an error that is
        # promised of what moves, too, is that of blended splats.
        smooth = scene.is_mesh and state.settings.normal_mapping and self._has_tiles
        self._moves = moved or (self._moves and not rests)
        self.blends = not self._moves or not smooth or (state.limit_error and not state.hold_rate)
        self._publish(state)

    def drawn(self, state: ViewerState, report: FrameReport, now: float) -> None:
        """Take in that a frame has been drawn with the radii, and what it took."""
        self._tiled, self._has_tiles = 0 if report.missing else report.texels, report.texels > 0
        scene, camera, size = self._situation
        drawn = (camera, scene, size, state.settings, state.printed_cone_test)
        moved = not self._drawn or camera is not self._drawn[0]
        measured = bool(self._drawn) and moved and drawn[1:] == self._drawn[1:]
        self._drawn = drawn
        self._budget.drawn(report.total, measured=measured)
        if not self._budget.rests and moved:
            # What moves cannot come to rest before it has been seen.
            self._changed = now
        self._publish(state)

    def _publish(self, state: ViewerState) -> None:
        detail, promise = self._follower.detail, self._follower.promise
        r_sil, r_inner = (detail.r_sil, detail.r_inner) if detail else (state.r_sil, state.r_inner)
        self.texels = self._follower.texels if detail else state.texels
        self.r_sil = coarsened(r_sil, self._budget.coarseness)
        self.r_inner = coarsened(r_inner, self._budget.coarseness)
        # What is promised counts on the tiles.
        holds = promise is not None and state.settings.normal_mapping and self._tiled == self.texels
        bounds = (promise.degrees, promise.pixels) if promise is not None and holds else None
        state.steered = Steered(r_sil, r_inner, self.texels, bounds, self._budget.controller.coarseness)
