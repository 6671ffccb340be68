"""The shaded truth: what the viewer would show if every one of many samples a pixel were exact.

Every sample is lit by the viewer's own shader, `shaders/resolve_shade.frag` with the material "clay"; the samples of a
pixel and the background behind them are averaged in linear light, and the mean is encoded and dithered as the viewer
does it. (The dither is the same in every frame. Left out of the truth it would count as an error, 0.008 of FLIP.) It is
the viewer's picture at a multiple of the resolution, scaled down. All samples of a pixel are lit along the ray through
its centre.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import moderngl
import numpy as np
from numba import njit, prange

from benchmarks.rays import RayCaster, Sample
from benchmarks.reference import Reference, cast
from hierarchy.model import BoolArray, Float32Array, Float64Array, Mesh, UInt8Array
from hierarchy.view import View
from renderer.programs import GLSL_VERSION, Uniforms, shader_source
from renderer.resolve_passes import UNITS, shading_uniforms
from renderer.settings import Settings

# Role: divide the sums of lit samples and put the background behind them. In: v_uv, sum_light. Out: sRGB colour.
AVERAGE_SHADER = """
in vec2 v_uv;
layout(location = 0) out vec4 out_color;
uniform sampler2D sum_light;  // linear light, number of samples that hit
uniform float samples;
uniform vec2 ray_slope;
void main()
{
    vec4 sum = texelFetch(sum_light, ivec2(gl_FragCoord.xy), 0);
    vec3 behind = background(vec3(0.0), normalize(vec3((v_uv * 2.0 - 1.0) * ray_slope, -1.0)), v_uv.y);
    vec3 mean = (sum.rgb + (samples - sum.a) * linear_from_srgb(behind)) / samples;
    out_color = vec4((sum.a > 0.0 ? srgb_from_linear(mean) : behind) + dither(gl_FragCoord.xy), 1.0);
}
"""


def cast_with_picture(
    mesh: Mesh | RayCaster, view: View, shader: PictureShader, samples: int = 4, *, two_sided: bool = False
) -> Reference:
    """Cast a reference as `benchmarks.reference.cast` does, and shade its picture from the same rays.

    two_sided : light surfaces seen from behind as the viewer does where a model is open
    Raises what `cast` raises.
    """
    shader.start(view, two_sided=two_sided)

    def add(sample: Sample) -> None:
        shader.add(sample.normal, np.isfinite(sample.depth), sample.color)

    reference = cast(mesh, view, samples, add)
    return replace(reference, picture=shader.picture())


class PictureShader:
    """Lights normals as the viewer does and averages any number of samples a pixel.

    `start` a picture, `add` its samples one after the other, then take the `picture`.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        """ctx : OpenGL 3.3 core or later; nothing of it stays bound or enabled."""
        self._ctx = ctx
        switches = itertools.product((False, True), repeat=2)
        self._lights = {switch: _program(ctx, light_source(), *switch) for switch in switches}
        parts = [shader_source(f"include/{name}.glsl") for name in ("output", "background")]
        self._average = _program(ctx, "\n".join([*parts, AVERAGE_SHADER]))
        self._arrays = {program: ctx.vertex_array(program, []) for program in (*self._lights.values(), self._average)}
        self._target: _Target | None = None
        self._view: View | None = None
        self._uniforms: dict[str, object] = {}
        self._two_sided = False
        self._samples = 0

    def start(self, view: View, *, two_sided: bool = False) -> None:
        """Forget what was added before."""
        size = (view.width, view.height)
        if self._target is None or self._target.size != size:
            if self._target is not None:
                self._target.release()
            self._target = _Target(self._ctx, size)
        self._target.light.clear()
        self._view, self._two_sided, self._samples = view, two_sided, 0
        self._uniforms = shading_uniforms(view, Settings(), True)

    def add(self, normal: Float32Array, hit: BoolArray, color: Float32Array | None = None) -> None:
        """Add one sample of every pixel.

        normal : float32 (H, W, 3), model space; row 0 at the top
        hit : bool (H, W), where the sample shows the model
        color : float32 (H, W, 3), sRGB in 0..1, the model's own; None: it has none
        Raises RuntimeError before `start`, ValueError where a shape is not that of the view.
        """
        if self._target is None or self._view is None:
            raise RuntimeError("start comes before add")
        shape = (self._view.height, self._view.width)
        shapes = [hit.shape, normal.shape[:2], shape if color is None else color.shape[:2]]
        if any(each != shape for each in shapes):
            raise ValueError(f"the view is {shape}, the sample {shapes}")
        target, program = self._target, self._lights[color is not None, self._two_sided]
        target.normal.write(_turned(normal, hit, self._view.eye_from_model[:3, :3].copy()))
        if color is not None:
            target.color.write(_turned(color, hit, np.eye(3)))
        # The far plane stands for the background: what the depth test rejects is not lit.
        target.depth.write(np.where(hit[::-1], np.float32(0.5), np.float32(1.0)))
        for name, texture in (("normal", target.normal), ("color", target.color)):
            texture.use(UNITS[name])
        units = {"sum_normal": UNITS["normal"], "sum_color": UNITS["color"]}
        target.light.use()
        target.light.depth_mask = False
        self._ctx.enable_only(moderngl.DEPTH_TEST | moderngl.BLEND)
        self._ctx.depth_func = ">"
        self._ctx.blend_func = moderngl.ONE, moderngl.ONE
        self._draw(program, self._uniforms | units)
        self._samples += 1

    def picture(self) -> UInt8Array:
        """Return the mean of what was added, uint8 (H, W, 3), sRGB, row 0 at the top.

        Raises RuntimeError before the first `add`.
        """
        if self._target is None or self._view is None or self._samples == 0:
            raise RuntimeError("start and add come before picture")
        target, view = self._target, self._view
        target.sums.use(0)
        target.picture.use()
        self._ctx.enable_only(moderngl.NOTHING)
        self._draw(self._average, self._uniforms | {"sum_light": 0, "samples": float(self._samples)})
        pixels = np.frombuffer(target.picture.read(components=3, alignment=1), np.uint8)
        return pixels.reshape(view.height, view.width, 3)[::-1].copy()

    def shade(self, normal: Float32Array, coverage: Float32Array, view: View, *, two_sided: bool = False) -> UInt8Array:
        """Return the picture of one sample a pixel: shades for a method that has only normals.

        normal : float32 (H, W, 3), model space
        coverage : float32 (H, W), the model is seen where it is above 0
        """
        self.start(view, two_sided=two_sided)
        self.add(normal, coverage > 0.0)
        return self.picture()

    def _draw(self, program: moderngl.Program, uniforms: dict[str, object]) -> None:
        """Run a program on all pixels at the far plane, and leave moderngl's own state."""
        self._ctx.wireframe = False
        self._ctx.clear_samplers(0, len(UNITS))
        Uniforms(program).set(uniforms | {"plane": 1.0})
        self._arrays[program].render(moderngl.TRIANGLES, 3)
        self._ctx.enable_only(moderngl.NOTHING)
        self._ctx.depth_func = "<="
        self._ctx.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA

    def release(self) -> None:
        """Give everything on the GPU back."""
        if self._target is not None:
            self._target.release()
        for program, array in self._arrays.items():
            array.release()
            program.release()
        self._target = self._view = None


class _Target:
    """Textures of one size: a sample's normals, colours and mask, the sums of its light, and the picture."""

    def __init__(self, ctx: moderngl.Context, size: tuple[int, int]) -> None:
        self.size, self._ctx = size, ctx
        self.normal, self.color, self.sums = (ctx.texture(size, 4, dtype="f4") for _ in range(3))
        self.depth = ctx.depth_texture(size)
        self.light = ctx.framebuffer([self.sums], self.depth)
        self._pixels = ctx.renderbuffer(size, 4)
        self.picture = ctx.framebuffer([self._pixels])

    def release(self) -> None:
        # moderngl binds the framebuffer used last again after it has read another one: that must not be a released one.
        self._ctx.detect_framebuffer(0).use()
        for each in (self.light, self.picture, self.normal, self.color, self.sums, self.depth, self._pixels):
            each.release()


def light_source() -> str:
    """Return the viewer's shading with linear light as its output, within 0..1 and without dither.

    Raises RuntimeError where the shader's output is not what this expects.
    """
    output, source = shader_source("include/output.glsl"), shader_source("resolve_shade.frag")
    if output not in source or not all(f" {name}(" in output for name in ("dither", "srgb_from_linear")):
        raise RuntimeError("resolve_shade.frag does not take dither and srgb_from_linear from include/output.glsl")
    # Macros after the definitions: what follows calls them instead of the functions.
    macros = "#define dither(pixel) 0.0\n#define srgb_from_linear(c) clamp(c, 0.0, 1.0)\n"
    return source.replace(output, f"{output}\n{macros}")


def _program(ctx: moderngl.Context, fragment: str, color: bool = False, two_sided: bool = False) -> moderngl.Program:
    header = f"#version {GLSL_VERSION} core\n" + ("#define COLOR 1\n" if color else "")
    header += "#define TWO_SIDED 1\n" if two_sided else ""
    return ctx.program(header + shader_source("fullscreen.vert"), header + fragment)


@njit(cache=True, nogil=True, parallel=True)
def _turned(vectors: Float32Array, hit: BoolArray, rotation: Float64Array) -> Float32Array:
    """Return rotated vectors with weight 1 where hit, zero elsewhere, float32 (H, W, 4), row 0 at the bottom."""
    height, width = hit.shape
    texels = np.zeros((height, width, 4), np.float32)
    for row in prange(height):
        for column in range(width):
            if hit[row, column]:
                for axis in range(3):
                    for k in range(3):
                        texels[height - 1 - row, column, axis] += rotation[axis, k] * vectors[row, column, k]
                texels[height - 1 - row, column, 3] = 1.0
    return texels
