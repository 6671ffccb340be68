"""Look for numbers that are none in everything that a frame leaves on the GPU."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import moderngl
import numpy as np

from renderer.renderer import Renderer

# How far the length of a unit vector in float32 may be from 1.
UNIT = 1e-5


def scan_targets(renderer: Renderer) -> list[str]:
    """Return what is wrong with the frame that was drawn last; an empty list where all is well.

    Draws that frame again, into a picture of floats, since a byte cannot tell NaN from black. Looked at are the depth
    buffer, every sum, the shaded picture before it becomes bytes, and the arrays of `Renderer.read_arrays`.
    Raises RuntimeError where nothing was drawn.
    """
    if renderer._last is None or renderer._targets is None:
        raise RuntimeError("draw comes before scan_targets")
    cut, view, settings, framebuffer = renderer._last
    wrong: list[str] = []
    with _float_picture(renderer) as (picture, shown):
        renderer.draw(cut, view, settings, shown)
        shaded = texels(picture)
    renderer._last = cut, view, settings, framebuffer
    wrong += _check("picture", np.isfinite(shaded) & (shaded > -1.0) & (shaded < 2.0))
    depth = texels(renderer._targets.visible_depth)
    wrong += _check("visible depth", (depth >= 0.0) & (depth <= 1.0))
    for name, texture in renderer._targets.sums.items():
        wrong += _check(f"sum of {name}", np.isfinite(texels(texture)))
    weight = texels(renderer._targets.sums["normal"])[..., 3]
    wrong += _check("sum of weights", weight >= 0.0)
    return wrong + scan_frame(renderer)


def scan_frame(renderer: Renderer) -> list[str]:
    """Return what is wrong with the arrays of the frame that was drawn last."""
    frame = renderer.read_arrays()
    drawn = frame.coverage > 0.0
    length = np.sqrt((frame.normal.astype(np.float64) ** 2).sum(axis=-1))
    wrong = _check("coverage", (frame.coverage == 0.0) | (frame.coverage == 1.0))
    wrong += _check("normal that is drawn", ~drawn | (np.abs(length - 1.0) < UNIT))
    wrong += _check("normal of nothing", drawn | (length == 0.0))
    wrong += _check("depth that is drawn", ~drawn | np.isfinite(frame.depth))
    wrong += _check("depth of nothing", drawn | (frame.depth == np.inf))
    return wrong


def texels(texture: moderngl.Texture) -> np.ndarray:
    """Return a texture of floats or half floats, (H, W, C), row 0 at the bottom."""
    dtype = {"f4": np.float32, "f2": np.float16}[texture.dtype]
    values = np.frombuffer(texture.read(alignment=1), dtype)
    return values.reshape(texture.height, texture.width, texture.components)


def _check(what: str, good: np.ndarray) -> list[str]:
    return [] if good.all() else [f"{what}: {int((~good).sum())} of {good.size} are not what they must be"]


@contextmanager
def _float_picture(renderer: Renderer) -> Iterator[tuple[moderngl.Texture, moderngl.Framebuffer]]:
    """Have the renderer shade into float32 texels meanwhile, and copy those to a framebuffer of floats."""
    targets = renderer._targets
    assert targets is not None
    textures = [renderer._ctx.texture(targets.size, 4, dtype="f4") for _ in range(3)]
    made = [renderer._ctx.framebuffer([textures[0]], targets.visible_depth)]
    made += [renderer._ctx.framebuffer([texture]) for texture in textures]
    usual = targets.picture, targets.picture_only, targets.gradient, targets.gradient_colors
    targets.picture, targets.picture_only, targets.gradient, targets.gradient_colors = *made[:3], None
    try:
        yield textures[0], made[3]
    finally:
        targets.picture, targets.picture_only, targets.gradient, targets.gradient_colors = usual
        # moderngl rebinds the framebuffer that it used last; it must not be one that is gone.
        targets.picture.use()
        for each in (*made, *textures):
            each.release()
