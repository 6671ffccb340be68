"""Sums of many weights in one pixel: no overflow, no weight lost below the last bit, no side that cancels the other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import moderngl
import numpy as np
import pytest
from frame_in_numpy import angles
from glsl_harness import cut_of, hierarchy_of, splats_of
from ledger import Ledger
from scan_targets import scan_targets

from hierarchy.kernel import SHARPNESS
from hierarchy.leaves import Triangles
from hierarchy.view import View
from renderer.context import is_software
from renderer.frame import Frame
from renderer.renderer import Renderer
from renderer.settings import Settings
from renderer.splat_passes import FACING_AWAY

Amount = Callable[[int, int], int]

VIEW = View(np.eye(4), 1.0, 5, 5, 0.5, 8.0)
# Of a sum of N numbers in float32 no partial sum is off by more than half a unit in its last place: N / 2 of them.
SUM_ROUNDING = 2.0**-24


def draw(ctx: moderngl.Context, renderer: Renderer, splats: np.ndarray, order: np.ndarray | None = None) -> Frame:
    hierarchy = replace(hierarchy_of(splats), colors=np.tile(np.array([200, 90, 30, 255], np.uint8), (len(splats), 1)))
    renderer.set_hierarchy(hierarchy)
    cut = cut_of(hierarchy, silhouette=len(splats))
    if order is not None:
        cut = replace(cut, splats=cut.splats[order])
    framebuffer = ctx.simple_framebuffer((VIEW.width, VIEW.height))
    renderer.draw(cut, VIEW, Settings(), framebuffer)
    assert len(splats) > 100_000 or scan_targets(renderer) == []
    frame = renderer.read_arrays()
    ctx.detect_framebuffer(0).use()
    framebuffer.release()
    return frame


def bundle(rng: np.random.Generator, count: int, spread: float) -> np.ndarray:
    """Return SPLAT (count,) at depth 2 across the axis, their normals around one that leans away from it."""
    normals = np.array([0.31, -0.17, 0.93]) + spread * rng.normal(size=(count, 3))
    # Through the axis, so that the pixel in the middle sees the centre of each.
    return splats_of(np.tile([0.0, 0.0, -2.0], (count, 1)), normals, 0.8)


@pytest.mark.parametrize("spread", [0.0, 0.2], ids=["equal", "different"])
@pytest.mark.parametrize("count", [1, 10, 1_000, 100_000, 1_000_000])
def test_many_splats_in_one_pixel(
    ctx: moderngl.Context,
    renderer: Renderer,
    ledger: Ledger,
    amount: Amount,
    rng: np.random.Generator,
    count: int,
    spread: float,
) -> None:
    if count > amount(1_000, 1_000_000):
        pytest.skip("only with --stress")
    splats = bundle(rng, count, spread)
    normals = splats["normal"].astype(np.float64)
    expected = normals.sum(axis=0)
    share = np.linalg.norm(expected) / count
    worst, depth = 0.0, 0.0
    sorted_up = np.argsort(normals[:, 0])
    for order in (sorted_up, sorted_up[::-1], np.arange(count))[: 1 if count > 100_000 else 3]:
        frame = draw(ctx, renderer, splats, order)
        worst = max(worst, float(angles(frame.normal[2, 2], expected / np.linalg.norm(expected))))
        depth = max(depth, abs(float(frame.depth[2, 2]) - 2.0))
    tried = f"{'equal' if spread == 0.0 else 'different'} normals, sorted up and down and as they come"
    # The weights are 1 to a rounding of exp(0); each component is off by its sum's roundings, and the root of three.
    bound = np.degrees(np.sqrt(3.0) * (count / 2.0 + 8.0) * SUM_ROUNDING / share)
    ledger.record(
        "kernels", f"normal of {count:,} splats in a pixel", tried, cases=3, worst=worst, bound=bound, unit="degrees"
    )
    # Depth is interpolated between corners; GPUs move those to their grid of parts of a pixel before.
    grid = 0.0 if is_software(ctx) else 2.0 ** -ctx.info["GL_SUBPIXEL_BITS"]
    slopes = np.hypot(normals[:, 0], normals[:, 1]) / np.abs(normals[:, 2])
    assert depth < 2.0 * (count + 8.0) * SUM_ROUNDING * 2.0 + grid * slopes.mean() * 2.0 / VIEW.focal_pixels


def test_half_floats_would_have_bent_the_normal(ctx: moderngl.Context, renderer: Renderer, rng) -> None:  # type: ignore[no-untyped-def]
    # In half floats the sum of a thousand equal normals stays where a further one is half a unit of its last place.
    total, each = np.zeros(3, np.float16), bundle(rng, 1, 0.0)["normal"][0].astype(np.float16)
    for _ in range(1_000):
        total += each
    stuck = total.astype(np.float64) / np.linalg.norm(total.astype(np.float64))
    splats = bundle(rng, 1_000, 0.0)
    assert angles(stuck, splats["normal"][0]) > 0.5
    frame = draw(ctx, renderer, splats)
    assert angles(frame.normal[2, 2], splats["normal"][0]) < 0.01


@pytest.mark.parametrize("gap", [0.0, 1e-6, 1e-3, 0.02])
@pytest.mark.parametrize("order", ["front first", "back first"])
def test_two_sheets_back_to_back_show_the_one_in_front(
    ctx: moderngl.Context, renderer: Renderer, ledger: Ledger, gap: float, order: str
) -> None:
    # Closer than epsilon, which at a radius of 0.3 is 0.06: both are summed up.
    x, y = (part.ravel() for part in np.meshgrid(np.linspace(-1.2, 1.2, 13), np.linspace(-1.2, 1.2, 13)))
    front, back = (np.stack([x, y, np.full(x.shape, z)], axis=1) for z in (-2.0, -2.0 - gap))
    towards, away = np.tile([0.1, 0.2, 1.0], (len(x), 1)), np.tile([0.2, 0.1, -1.0], (len(x), 1))
    sheets = [(front, towards), (back, away)]
    if order == "back first":
        sheets.reverse()
    centres, normals = (np.concatenate(parts) for parts in zip(*sheets, strict=True))
    frame = draw(ctx, renderer, splats_of(centres, normals, 0.3))
    assert frame.coverage.all()
    wanted = towards[0] / np.linalg.norm(towards[0])
    worst = angles(frame.normal, np.broadcast_to(wanted, frame.normal.shape)).max()
    # Some ten of the back's splats meet in a pixel with as many of the front's, each with that share.
    bound = np.degrees(2.0 * FACING_AWAY)
    ledger.record(
        "kernels",
        "two sheets back to back",
        "gaps of 0 to a third of epsilon, in both orders",
        cases=25,
        worst=worst,
        bound=bound,
        unit="degrees",
    )


def test_what_faces_away_alone_shows_its_own_normal(ctx: moderngl.Context, renderer: Renderer) -> None:
    frame = draw(ctx, renderer, splats_of(np.array([[0.0, 0.0, -2.0]]), np.array([[0.3, 0.1, -1.0]]), 3.0))
    wanted = np.array([0.3, 0.1, -1.0]) / np.linalg.norm([0.3, 0.1, -1.0])
    assert frame.coverage.all()
    assert angles(frame.normal, np.broadcast_to(wanted, frame.normal.shape)).max() < 0.001


@pytest.mark.parametrize("normals", ["zero", "cancelling", "tiny"])
def test_leaf_triangles_without_normals(
    ctx: moderngl.Context, renderer: Renderer, ledger: Ledger, normals: str
) -> None:
    positions = np.array([[-3.0, -3.0, -2.0], [3.0, -3.0, -2.0], [0.0, 4.0, -2.0]], np.float32)
    # Cancelling: their mean over the triangle passes through zero.
    given = {"zero": np.zeros((3, 3)), "cancelling": [[0, 0, 1], [0, 0, 1], [0, 0, -1]], "tiny": np.full((3, 3), 1e-30)}
    triangles = Triangles(positions, np.asarray(given[normals], np.float32), np.array([[0, 1, 2]], np.int32), None)
    hierarchy = hierarchy_of(None, triangles)
    renderer.set_hierarchy(hierarchy)
    framebuffer = ctx.simple_framebuffer((VIEW.width, VIEW.height))
    renderer.draw(cut_of(hierarchy), VIEW, Settings(), framebuffer)
    wrong = scan_targets(renderer)
    frame = renderer.read_arrays()
    ctx.detect_framebuffer(0).use()
    framebuffer.release()
    assert frame.coverage.all()
    tried = "normals zero, cancelling within the triangle, of length 1e-30"
    ledger.record("kernels", "leaf triangles without normals", tried, cases=1, worst=len(wrong), bound=0, unit="wrong")


def test_weights_at_the_rim_are_normalised(ctx: moderngl.Context, renderer: Renderer) -> None:
    # All that covers the picture is a rim: a weight of exp(-3) of what faces away, 5e-5.
    radius = 2.0
    splats = splats_of(np.array([[0.98 * radius + 1.0, 0.0, -2.0]]), np.array([[0.2, 0.0, -1.0]]), radius)
    frame = draw(ctx, renderer, splats)
    drawn = frame.coverage > 0.0
    assert drawn.any()
    wanted = np.array([0.2, 0.0, -1.0]) / np.linalg.norm([0.2, 0.0, -1.0])
    assert angles(frame.normal[drawn], np.broadcast_to(wanted, (int(drawn.sum()), 3))).max() < 0.001
    assert np.exp(-SHARPNESS) * FACING_AWAY > 2.0**-126
