"""Promises are kept: what a cut promises bounds what its picture is wrong by, measured by ray casting."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from benchmarks.error import measure
from benchmarks.reference import cast
from hierarchy.build import build_hierarchy
from hierarchy.goals import ErrorGoal, detail_for_goal, promise_of_cut
from hierarchy.lod import Cut
from hierarchy.meteoroid import make_meteoroid
from hierarchy.view import look_at
from renderer.frame import Frame

pytest.importorskip("embreex", reason="embreex casts the rays to compare with")

Draw = Callable[..., tuple[Frame, Cut]]


@pytest.mark.parametrize("distance", [1.6, 3.0, 9.0, 25.0], ids=["near", "whole", "far", "tiny"])
def test_pictures_keep_what_was_promised(draw: Draw, distance: float) -> None:
    mesh = make_meteoroid(60_000)
    hierarchy = build_hierarchy(mesh)
    centre, radius = hierarchy.bounds
    eye = centre + distance * radius * np.array([-0.48, 0.36, 0.8])
    view = look_at(eye, centre, (0, 1, 0), math.radians(45), (480, 480), bounds=hierarchy.bounds)
    reference = cast(mesh, view)
    for texels in (2, 4, 16, 32):
        for radii in ((1.0, 1.0), (1.0, 3.0), (1.0, 6.0), (2.0, 16.0), (5.0, 40.0)):
            frame, cut = draw(view, hierarchy, texels, None, *radii)
            promise = promise_of_cut(hierarchy, view, cut, texels)
            error = measure(frame.normal, frame.depth, frame.coverage, reference)
            assert error.normal_degrees.mean <= promise.degrees
            # A promise that holds for anything is worth nothing.
            assert promise.degrees < 8.0 * error.normal_degrees.mean + 0.5
            if error.silhouette.mean is not None:
                assert error.silhouette.mean <= promise.pixels
                assert promise.pixels < 5.0 * error.silhouette.mean + 0.1


def test_a_goal_is_kept(draw: Draw) -> None:
    mesh = make_meteoroid(60_000)
    hierarchy = build_hierarchy(mesh)
    centre, radius = hierarchy.bounds
    eye = centre + np.array([0, 0, 3 * radius])
    view = look_at(eye, centre, (0, 1, 0), math.radians(45), (480, 480), bounds=hierarchy.bounds)
    reference = cast(mesh, view)
    for goal in (ErrorGoal(1.5, 0.5), ErrorGoal(4.0, 1.0)):
        detail, promise = detail_for_goal(hierarchy, view, goal, texels=(4, 8, 16))
        frame, _ = draw(view, hierarchy, detail.texels, None, detail.r_sil, detail.r_inner)
        error = measure(frame.normal, frame.depth, frame.coverage, reference)
        assert error.normal_degrees.mean <= promise.degrees <= goal.degrees
        assert error.silhouette.mean is not None
        assert error.silhouette.mean <= promise.pixels <= goal.pixels
