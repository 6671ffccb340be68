"""The resolve: divide the sums, normalise, and shade every pixel once, or hand the arrays out."""

from __future__ import annotations

import moderngl
import numpy as np

from hierarchy.model import Float32Array
from hierarchy.spans import STRIP
from hierarchy.view import View
from renderer.allocation import allocating
from renderer.matcaps import MATCAPS, make_matcap
from renderer.programs import Uniforms, make_program
from renderer.settings import Settings
from renderer.targets import Targets

# Texture units of the sums and of the matcap.
UNITS = {"normal": 0, "color": 1, "depth": 2, "tint": 3}
MATCAP_UNIT = 4

# Pixels beyond what is drawn in which a crack can lie, and in which discs are widened (splat_passes.py), rounded up.
CRACK_REACH = 4.0
# Depth in clip space of pixels that may lie in a crack: two steps of a 24-bit buffer before the far plane, where no
# model reaches (clip_planes leaves a margin).
MARKED = 1.0 - 4.0 / 2.0**24
# The depth test that lets all pass, and writes.
ALWAYS = "1"


class PicturePass:
    """A program that runs on pixels whose depth passes a test against the far plane: on all, or on those in spans."""

    def __init__(
        self,
        ctx: moderngl.Context,
        fragment: str,
        defines: dict[str, str | int | float],
        spans: moderngl.Buffer | None = None,
    ) -> None:
        """spans : what `Resolve` keeps of `reached_spans`; None: all pixels."""
        self._ctx = ctx
        self._in_strips = spans is not None
        self._program = make_program(ctx, "strips.vert" if self._in_strips else "fullscreen.vert", fragment, defines)
        self._uniforms = Uniforms(self._program)
        self._array = ctx.vertex_array(self._program, [(spans, "2f/i", "in_span")] if spans is not None else [])

    def render(
        self, uniforms: dict[str, object], depth_func: str | None = None, plane: float = 1.0, strips: int = 0
    ) -> None:
        """Draw into the current framebuffer at a depth.

        depth_func : how a pixel's depth has to compare with the plane's, None: draw all
        plane : depth in clip space, 1 is the far plane
        strips : how many there are, where the pass has spans
        """
        self._ctx.enable_only(moderngl.NOTHING if depth_func is None else moderngl.DEPTH_TEST)
        if depth_func is not None:
            self._ctx.depth_func = depth_func
        self._uniforms.set(uniforms | {"plane": plane})
        if self._in_strips:
            self._array.render(moderngl.TRIANGLE_STRIP, 4, instances=strips)
        else:
            self._array.render(moderngl.TRIANGLES, 3)

    def release(self) -> None:
        self._array.release()
        self._program.release()


class Resolve:
    """The passes over the sums, compiled when first needed, and the matcaps."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._passes: dict[tuple[str, tuple[str, ...]], PicturePass] = {}
        self._matcaps: dict[str, moderngl.Texture] = {}
        self._spans = ctx.buffer(reserve=8, dynamic=True)

    def erase(self, targets: Targets) -> None:
        """Set all sums to zero and depths to the far plane, where they are not.

        `targets.drawn` is for who draws next to fill in.
        """
        if targets.drawn is None:
            targets.clear()
        else:
            targets.attributes.use()
            uniforms: dict[str, object] = {"picture_size": targets.size, "strip": float(STRIP)}
            self._pass("erase.frag", {"STRIPS"}).render(uniforms, ALWAYS, strips=self._bring(targets.drawn))
        targets.drawn = None

    def shade(
        self,
        targets: Targets,
        view: View,
        settings: Settings,
        *,
        has_colors: bool,
        ground: tuple[float, float],
        spans: Float32Array,
    ) -> None:
        """Shade a frame into `targets.picture`.

        has_colors : the model has colours of its own
        ground : height of the ground along settings.ground_up and radius of the model, model space
        spans : of `reached_spans`, with a margin of CRACK_REACH; there is nothing elsewhere
        """
        uniforms = self._bind(targets) | shading_uniforms(view, settings, has_colors) | _ground(view, settings, ground)
        uniforms |= {"picture_size": targets.size, "strip": float(STRIP)}
        kinds = _kinds(targets)
        if settings.two_sided:
            kinds |= {"TWO_SIDED"}
        if settings.material in MATCAPS:
            self._matcap(settings.material).use(MATCAP_UNIT)
            kinds |= {"MATCAP"}
        # The floor does not show from below.
        has_floor = settings.ground and (view.is_parallel or uniforms["ground_plane"][3] < 0.0)  # type: ignore[index]
        if not has_floor:
            self._gradient(targets, settings, uniforms)
            self._ctx.copy_framebuffer(targets.picture_only, targets.gradient)
        strips = self._bring(spans)
        targets.picture.use()
        targets.picture.depth_mask = False
        # Software renderers skip what the depth test rejects, and nothing else: hence several passes and not a branch.
        # To find that there is nothing takes them a third of what shading takes: hence strips.
        self._pass("resolve_shade.frag", kinds | {"STRIPS"}).render(uniforms, ">", strips=strips)
        if has_floor:
            self._pass("resolve_background.frag", {"GROUND"}).render(uniforms, "==")
        targets.visibility.use()
        targets.visibility.depth_mask = True
        self._pass("resolve_cracks.frag", {"STRIPS"}).render(uniforms, "<", MARKED, strips)
        targets.picture.use()
        targets.picture.depth_mask = False
        self._pass("resolve_shade.frag", kinds | {"CRACKS", "STRIPS"}).render(uniforms, "==", MARKED, strips)
        targets.picture.depth_mask = True

    def _gradient(self, targets: Targets, settings: Settings, uniforms: dict[str, object]) -> None:
        """Draw the background into `targets.gradient`, unless that is what is there."""
        colors = (settings.background_top, settings.background_bottom)
        if targets.gradient_colors != colors:
            targets.gradient.use()
            self._pass("resolve_background.frag", set()).render(uniforms)
            targets.gradient_colors = colors

    def _bring(self, spans: Float32Array) -> int:
        """Bring spans to the GPU and return how many they are."""
        if spans.nbytes > self._spans.size:
            self._spans.orphan(spans.nbytes)
        self._spans.write(spans)
        return len(spans)

    def arrays(self, targets: Targets) -> tuple[np.ndarray, np.ndarray]:
        """Return eye-space normal and coverage, float32 (H, W, 4), and depth, float32 (H, W); row 0 at the top.

        Raises GpuError where there is no memory for them.
        """
        width, height = targets.size
        with allocating(self._ctx, f"the arrays of {width} x {height} pixels") as held:
            normals = held.add(self._ctx.texture(targets.size, 4, dtype="f4"))
            depths = held.add(self._ctx.texture(targets.size, 1, dtype="f4"))
            framebuffer = held.add(self._ctx.framebuffer([normals, depths]))
        try:
            framebuffer.use()
            self._pass("resolve_arrays.frag", _kinds(targets)).render(self._bind(targets))
            normal = np.frombuffer(normals.read(), np.float32).reshape(height, width, 4)[::-1]
            depth = np.frombuffer(depths.read(), np.float32).reshape(height, width)[::-1]
        finally:
            # moderngl rebinds the framebuffer that it used last; it must not be one that is gone.
            targets.attributes.use()
            held.release()
        return normal, depth

    def release(self) -> None:
        for each in self._passes.values():
            each.release()
        for matcap in self._matcaps.values():
            matcap.release()
        self._passes.clear()
        self._matcaps.clear()
        self._spans.release()

    def _pass(self, fragment: str, kinds: set[str]) -> PicturePass:
        key = (fragment, tuple(sorted(kinds)))
        if key not in self._passes:
            spans = self._spans if "STRIPS" in kinds else None
            self._passes[key] = PicturePass(self._ctx, fragment, dict.fromkeys(kinds, 1), spans)
        return self._passes[key]

    def _bind(self, targets: Targets) -> dict[str, object]:
        for name, texture in targets.sums.items():
            texture.use(UNITS[name])
        uniforms: dict[str, object] = {f"sum_{name}": UNITS[name] for name in targets.sums}
        return uniforms | {"matcap": MATCAP_UNIT}

    def _matcap(self, name: str) -> moderngl.Texture:
        if name not in self._matcaps:
            texels = make_matcap(name)
            texture = self._ctx.texture(texels.shape[1::-1], 4, texels, dtype="f4")
            texture.repeat_x = texture.repeat_y = False
            self._matcaps[name] = texture
        return self._matcaps[name]


def _kinds(targets: Targets) -> set[str]:
    return {name.upper() for name in targets.sums if name != "normal"}


def shading_uniforms(view: View, settings: Settings, has_colors: bool) -> dict[str, object]:
    """Return what the shaders need of a view and its settings to shade a pixel."""
    # A matcap is the whole material; only the model's own colours tint it.
    plain = (1.0, 1.0, 1.0) if settings.material in MATCAPS else tuple(c**2.2 for c in settings.base_color)
    extent = np.array([view.half_height * view.width / view.height, view.half_height])
    return {
        "use_colors": settings.use_colors and has_colors,
        "base_color": plain,
        "background_top": settings.background_top,
        "background_bottom": settings.background_bottom,
        "ray_slope": tuple(0.0 * extent if view.is_parallel else extent),
        "ray_start": tuple(extent if view.is_parallel else 0.0 * extent),
    }


def _ground(view: View, settings: Settings, ground: tuple[float, float]) -> dict[str, object]:
    """Return the ground's plane n.p = d in eye space, and the point of it below the model's centre."""
    height, radius = ground
    up = np.asarray(settings.ground_up, np.float64)
    up /= np.linalg.norm(up)
    normal = view.eye_from_model[:3, :3] @ up
    return {
        "ground_plane": (*normal, height - float(up @ view.eye)),
        "ground_centre": tuple(view.eye_from_model[:3, 3] + normal * height),
        "ground_radius": radius,
    }
