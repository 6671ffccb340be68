"""What changes in a picture when the camera moves by a thousandth of a pixel, and above all where the cut changes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from small_models import terrain
from stage import Stage

from benchmarks.error import angle_degrees
from hierarchy.build import build_hierarchy
from hierarchy.goals import Promise, promise_of_cut
from hierarchy.hierarchy import Hierarchy
from hierarchy.lod import Cut, select_cut
from hierarchy.meteoroid import make_meteoroid
from hierarchy.normal_tiles import NormalTiles, bake_tiles
from hierarchy.view import View, look_at
from renderer.frame import Frame
from renderer.settings import Settings

SIZE = (256, 256)
RADII = (2.0, 16.0)
TEXELS = 16
# How far the camera moves, in pixels of what is in the middle of the picture.
STEP = 1e-3
# Where the cut stays, what changes with the step is the slope of the normals, and the pixels in which something passes
# the edge of a splat or the visible depth: both in proportion to it. Ten times its share of what a whole pixel changes.
SHARE_OF_PIXEL = 10.0 * STEP

Scene = tuple[Hierarchy, NormalTiles]


@pytest.fixture(scope="module")
def scenes() -> dict[str, Scene]:
    hierarchies = {
        "meteoroid": build_hierarchy(make_meteoroid(10_000)),
        "meteoroid of surfels": build_hierarchy(make_meteoroid(10_000), points=True),
        # A grid whose nodes are all alike: whole levels of it change at once.
        "terrain": build_hierarchy(terrain(64)),
    }
    return {name: (hierarchy, bake_tiles(hierarchy, TEXELS)) for name, hierarchy in hierarchies.items()}


def camera(hierarchy: Hierarchy, direction: np.ndarray, kind: str) -> Callable[[float], View]:
    """Return the views along a path; its parameter is in pixels of what is in the middle of the picture.

    kind : "dolly" towards the model, "pan" across it, "orthographic zoom"
    """
    centre, radius = hierarchy.bounds
    angle, back = 0.8, direction / np.linalg.norm(direction)
    distance = 2.6 * radius
    pixel = 2.0 * distance * math.tan(0.5 * angle) / SIZE[1]
    aside = np.cross(back, [0.3, 0.5, 0.8])
    aside /= np.linalg.norm(aside)

    def at(pixels: float) -> View:
        along, across = (0.0, pixels * pixel) if kind == "pan" else (pixels * pixel, 0.0)
        scale = (distance - along) * math.tan(0.5 * angle) if kind == "orthographic zoom" else None
        focus = centre + across * aside
        eye = focus + (distance - along) * back
        return look_at(eye, focus, (0.1, 1.0, 0.2), angle, SIZE, bounds=hierarchy.bounds, parallel_scale=scale)

    return at


def same(a: Cut, b: Cut) -> bool:
    """Tell whether two cuts draw the same, and take the same for silhouette."""
    return (
        (a.silhouette_splats, a.silhouette_triangles) == (b.silhouette_splats, b.silhouette_triangles)
        and np.array_equal(a.splats, b.splats)
        and np.array_equal(a.indices, b.indices)
    )


def threshold(hierarchy: Hierarchy, path: Callable[[float], View], low: float, high: float) -> tuple[float, float]:
    """Return two places on a path, no further apart than STEP, between which the cut changes."""
    first = select_cut(hierarchy, path(low), *RADII)
    assert not same(first, select_cut(hierarchy, path(high), *RADII))
    while high - low > STEP:
        middle = 0.5 * (low + high)
        if same(first, select_cut(hierarchy, path(middle), *RADII)):
            low = middle
        else:
            high = middle
    return low, high


def change(before: Frame, after: Frame) -> tuple[float, float]:
    """Return the mean change of the normals in degrees, and by how many pixels the outline has moved in the mean."""
    both = (before.coverage > 0.0) & (after.coverage > 0.0)
    degrees = angle_degrees(before.normal[both], after.normal[both])
    covered = before.coverage > 0.0
    outline = (covered[1:] != covered[:-1]).sum() + (covered[:, 1:] != covered[:, :-1]).sum()
    moved = ((before.coverage > 0.0) != (after.coverage > 0.0)).sum()
    return float(degrees.mean()), float(moved / max(outline, 1))


KINDS = ("dolly", "pan", "orthographic zoom")


def paths(scenes: dict[str, Scene], rng: np.random.Generator, count: int) -> Iterator[tuple[Scene, Callable]]:
    for i in range(count):
        scene = list(scenes.values())[i % len(scenes)]
        direction = rng.normal(size=3)
        # A grid seen straight on has all of a level at its threshold at once.
        if scene is scenes["terrain"]:
            direction = np.array([0.0, 0.0, 1.0]) + (i % 2) * 0.3 * direction
        yield scene, camera(scene[0], direction, KINDS[(i // len(scenes)) % len(KINDS)])


def draw(stage: Stage, scene: Scene, view: View) -> tuple[Frame, Cut, Promise]:
    frame, cut = stage.draw(*scene, view, Settings(two_sided=not scene[0].closed), RADII)
    return frame, cut, promise_of_cut(scene[0], view, cut, TEXELS)


def test_a_cut_that_changes_changes_the_picture_by_no_more_than_both_promise(ledger, amount, rng, stage, scenes):
    count, normals, outline = amount(3, 150), 0.0, 0.0
    for scene, path in paths(scenes, rng, count):
        start = rng.uniform(0, 40)
        low, high = threshold(scene[0], path, start, start + 40.0)
        before, _, first = draw(stage, scene, path(low))
        after, _, second = draw(stage, scene, path(high))
        degrees, moved = change(before, after)
        normals = max(normals, degrees / (first.degrees + second.degrees))
        outline = max(outline, moved / (first.pixels + second.pixels))
    tried = (
        "meteoroid of triangles and of surfels, a grid of nodes that are all alike; dolly, pan and orthographic zoom"
    )
    unit = "of what both cuts promise"
    ledger.record("scenes", "popping: normals", tried, cases=count, worst=normals, bound=1.0, unit=unit)
    ledger.record("scenes", "popping: outline", tried, cases=count, worst=outline, bound=1.0, unit=unit)


def test_a_cut_that_stays_changes_in_proportion_to_the_step(ledger, amount, rng, stage, scenes):
    count, worst, tried = amount(4, 150), 0.0, 0
    for scene, path in paths(scenes, rng, count):
        start = rng.uniform(0, 80)
        here, step, pixel = (draw(stage, scene, path(start + by)) for by in (0.0, STEP, 1.0))
        if same(here[1], step[1]):
            worst = max(worst, change(here[0], step[0])[0] / change(here[0], pixel[0])[0])
            tried += 1
    assert tried > 0
    what = "popping: normals, where the cut stays"
    unit = "of what a pixel changes"
    ledger.record("scenes", what, "the same", cases=tried, worst=worst, bound=SHARE_OF_PIXEL, unit=unit)
