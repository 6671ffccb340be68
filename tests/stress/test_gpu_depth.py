"""The depth buffer with clip planes far apart, and the epsilon of the visibility pass from one pixel to the window."""

from __future__ import annotations

from collections.abc import Callable

import moderngl
import numpy as np
import pytest
from frame_in_numpy import numpy_discs
from glsl_harness import Stage, cut_of, hierarchy_of, splats_of
from ledger import Ledger
from scan_targets import scan_targets

from hierarchy.leaves import Triangles
from hierarchy.view import View
from renderer.renderer import Renderer
from renderer.settings import Settings
from renderer.splat_passes import EPSILON

Amount = Callable[[int, int], int]

SIZE = 24
RATIOS = (10.0, 1e3, 1e4, 1e5, 1e6)
SPLATS = pytest.mark.parametrize("splat", ["quad", "sprite"])


def step_of(view: View, depth: float) -> float:
    """Return what a step of a 24-bit depth buffer is at a depth."""
    slab = view.far - view.near
    return 2.0**-24 * slab * (1.0 if view.is_parallel else depth * depth / (view.near * view.far))


def view_of(ratio: float, parallel: bool) -> View:
    return View(np.eye(4), 0.8, SIZE, SIZE, 1.0 / ratio, 1.0, parallel_scale=0.4 if parallel else None)


@SPLATS
@pytest.mark.parametrize("parallel", [False, True], ids=["perspective", "parallel"])
def test_depths_between_planes_that_are_far_apart(
    ctx: moderngl.Context,
    renderer: Renderer,
    ledger: Ledger,
    amount: Amount,
    rng: np.random.Generator,
    parallel: bool,
    splat: str,
) -> None:
    steps, relative, cases = 0.0, 0.0, 0
    framebuffer = ctx.simple_framebuffer((SIZE, SIZE))
    for ratio in RATIOS:
        view = view_of(ratio, parallel)
        for depth in np.exp(rng.uniform(np.log(1.1 / ratio), np.log(0.75), amount(3, 60))):
            pixel = 1.0 / float(view.pixels_of_unit(depth))
            radius = pixel * float(np.exp(rng.uniform(np.log(0.8), np.log(60.0))))
            splats = splats_of(np.array([[0.0, 0.0, -depth]]), np.array([[0.0, 0.0, 1.0]]), radius)
            hierarchy = hierarchy_of(splats)
            cut = cut_of(hierarchy, silhouette=1)
            renderer.set_hierarchy(hierarchy)
            renderer.draw(cut, view, Settings(splat=splat), framebuffer)
            at = float(splats["centre"][0, 2]) * -1.0
            push = EPSILON[1] * float(splats["radius"][0])
            pushed = at + push if parallel else at * (1.0 + push / max(at, push))
            frame = renderer.read_arrays()
            middle = SIZE // 2
            assert frame.coverage[middle, middle] == 1.0, (ratio, depth, radius)
            off = abs(float(frame.depth[middle, middle]) - at)
            # Parallel depths are read from the buffer's z, which is a share of the slab.
            relative = max(relative, off / (view.far - view.near if parallel else at))
            # Beyond the far plane nothing is pushed.
            if pushed < 0.9 * view.far:
                found = renderer.depth_at(middle, middle)
                steps = max(steps, abs(found - pushed) / step_of(view, pushed))
            cases += 1
    ctx.detect_framebuffer(0).use()
    framebuffer.release()
    kind = f"{splat}s, {'parallel' if parallel else 'perspective'}"
    tried = "far / near of 10 to 1e6, discs from one pixel to more than the window, at depths from near to far"
    # z / w is up to 1 and good to some 2^-23, of the matrix's entries, the product, the division and the interpolation.
    ledger.record(
        "kernels", f"depth buffer, z^2 / near 2^-24 ({kind})", tried, cases=cases, worst=steps, bound=8.0, unit="steps"
    )
    bound = 8.0 * 2.0**-24
    ledger.record("kernels", f"depth of read_arrays ({kind})", tried, cases=cases, worst=relative, bound=bound)


@SPLATS
def test_the_front_never_loses_its_own_splats(
    ctx: moderngl.Context, renderer: Renderer, ledger: Ledger, amount: Amount, rng: np.random.Generator, splat: str
) -> None:
    lost, cases = 0, 0
    framebuffer = ctx.simple_framebuffer((SIZE, SIZE))
    for turn in range(amount(12, 400)):
        view = view_of(RATIOS[turn % len(RATIOS)], turn % 5 == 4)
        depth = float(np.exp(rng.uniform(np.log(1.5 * view.near), np.log(0.7))))
        pixel = 1.0 / float(view.pixels_of_unit(depth))
        # Of any tilt, from below a pixel to beyond the window, the eye and the far plane.
        radius = pixel * float(np.exp(rng.uniform(np.log(0.1), np.log(60.0 if splat == "sprite" else 5_000.0))))
        normal = rng.normal(size=3) * [1.0, 1.0, rng.choice([1.0, 0.1, 0.001, 0.0])]
        splats = splats_of(np.array([[0.0, 0.0, -depth]]), normal[None], radius, rng.choice([0.0, 0.3]) * radius)
        hierarchy = hierarchy_of(splats)
        cut = cut_of(hierarchy)
        points = Stage(ctx, renderer, hierarchy, view, cut).disc_points(sprite=splat == "sprite")
        renderer.draw(cut, view, Settings(splat=splat), framebuffer)
        assert scan_targets(renderer) == []
        frame = renderer.read_arrays()
        lost += int(((points[..., 3] > 0.0) & (frame.coverage == 0.0)).sum())
        cases += 1
        assert numpy_discs(hierarchy, None, cut, view, True).epsilons[0] > 0.0
    ctx.detect_framebuffer(0).use()
    framebuffer.release()
    tried = "discs of 0.1 pixels to beyond the window, the eye and the far plane, every tilt, far / near to 1e6"
    ledger.record(
        "kernels",
        f"own fragments behind the visible depth ({splat}s)",
        tried,
        cases=cases,
        worst=lost,
        bound=0,
        unit="pixels",
    )


def test_a_sheet_behind_another_does_not_shine_through(
    ctx: moderngl.Context, renderer: Renderer, ledger: Ledger, amount: Amount, rng: np.random.Generator
) -> None:
    shining, cases = 0, 0
    framebuffer = ctx.simple_framebuffer((SIZE, SIZE))
    x, y = (part.ravel() for part in np.meshgrid(np.linspace(-1, 1, 17), np.linspace(-1, 1, 17)))
    for turn in range(amount(10, 200)):
        view = view_of(RATIOS[turn % len(RATIOS)], turn % 5 == 4)
        depth = float(np.exp(rng.uniform(np.log(2.0 * view.near), np.log(0.4))))
        half = 0.9 * view.half_height * (1.0 if view.is_parallel else depth)
        radius = 0.125 * half * float(rng.uniform(1.0, 3.0))
        # As the promise has it: behind by the push, along the view ray, and the steps of the depth buffer.
        push = EPSILON[1] * radius
        behind = depth + push if view.is_parallel else depth * (1.0 + push / depth)
        behind += 16.0 * step_of(view, behind)
        if behind > 0.9:
            continue
        front = np.stack([half * x, half * y, np.full(x.shape, -depth)], axis=1)
        back = np.stack([2.0 * half * x, 2.0 * half * y, np.full(x.shape, -behind)], axis=1)
        normals = np.tile([0.0, 0.0, 1.0], (2 * len(x), 1))
        splats = splats_of(np.concatenate([front, back]), normals, np.repeat([radius, 2.5 * radius], len(x)))
        hierarchy = hierarchy_of(splats)
        renderer.set_hierarchy(hierarchy)
        renderer.draw(cut_of(hierarchy, silhouette=len(splats)), view, Settings(), framebuffer)
        frame = renderer.read_arrays()
        inner = np.s_[4:-4, 4:-4]
        shining += int((frame.depth[inner] > depth + 0.25 * (behind - depth) + 4.0 * step_of(view, depth)).sum())
        cases += 1
    ctx.detect_framebuffer(0).use()
    framebuffer.release()
    tried = "behind by epsilon and 16 steps of the depth buffer; far / near to 1e6"
    ledger.record("kernels", "a sheet behind another", tried, cases=cases, worst=shining, bound=0, unit="pixels")


def test_needles_thinner_than_the_grid_have_depths_of_the_slab(
    ctx: moderngl.Context, renderer: Renderer, ledger: Ledger, amount: Amount, rng: np.random.Generator
) -> None:
    # Their slopes are those of corners on the rasteriser's grid, and 1 / w extrapolates to 0 and beyond.
    wrong, cases = 0, 0
    framebuffer = ctx.simple_framebuffer((64, 64))
    for _ in range(amount(20, 400)):
        count = 300
        ends = rng.normal(size=(count, 2, 3)) * [0.5, 0.5, 1.0] - [0.0, 0.0, 1.5]
        third = ends.mean(axis=1) + 10.0 ** rng.uniform(-8.0, -2.0, (count, 1)) * rng.normal(size=(count, 3))
        positions = np.concatenate([ends, third[:, None]], axis=1).reshape(-1, 3).astype(np.float32)
        normals = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (len(positions), 1))
        triangles = Triangles(positions, normals, np.arange(len(positions), dtype=np.int32).reshape(-1, 3), None)
        hierarchy = hierarchy_of(None, triangles)
        view = View(np.eye(4), 0.8, 64, 64, 1e-4, 4.0)
        renderer.set_hierarchy(hierarchy)
        renderer.draw(cut_of(hierarchy), view, Settings(), framebuffer)
        frame = renderer.read_arrays()
        depth = frame.depth[frame.coverage > 0.0]
        wrong += int((~(depth >= 0.999 * view.near) | ~(depth <= 1.001 * view.far)).sum())
        cases += count
    ctx.detect_framebuffer(0).use()
    framebuffer.release()
    tried = "triangles 1e-8 to 1e-2 wide, many through the near plane"
    ledger.record("kernels", "depths of needles", tried, cases=cases, worst=wrong, bound=0, unit="out of the slab")
