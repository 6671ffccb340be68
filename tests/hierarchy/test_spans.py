"""What a cut can reach on screen: all of what is drawn of it, and not much more."""

import dataclasses
import math

import numpy as np
import pytest

from hierarchy.build import build_hierarchy
from hierarchy.drawn_rows import records_of
from hierarchy.lod import Cut, select_cut
from hierarchy.meteoroid import make_meteoroid
from hierarchy.spans import STRIP, reached_spans
from hierarchy.view import look_at

SIZE = (330, 250)


def spans_of(hierarchy, cut, view, margin):
    records = records_of(hierarchy, cut.splats)
    return reached_spans(records, hierarchy.leaves, cut.indices, view, margin)


@pytest.fixture(scope="module")
def rock():
    return build_hierarchy(make_meteoroid(3_000))


def view_of(hierarchy, eye, parallel_scale=None):
    return look_at(
        eye, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), math.radians(45.0), SIZE,
        origin=(0.0, 0.0, 0.0), bounds=hierarchy.bounds, parallel_scale=parallel_scale,
    )  # fmt: skip


def on_screen(view, points):
    """Return columns from the left and rows from the bottom, and the depths, of points (N, 3)."""
    eye = points @ view.eye_from_model[:3, :3].T + view.eye_from_model[:3, 3]
    pixels = 0.5 * np.array(SIZE) + eye[:, :2] * view.pixels_of_unit(-eye[:, 2])[:, None]
    return pixels, -eye[:, 2]


def rims(hierarchy, cut, rng):
    """Return points of the discs that a cut draws, float64 (N, 3)."""
    splats = hierarchy.splats[cut.splats]
    directions = rng.normal(size=(len(splats), 16, 3))
    normals = splats["normal"].astype(np.float64)[:, None]
    directions -= (directions * normals).sum(axis=-1, keepdims=True) * normals
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    heights = rng.uniform(-1.0, 1.0, (len(splats), 16, 1)) * splats["thickness"][:, None, None]
    return (splats["centre"][:, None] + directions * splats["radius"][:, None, None] + heights * normals).reshape(-1, 3)


def outside(spans, pixels):
    """Return by how many pixels each point in the picture lies outside of the span of its strip."""
    shown = ((pixels >= 0.0) & (pixels < SIZE)).all(axis=1)
    at = pixels[shown]
    span = spans[(at[:, 1] // STRIP).astype(int)]
    return np.maximum(span[:, 0] - at[:, 0], at[:, 0] - span[:, 1])


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("parallel", [False, True])
@pytest.mark.parametrize("points", [False, True])
def test_spans_hold_what_is_drawn(rock, seed, parallel, points):
    rng = np.random.default_rng(seed)
    hierarchy = build_hierarchy(make_meteoroid(3_000), points=True) if points else rock
    direction = rng.normal(size=3)
    eye = direction / np.linalg.norm(direction) * rng.uniform(1.3, 6.0)
    view = view_of(hierarchy, eye, rng.uniform(0.3, 2.0) if parallel else None)
    cut = select_cut(hierarchy, view, rng.uniform(1.0, 4.0), rng.uniform(4.0, 40.0))
    spans = spans_of(hierarchy, cut, view, 0.01)
    corners = hierarchy.leaves.positions[cut.indices.ravel()].astype(np.float64)
    for part in (rims(hierarchy, cut, rng), corners):
        pixels, _ = on_screen(view, part)
        assert outside(spans, pixels).max(initial=-1.0) <= 0.0


def test_spans_are_not_much_wider_than_what_is_drawn(rock):
    view = view_of(rock, (0.0, 0.0, 3.0))
    cut = select_cut(rock, view, 1.0, 2.0)
    spans = spans_of(rock, cut, view, 0.0)
    pixels, _ = on_screen(view, rock.leaves.positions.astype(np.float64))
    rows = (pixels[:, 1] // STRIP).astype(int)
    # Where the outline is flat a strip's ends follow from what reaches in from the next strip.
    for strip in range(len(spans) // 3, 2 * len(spans) // 3):
        columns = pixels[rows == strip, 0]
        # The outermost corners may be of triangles that face away.
        assert -3.0 < columns.min() - spans[strip, 0] < 16.0
        assert -3.0 < spans[strip, 1] - columns.max() < 16.0
    assert (spans[: rows.min() - 1, 0] >= spans[: rows.min() - 1, 1]).all()


def test_the_margin_widens_spans(rock):
    view = view_of(rock, (0.0, 0.0, 3.0))
    cut = select_cut(rock, view, 2.0, 16.0)
    narrow, wide = spans_of(rock, cut, view, 0.0), spans_of(rock, cut, view, 3.0)
    middle = len(narrow) // 2
    assert np.allclose(wide[middle], narrow[middle] + [-3.0, 3.0], atol=1e-3)


def test_what_reaches_the_near_plane_may_be_anywhere(rock):
    view = view_of(rock, (0.0, 0.0, 3.0))
    view = dataclasses.replace(view, near=3.0)
    cut = select_cut(rock, view, 2.0, 16.0, two_sided=True)
    assert cut.triangle_count > 0
    assert (spans_of(rock, cut, view, 1.0) == [0.0, SIZE[0]]).all()


def test_nothing_reaches_nothing(rock):
    view = view_of(rock, (0.0, 0.0, 3.0))
    nothing = Cut(np.empty(0, np.uint32), np.empty((0, 3), np.uint32), 0, 0, 0)
    spans = spans_of(rock, nothing, view, 4.0)
    assert len(spans) == -(-SIZE[1] // STRIP)
    assert (spans[:, 0] >= spans[:, 1]).all()
