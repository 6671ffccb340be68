"""The resolve closes the cracks that the plain numpy rule closes, whatever the pattern of covered pixels."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest
from numpy_renderer import cracks

from renderer.resolve_passes import Resolve
from renderer.targets import Targets


@pytest.mark.parametrize("covered_share", [0.3, 0.5, 0.6, 0.7, 0.8, 0.95])
def test_random_patterns(ctx: moderngl.Context, covered_share: float) -> None:
    rng = np.random.default_rng(int(100 * covered_share))
    shape = (50, 70)
    covered = rng.random(shape) < covered_share
    weight = np.where(covered, rng.integers(1, 5, shape), 0).astype(np.float32)
    # A multiple of 1/64 is exact in a half float.
    normal = weight[..., None] * (rng.integers(-32, 33, (*shape, 3)) / 64.0 + [0.0, 0.0, 2.0])
    depth = weight * rng.integers(64, 128, shape) / 64.0

    targets, resolve = Targets(ctx, shape[::-1], color=False, depth=True), Resolve(ctx)
    sums = np.concatenate([normal, weight[..., None]], axis=-1)
    targets.sums["normal"].write(np.ascontiguousarray(sums[::-1].astype(np.float32)), alignment=1)
    targets.sums["depth"].write(np.ascontiguousarray(np.stack([depth, weight], -1)[::-1].astype(np.float32)))
    eye_normal, eye_depth = resolve.arrays(targets)
    ctx.detect_framebuffer(0).use()
    resolve.release()
    targets.release()

    crack, around = cracks(np.concatenate([normal, depth[..., None], weight[..., None]], axis=-1))
    assert crack.sum() > (5 if 0.3 < covered_share < 0.95 else 0)
    assert np.array_equal(eye_normal[..., 3], (covered | crack).astype(np.float32))
    expected = np.concatenate([normal, depth[..., None], weight[..., None]], axis=-1)
    expected[crack] = around[crack]
    drawn = covered | crack
    unit = expected[drawn, :3] / np.linalg.norm(expected[drawn, :3], axis=-1, keepdims=True)
    assert np.allclose(eye_normal[drawn, :3], unit, atol=1e-6)
    assert np.allclose(eye_depth[drawn], expected[drawn, 3] / expected[drawn, 4], rtol=1e-6)
