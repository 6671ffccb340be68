"""Run the shaders' own functions and stages on arrays: what they compute, without what comes after."""

from __future__ import annotations

from collections.abc import Iterable

import moderngl
import numpy as np

from hierarchy.drawn_rows import records_of
from hierarchy.hierarchy import SPLAT, Hierarchy
from hierarchy.leaves import Surfels, Triangles
from hierarchy.lod import Cut
from hierarchy.view import View
from renderer.cut_buffers import TRIANGLES_OF_CORNERS
from renderer.programs import Uniforms, shader_source
from renderer.renderer import Renderer
from renderer.settings import Settings
from renderer.splat_passes import Variant, pass_uniforms

WHOLE = (-1.0, 1.0, -1.0, 1.0)
# Texels along a row of the textures that carry arrays.
_WIDTH = 1024


def evaluate(
    ctx: moderngl.Context, includes: Iterable[str], body: str, *inputs: np.ndarray, outputs: int = 1, defines: str = ""
) -> list[np.ndarray]:
    """Run GLSL on every row of float32 arrays.

    includes : files of shaders/include whose functions `body` calls
    body : statements that read vec4 in0, in1, ... and write vec4 out0, out1, ...
    inputs : (N, k) each, k <= 4
    Returns what was written, a float32 (N, 4) for each of the outputs.
    """
    count = len(inputs[0])
    height = -(-count // _WIDTH)
    source = f"#version 330 core\n{defines}" + "".join(shader_source(f"include/{name}") for name in includes)
    source += "".join(f"uniform sampler2D values{i};\n" for i in range(len(inputs)))
    source += "".join(f"layout(location = {i}) out vec4 out{i};\n" for i in range(outputs))
    fetch = "".join(f"vec4 in{i} = texelFetch(values{i}, ivec2(gl_FragCoord.xy), 0);\n" for i in range(len(inputs)))
    program = ctx.program(
        f"#version 330 core\n{shader_source('fullscreen.vert')}", f"{source}void main() {{\n{fetch}{body}\n}}"
    )
    Uniforms(program).set({"plane": 0.0} | {f"values{i}": i for i in range(len(inputs))})
    held: list[moderngl.Texture | moderngl.Framebuffer] = []
    for i, values in enumerate(inputs):
        texels = np.zeros((height * _WIDTH, 4), np.float32)
        texels[:count, : values.shape[1]] = values
        held.append(ctx.texture((_WIDTH, height), 4, texels, dtype="f4"))
        held[i].use(i)
    targets = [ctx.texture((_WIDTH, height), 4, dtype="f4") for _ in range(outputs)]
    framebuffer = ctx.framebuffer(targets)
    framebuffer.use()
    ctx.enable_only(moderngl.NOTHING)
    array = ctx.vertex_array(program, [])
    array.render(moderngl.TRIANGLES, 3)
    results = [np.frombuffer(target.read(), np.float32).reshape(-1, 4)[:count] for target in targets]
    ctx.detect_framebuffer(0).use()
    for each in (*held, framebuffer, *targets, array, program):
        each.release()
    return results


def hierarchy_of(
    splats: np.ndarray | None = None, triangles: Triangles | None = None, radius: float = 1.0
) -> Hierarchy:
    """Return a hierarchy that holds these splats, SPLAT (N,), and these leaf triangles, and no nodes at all."""
    splats = np.zeros(0, SPLAT) if splats is None else splats
    leaves = triangles or Surfels(splats["centre"].copy(), splats["normal"].copy(), splats["radius"].copy(), None)
    return Hierarchy(
        name="by hand",
        origin=np.zeros(3),
        nodes=np.zeros(0, np.dtype([("x", "f4")])),
        splats=splats,
        spreads=np.zeros((0, 6), np.uint16),
        colors=None,
        leaves=leaves,
        closed=False,
        radius=radius,
        half_extents=np.full(3, radius),
    )


def splats_of(
    centres: np.ndarray, normals: np.ndarray, radii: object, thickness: object = 0.0, boxes: object = WHOLE
) -> np.ndarray:
    """Return SPLAT (N,) of centres and normals (N, 3); the normals are scaled to unit length where they have one."""
    normals = np.asarray(normals, np.float64)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    splats = np.zeros(len(normals), SPLAT)
    splats["centre"], splats["radius"], splats["thickness"] = centres, radii, thickness
    splats["normal"] = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0.0)
    splats["box"] = boxes
    return splats


def cut_of(hierarchy: Hierarchy, silhouette: int = 0) -> Cut:
    """Return the cut that draws all splats and all leaf triangles of a hierarchy."""
    leaves = hierarchy.leaves
    indices = leaves.indices.astype(np.uint32) if isinstance(leaves, Triangles) else np.empty((0, 3), np.uint32)
    count = len(hierarchy.splats)
    return Cut(np.arange(count, dtype=np.uint32), indices, silhouette, 0, 0)


class Stage:
    """Draws with the renderer's own buffers and uniforms, but other programs."""

    def __init__(self, ctx: moderngl.Context, renderer: Renderer, hierarchy: Hierarchy, view: View, cut: Cut) -> None:
        self.ctx, self.view, self.cut = ctx, view, cut
        renderer.set_hierarchy(hierarchy)
        self.cut_buffers = renderer._cut_buffers
        self.cut_buffers.upload(cut, records_of(hierarchy, cut.splats), None, None)
        self.uniforms = pass_uniforms(cut, view, Settings(), self.cut_buffers, None)

    def corners(self, *, visibility: bool) -> tuple[np.ndarray, np.ndarray]:
        """Return the clip coordinates (N, 4, 4) and the disc coordinates (N, 4, 2) of the splats' corners."""
        header = self._header(visibility=visibility, sprite=False)
        program = self.ctx.program(header + shader_source("splat.vert"), varyings=("gl_Position", "v_disc"))
        Uniforms(program).set(self.uniforms)
        count = len(self.cut.splats)
        captured = self.ctx.buffer(reserve=count * 4 * 6 * 4)
        array = self.ctx.vertex_array(program, [])
        # Nothing is drawn, but OpenGL wants a whole framebuffer all the same.
        framebuffer = self.ctx.simple_framebuffer((1, 1))
        framebuffer.use()
        array.transform(captured, moderngl.POINTS, 4 * count)
        self.ctx.detect_framebuffer(0).use()
        values = np.frombuffer(captured.read(), np.float32).reshape(count, 4, 6)
        for each in (array, captured, framebuffer, program):
            each.release()
        return values[..., :4], values[..., 4:]

    def _header(self, *, visibility: bool, sprite: bool) -> str:
        parallel = self.view.is_parallel
        variant = Variant(False, sprite, color=False, depth=False, tint=False, parallel=parallel)
        defines = variant.visibility_defines
        if not visibility:
            del defines["VISIBILITY"]
        return "#version 330 core\n" + "".join(f"#define {name} {value}\n" for name, value in defines.items())

    def disc_points(self, *, sprite: bool) -> np.ndarray:
        """Return what disc_point() gives: (H, W, 4), the point in the disc's frame, the distance along the axis, and
        1 + the index of the splat, 0 where none is; row 0 at the top. The discs must not overlap on the screen."""
        header = self._header(visibility=False, sprite=sprite)
        index = "gl_VertexID" if sprite else "gl_VertexID >> 2"
        vertex = shader_source("splat.vert").replace(
            "void main()\n{", f"flat out int v_index;\nvoid main()\n{{\n    v_index = {index};", 1
        )
        includes = ("project.glsl", "axis_distance.glsl", "disc_point.glsl")
        fragment = "".join(shader_source(f"include/{name}") for name in includes) + (
            "flat in int v_index;\nlayout(location = 0) out vec4 result;\nvoid main()\n{\n"
            "    DiscPoint point = disc_point();\n    if (dot(point.at, point.at) > 1.0) discard;\n"
            "    result = vec4(point.at, point.distance, 1.0 + float(v_index));\n}\n"
        )
        program = self.ctx.program(header + vertex, header + fragment)
        Uniforms(program).set(self.uniforms)
        size = (self.view.width, self.view.height)
        target = self.ctx.texture(size, 4, dtype="f4")
        framebuffer = self.ctx.framebuffer([target])
        framebuffer.use()
        framebuffer.clear()
        self.ctx.enable_only(moderngl.PROGRAM_POINT_SIZE)
        array = self.cut_buffers.splat_array(program, sprite=sprite)
        count = len(self.cut.splats)
        if sprite:
            array.render(moderngl.POINTS, count)
        else:
            array.render(moderngl.TRIANGLES, len(TRIANGLES_OF_CORNERS) * count)
        self.ctx.enable_only(moderngl.NOTHING)
        result = np.frombuffer(target.read(), np.float32).reshape(size[1], size[0], 4)[::-1].copy()
        self.ctx.detect_framebuffer(0).use()
        for each in (array, framebuffer, target, program):
            each.release()
        return result


def framebuffer_of(ctx: moderngl.Context, view: View) -> moderngl.Framebuffer:
    return ctx.simple_framebuffer((view.width, view.height))
