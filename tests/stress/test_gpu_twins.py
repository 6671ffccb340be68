"""The shaders' functions against their twins in the core, in float64."""

from __future__ import annotations

from collections.abc import Callable

import moderngl
import numpy as np
from glsl_harness import Stage, cut_of, evaluate, hierarchy_of, splats_of
from ledger import Ledger

from hierarchy.boxes import TURN_STEP, TURNS
from hierarchy.encoding import decode_hemisphere
from hierarchy.frames import tangents
from hierarchy.kernel import SHARPNESS
from hierarchy.view import look_at
from renderer.renderer import Renderer
from renderer.splat_passes import MARGIN

Amount = Callable[[int, int], int]

# Half the distance of two float32 numbers around 1.
ROUNDING = 2.0**-24


def directions(rng: np.random.Generator, count: int) -> np.ndarray:
    """Return float32 (N, 3) unit vectors: all over the sphere, and crowded at the seams of the basis: the poles, the
    plane n_z = 0 from both sides and with both zeros, and the planes of the axes."""
    spread = rng.normal(size=(count, 3))
    tiny = np.logspace(-38, -1, count // 8)[:, None] * rng.normal(size=(count // 8, 3))
    poles = np.array([0.0, 0.0, 1.0]) + tiny
    equator = rng.normal(size=(count // 8, 3))
    equator[:, 2] = tiny[:, 0]
    zeros = equator * [1.0, 1.0, 0.0]
    planes = np.concatenate([equator[:, [2, 0, 1]], equator[:, [0, 2, 1]]])
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    every = np.concatenate([spread, poles, -poles, equator, zeros, zeros * [1.0, 1.0, -1.0], planes, axes])
    every /= np.linalg.norm(every, axis=1, keepdims=True)
    return every.astype(np.float32)


def test_tangents(ctx: moderngl.Context, ledger: Ledger, amount: Amount, rng: np.random.Generator) -> None:
    n = directions(rng, amount(20_000, 1_000_000))
    body = "vec3 o1, o2; tangents(in0.xyz, o1, o2); out0 = vec4(o1, 0.0); out1 = vec4(o2, 0.0);"
    o1, o2 = (part[:, :3].astype(np.float64) for part in evaluate(ctx, ["frame.glsl"], body, n, outputs=2))
    n64 = n.astype(np.float64)
    twin = np.stack(tangents_of(n64), axis=1)
    tried = "all over the sphere, and close to the poles, n_z = +0 and -0 and the axes' planes"
    # a = 1 / (1 + |n_z|) <= 1 takes three roundings with its sum; every product has at most two more, and one sum.
    worst = np.abs(np.concatenate([o1, o2], axis=1) - twin).max()
    ledger.record("kernels", "tangents in GLSL", tried, cases=len(n), worst=worst, bound=8 * ROUNDING)
    frame = np.stack([o1, o2, n64], axis=1)
    error = np.abs(frame @ frame.swapaxes(1, 2) - np.eye(3)).max()
    # The normals that come in are unit to one rounding in each component only.
    ledger.record("kernels", "frame in GLSL is orthonormal", tried, cases=len(n), worst=error, bound=12 * ROUNDING)
    assert np.linalg.det(frame).min() > 0.999999


def tangents_of(n: np.ndarray) -> list[np.ndarray]:
    """Return the six numbers of `frames.tangents` for float64 (N, 3)."""
    vectorised = np.vectorize(tangents.py_func, otypes=[np.float64] * 6)
    return list(vectorised(*n.T))


def test_decoding_of_tile_normals(
    ctx: moderngl.Context, ledger: Ledger, amount: Amount, rng: np.random.Generator
) -> None:
    y, x = np.mgrid[0:256, 0:256]
    codes = np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float64)
    count = amount(20_000, 1_000_000)
    between = rng.uniform(0.0, 255.0, (count, 2))
    # Along the folds x = 0 and y = 0, where two sums of bytes cancel.
    between[: count // 4, 0] = 256.0 - between[: count // 4, 1]
    between = np.clip(between, 0.0, 255.0)
    body = "out0 = vec4(normalize(decode_hemisphere(in0.xy)), 0.0);"
    for what, values, tried in (
        ("decoding of tile normals in GLSL", codes, "all 65,536 pairs of bytes"),
        ("the same between the texels", between, "anywhere between bytes, and on the folds of the octahedron"),
    ):
        decoded = evaluate(ctx, ["hemisphere.glsl"], body, (values / 255.0).astype(np.float32))[0][:, :3]
        twin = decode_hemisphere(values)
        # e is at most 1.01 with three roundings of numbers up to 2.02; the sum's length is at least 3^-1/2.
        worst = np.linalg.norm(decoded - twin, axis=1).max()
        ledger.record("kernels", what, tried, cases=len(values), worst=worst, bound=24 * ROUNDING, unit="rad")


def test_corners_of_boxes(
    ctx: moderngl.Context, renderer: Renderer, ledger: Ledger, amount: Amount, rng: np.random.Generator
) -> None:
    count = amount(5_000, 200_000)
    ends = np.sort(rng.uniform(-1.0, 1.0, (count, 2, 2)), axis=2)
    # Needles, points and whole discs, and margins from none to far beyond the rim.
    ends[::5, 1, 1] = ends[::5, 1, 0]
    ends[::7, 0] = ends[::7, 0, :1]
    ends[::3] = [-1.0, 1.0]
    boxes = ends.reshape(count, 4).astype(np.float32).astype(np.float64)
    turns = rng.integers(0, TURNS, count)
    stored = boxes.copy()
    stored[:, 3] += TURN_STEP * turns
    # Seen from before them no pixel widens the rectangles: what is left of the margin is a share of the thickness.
    thickness = np.where(rng.random(count) < 0.3, 0.0, 10.0 ** rng.uniform(-6.0, 30.0, count)).astype(np.float32)
    splats = splats_of(
        np.tile([0.0, 0.0, 3.0], (count, 1)), np.tile([0.0, 0.0, 1.0], (count, 1)), 1.0, thickness, stored
    )
    hierarchy = hierarchy_of(splats)
    view = look_at((0, 0, 1), (0, 0, 0), (0, 1, 0), 1.0, (32, 32), bounds=hierarchy.bounds)
    found = Stage(ctx, renderer, hierarchy, view, cut_of(hierarchy)).corners(visibility=False)[1]

    margin = MARGIN[1] * thickness.astype(np.float64)[:, None]
    low, high = np.maximum(boxes[:, ::2] - margin, -1.0), np.minimum(boxes[:, 1::2] + margin, 1.0)
    angle = 0.5 * np.pi * turns / TURNS
    c, s = np.cos(angle), np.sin(angle)
    corners = [(low[:, 0], low[:, 1]), (high[:, 0], low[:, 1]), (low[:, 0], high[:, 1]), (high[:, 0], high[:, 1])]
    twin = np.stack([np.stack([c * x - s * y, s * x + c * y], axis=1) for x, y in corners], axis=1)
    # The last number of a box lost three bits to the turn: 2^-20 where it is up to 4 * 7 + 1. A GPU's sine and cosine
    # may be off by 2^-11 (Direct3D's rule, which OpenGL's drivers follow): a share of 2^-10 of the corner.
    tried = "needles, points, whole discs; margins of 0 to 1e30 radii; all turns"
    worst = np.abs(found - twin).max()
    bound = 2.0**-20 + (0.0 if "llvmpipe" in ctx.info["GL_RENDERER"] else 2.0**-10) + 8 * ROUNDING
    ledger.record(
        "kernels", "corners of a splat's rectangle", tried, cases=count, worst=worst, bound=bound, unit="radii"
    )


def test_kernel_weights(ctx: moderngl.Context, ledger: Ledger, amount: Amount, rng: np.random.Generator) -> None:
    rho2 = np.concatenate([rng.uniform(0.0, 1.0, amount(10_000, 500_000)), np.logspace(-45, 0, 1_000), [0.0, 1.0]])
    values = rho2.astype(np.float32)[:, None]
    body = "out0 = vec4(exp(-SHARPNESS * in0.x));"
    found = evaluate(ctx, [], body, values, defines=f"#define SHARPNESS {SHARPNESS:.9g}\n")[0][:, 0]
    twin = np.exp(-SHARPNESS * values[:, 0].astype(np.float64))
    # GLSL lets exp(x) be off by 3 + 2 |x| units in the last place; llvmpipe takes a polynomial of 2^x good to 1e-6.
    worst = np.abs(found / twin - 1.0).max()
    tried = "rho^2 from 0 to 1, and down to 1e-45"
    ledger.record("kernels", "kernel weight in GLSL", tried, cases=len(values), worst=worst, bound=18 * ROUNDING)


def test_colours_to_bytes(ctx: moderngl.Context, ledger: Ledger, amount: Amount, rng: np.random.Generator) -> None:
    linear = np.concatenate([np.linspace(0.0, 1.0, amount(20_001, 1_000_001)), np.logspace(-45, 0, 1_000)])
    outside = np.array([-1e30, -1.0, -0.0, 1.0 + 1e-6, 2.0, 1e30])
    values = np.concatenate([linear, outside]).astype(np.float32)[:, None]
    found = evaluate(ctx, ["output.glsl"], "out0 = vec4(srgb_from_linear(in0.xxx), 0.0);", values)[0]
    twin = np.clip(values.astype(np.float64), 0.0, 1.0) ** (1.0 / 2.2)
    worst = 255.0 * np.abs(found[:, :3] - twin).max()
    tried = "all of 0..1, down to 1e-45, and values far outside"
    ledger.record(
        "kernels", "bytes of a colour", tried, cases=len(values), worst=worst, bound=0.531, unit="grey levels"
    )
    grey = np.arange(256) / 255.0
    back = evaluate(ctx, ["output.glsl"], "out0 = vec4(linear_from_srgb(in0.xxx), 0.0);", grey[:, None])[0][:, 0]
    # pow is exp2 of a log2, which near 1 / 255 is 8 with half a unit in the last place of 8 times 2.2.
    error = np.abs(back - grey**2.2) / np.maximum(grey**2.2, 1e-30)
    ledger.record("kernels", "light of a byte", "all 256 bytes", cases=256, worst=error.max(), bound=2.0**-16)


def test_normals_a_denormal_below_the_equator_have_the_same_basis(ctx: moderngl.Context) -> None:
    n = np.array([[0.6, 0.8, -1e-40], [0.6, 0.8, -1e-45], [-0.8, 0.6, 1e-40]], np.float32)
    found = evaluate(ctx, ["frame.glsl"], "vec3 o1, o2; tangents(in0.xyz, o1, o2); out0 = vec4(o1, 0.0);", n)[0][:, :3]
    assert np.abs(found - np.stack(tangents_of(n.astype(np.float64)), axis=1)[:, :3]).max() < 8 * ROUNDING
