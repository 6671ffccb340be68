"""Radii and tiles that follow from an error goal as the camera moves."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from app.option_values import TEXELS
from app.scene import Scene
from hierarchy.view import View

if TYPE_CHECKING:
    from hierarchy.goals import Detail, Promise

# While the camera moves the radii follow this often (seconds): the error bounds of a view take some 15 ms.
FOLLOW_INTERVAL = 0.25
# Other tiles are baked where they allow splats this much larger; smaller ones than the present would save nothing more.
WORTH_BAKING = 1.5

Goal = tuple[float, float]


class Follower:
    """Keeps the detail that an error goal needs. Times are seconds of the caller's clock.

    detail, promise : what is drawn with at rest and the bounds of its error, None: nothing has been followed
    texels : along one side of the tiles to draw with, 0: not chosen
    """

    def __init__(self) -> None:
        self.detail: Detail | None = None
        self.promise: Promise | None = None
        self.texels = 0
        self._goal: Goal | None = None
        self._followed: tuple[object, ...] = ()
        self._at_rest = False
        self._time = -math.inf

    @property
    def is_done(self) -> bool:
        """There is nothing to be made up for when the camera rests."""
        return self._goal is None or self._at_rest

    def follow(
        self,
        goal: Goal | None,
        scene: Scene,
        situation: tuple[object, ...],
        view: Callable[[], View],
        *,
        rests: bool,
        now: float,
    ) -> None:
        """Find the detail of a view anew if that is due.

        goal : degrees and pixels, None: forget what was followed
        situation : whatever the view depends on; equal means the same view
        rests : nothing has changed for a while; tiles may be chosen anew
        """
        followed = (scene, goal, *situation)
        if followed == self._followed and (self._at_rest or not rests):
            return
        self._at_rest = False
        if not rests and goal == self._goal and now - self._time < FOLLOW_INTERVAL:
            return
        if goal is None:
            self.detail, self.promise, self.texels = None, None, 0
        else:
            self._find(goal, scene, view(), rests)
        self._goal, self._followed, self._at_rest, self._time = goal, followed, rests, now

    def _find(self, goal: Goal, scene: Scene, view: View, rests: bool) -> None:
        from hierarchy.goals import ErrorGoal, detail_for_goal

        def find(*texels: int) -> tuple[Detail, Promise]:
            return detail_for_goal(scene.hierarchy, view, ErrorGoal(*goal), texels=texels)

        present = self.texels
        if rests or not present:
            # Stay with the present tiles unless others are much better, or every other view would bake all anew.
            best = find(*TEXELS)[0]
            if not present or best.r_inner > WORTH_BAKING * find(present)[0].r_inner:
                present = best.texels
        self.texels = present
        self.detail, self.promise = find(present)
