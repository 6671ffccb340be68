"""The resolve: divide the sums, normalise, and shade every pixel once, or hand the arrays out."""

from __future__ import annotations

import math

import moderngl
import numpy as np

from hierarchy.view import View
from renderer.matcaps import MATCAPS, make_matcap
from renderer.programs import make_program
from renderer.settings import Settings
from renderer.splat_passes import set_uniforms
from renderer.targets import Targets

# Texture units of the sums and of the matcap.
UNITS = {"normal": 0, "color": 1, "depth": 2, "tint": 3}
MATCAP_UNIT = 4


class ResolvePass:
    """A fullscreen pass over the sums: "shade" for a picture, "arrays" for normal, depth and coverage."""

    def __init__(self, ctx: moderngl.Context, kind: str, sums: dict[str, moderngl.Texture]) -> None:
        self._ctx = ctx
        defines: dict[str, str | int | float] = {name.upper(): 1 for name in sums if name != "normal"}
        self.program = make_program(ctx, "fullscreen.vert", f"resolve_{kind}.frag", defines)
        self._array = ctx.vertex_array(self.program, [])
        self._matcaps: dict[str, moderngl.Texture] = {}

    def render(self, targets: Targets, framebuffer: moderngl.Framebuffer, uniforms: dict[str, object]) -> None:
        """Resolve the sums into a framebuffer of the same size."""
        for name, texture in targets.sums.items():
            texture.use(UNITS[name])
            uniforms[f"sum_{name}"] = UNITS[name]
        framebuffer.use()
        self._ctx.enable_only(moderngl.NOTHING)
        set_uniforms(self.program, uniforms)
        self._array.render(moderngl.TRIANGLES, 3)

    def use_matcap(self, name: str) -> None:
        """Bind a matcap, making it on first use."""
        if name not in self._matcaps:
            texels = make_matcap(name)
            texture = self._ctx.texture(texels.shape[1::-1], 3, texels, dtype="f4")
            texture.repeat_x = texture.repeat_y = False
            self._matcaps[name] = texture
        self._matcaps[name].use(MATCAP_UNIT)

    def release(self) -> None:
        self._array.release()
        self.program.release()
        for texture in self._matcaps.values():
            texture.release()


def shade(
    resolve: ResolvePass,
    targets: Targets,
    framebuffer: moderngl.Framebuffer,
    view: View,
    settings: Settings,
    has_colors: bool,
    ground: tuple[float, float],
) -> None:
    """Shade a frame.

    has_colors : the model has colours of its own
    ground : height of the ground along settings.ground_up and radius of the model, model space
    """
    matcap = settings.material in MATCAPS
    if matcap:
        resolve.use_matcap(settings.material)
    up = np.asarray(settings.ground_up, np.float64)
    up /= np.linalg.norm(up)
    tangent = math.tan(0.5 * view.view_angle)
    eye_from_model = view.eye_from_model[:3, :3]
    # The ground in eye space: n.p = d.
    normal = eye_from_model @ up
    resolve.render(
        targets,
        framebuffer,
        {
            "matcap": MATCAP_UNIT,
            "use_matcap": matcap,
            "use_colors": settings.use_colors and has_colors,
            "two_sided": settings.two_sided,
            "base_color": settings.base_color,
            "background_top": settings.background_top,
            "background_bottom": settings.background_bottom,
            "ray_slope": (tangent * view.width / view.height, tangent),
            "show_ground": settings.ground,
            "ground_plane": (*normal, ground[0] - float(up @ view.eye)),
            "ground_centre": tuple(view.eye_from_model[:3, 3] + normal * ground[0]),
            "ground_radius": ground[1],
        },
    )


def resolve_arrays(ctx: moderngl.Context, resolve: ResolvePass, targets: Targets) -> tuple[np.ndarray, np.ndarray]:
    """Return eye-space normal and coverage, float32 (H, W, 4), and depth, float32 (H, W); row 0 at the top."""
    width, height = targets.size
    outputs = [ctx.texture(targets.size, 4, dtype="f4"), ctx.texture(targets.size, 1, dtype="f4")]
    framebuffer = ctx.framebuffer(outputs)
    try:
        resolve.render(targets, framebuffer, {})
        normal = np.frombuffer(outputs[0].read(), np.float32).reshape(height, width, 4)[::-1]
        depth = np.frombuffer(outputs[1].read(), np.float32).reshape(height, width)[::-1]
    finally:
        # moderngl rebinds the framebuffer it used last; it must not be one that is gone.
        targets.attributes.use()
        framebuffer.release()
        for texture in outputs:
            texture.release()
    return normal, depth
