"""The baseline: the same mesh as plain indexed triangles, shaded per pixel in one pass.

What a viewer without a hierarchy would do. Its lighting costs what the surfel renderer's resolve costs a pixel:
Blinn-Phong of a headlight and a key light on the normalised interpolated normal (Blinn 1977).
"""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass

import moderngl
import numpy as np

from hierarchy.model import Float32Array, Mesh
from hierarchy.view import View

VERTEX_SHADER = """
#version 330 core
// In: model-space position and normal. Out: both in eye space, and the normal as it was.
uniform mat4 u_eye_from_model;
uniform mat4 u_clip_from_eye;
in vec3 in_position;
in vec3 in_normal;
out vec3 v_eye_position;
out vec3 v_eye_normal;
out vec3 v_model_normal;
void main() {
    vec4 eye_position = u_eye_from_model * vec4(in_position, 1.0);
    v_eye_position = eye_position.xyz;
    v_eye_normal = mat3(u_eye_from_model) * in_normal;
    v_model_normal = in_normal;
    gl_Position = u_clip_from_eye * eye_position;
}
"""

SHADED_FRAGMENT_SHADER = """
#version 330 core
// Blinn-Phong of a headlight and a key light, both without attenuation, on both sides of the surface.
in vec3 v_eye_position;
in vec3 v_eye_normal;
out vec4 out_color;
const vec3 KEY_DIRECTION = vec3(-0.48, 0.64, 0.6);
const vec3 ALBEDO = vec3(0.8);
vec3 blinn_phong(vec3 n, vec3 to_eye, vec3 to_light, vec3 light) {
    vec3 halfway = normalize(to_eye + to_light);
    return light * (ALBEDO * max(dot(n, to_light), 0.0) + 0.2 * pow(max(dot(n, halfway), 0.0), 40.0));
}
void main() {
    vec3 to_eye = normalize(-v_eye_position);
    vec3 n = normalize(v_eye_normal);
    n = dot(n, to_eye) < 0.0 ? -n : n;
    vec3 radiance = 0.05 * ALBEDO;
    radiance += blinn_phong(n, to_eye, to_eye, vec3(0.55));
    radiance += blinn_phong(n, to_eye, KEY_DIRECTION, vec3(0.45));
    out_color = vec4(radiance, 1.0);
}
"""

ARRAYS_FRAGMENT_SHADER = """
#version 330 core
// The unit model-space normal and the distance along the view axis.
in vec3 v_eye_position;
in vec3 v_model_normal;
out vec4 out_normal_depth;
void main() {
    out_normal_depth = vec4(normalize(v_model_normal), -v_eye_position.z);
}
"""


@dataclass(frozen=True, eq=False)
class TrianglePicture:
    """What the triangles show at the pixels' centres; row 0 at the top.

    normal : float32 (H, W, 3), unit interpolated vertex normal, model space; zero where nothing is drawn
    depth : float32 (H, W), distance along the view axis; inf where nothing is drawn
    coverage : float32 (H, W), 0 or 1
    """

    normal: Float32Array
    depth: Float32Array
    coverage: Float32Array


class TriangleBaseline:
    """A mesh on the GPU, drawn as indexed triangles in file order into a target of the view's size."""

    def __init__(self, ctx: moderngl.Context, mesh: Mesh, *, cull_back_faces: bool = False) -> None:
        """Upload `mesh`: one vertex buffer of positions and normals (24 bytes a vertex), one index buffer.

        cull_back_faces : leave out triangles seen from behind; right for closed meshes only
        """
        self._ctx = ctx
        self._flags = moderngl.DEPTH_TEST | (moderngl.CULL_FACE if cull_back_faces else 0)
        vertices = np.concatenate([mesh.positions, mesh.normals], axis=1).astype(np.float32)
        self._vertices = ctx.buffer(np.ascontiguousarray(vertices))
        self._indices = ctx.buffer(np.ascontiguousarray(mesh.faces, np.int32))
        self._shaded = self._vertex_array(SHADED_FRAGMENT_SHADER)
        self._arrays = self._vertex_array(ARRAYS_FRAGMENT_SHADER)
        self._target: moderngl.Framebuffer | None = None

    def _vertex_array(self, fragment_shader: str) -> moderngl.VertexArray:
        """Compile a program and bind the buffers to those attributes that it uses."""
        program = self._ctx.program(vertex_shader=VERTEX_SHADER, fragment_shader=fragment_shader)
        return self._ctx.vertex_array(program, [(self._vertices, "3f 3f", "in_position", "in_normal")], self._indices)

    def draw(self, view: View) -> None:
        """Draw the shaded picture into the baseline's own RGBA8 target with a 24-bit depth buffer."""
        size = (view.width, view.height)
        if self._target is None or self._target.size != size:
            if self._target is not None:
                self._release_framebuffer(self._target)
            self._target = self._ctx.framebuffer([self._ctx.renderbuffer(size, 4)], self._ctx.depth_renderbuffer(size))
        self._render(self._shaded, self._target, view)

    def color(self) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
        """Return the last picture drawn, uint8 (H, W, 4), row 0 at the top.

        Raises RuntimeError before the first `draw`.
        """
        if self._target is None:
            raise RuntimeError("nothing has been drawn yet")
        width, height = self._target.size
        pixels = np.frombuffer(self._target.read(components=4), np.uint8)
        return pixels.reshape(height, width, 4)[::-1].copy()

    def arrays(self, view: View) -> TrianglePicture:
        """Draw normals and depths instead of shades, and read them back."""
        size = (view.width, view.height)
        target = self._ctx.framebuffer(
            [self._ctx.renderbuffer(size, 4, dtype="f4")], self._ctx.depth_renderbuffer(size)
        )
        try:
            self._render(self._arrays, target, view)
            pixels = np.frombuffer(target.read(components=4, dtype="f4"), np.float32)
        finally:
            self._release_framebuffer(target)
        pixels = pixels.reshape(view.height, view.width, 4)[::-1]
        drawn = pixels[..., 3] > 0.0
        depth = np.where(drawn, pixels[..., 3], np.float32(np.inf))
        return TrianglePicture(pixels[..., :3].copy(), depth.astype(np.float32), drawn.astype(np.float32))

    def _render(self, vertex_array: moderngl.VertexArray, target: moderngl.Framebuffer, view: View) -> None:
        """Set all the state that the pass depends on, clear and draw."""
        program = vertex_array.program
        for name, matrix in (("u_eye_from_model", view.eye_from_model), ("u_clip_from_eye", view.clip_from_eye)):
            uniform = program[name]
            assert isinstance(uniform, moderngl.Uniform)
            # GLSL wants columns one after the other.
            uniform.write(np.ascontiguousarray(matrix.T, np.float32).tobytes())
        target.use()
        target.viewport = (0, 0, view.width, view.height)
        target.depth_mask = True
        self._ctx.enable_only(self._flags)
        self._ctx.depth_func = "<"
        self._ctx.front_face = "ccw"
        self._ctx.cull_face = "back"
        target.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
        vertex_array.render(moderngl.TRIANGLES)

    def median_ms(self, view: View, frames: int = 15, warm_up: int = 3) -> float:
        """Return the median milliseconds of a frame, from the first call to the GPU to its last pixel.

        frames : measured, after `warm_up` that are not
        Raises ValueError where frames < 1.
        """
        if frames < 1:
            raise ValueError("a median needs at least one frame")
        times = []
        for frame in range(-warm_up, frames):
            start = time.perf_counter()
            self.draw(view)
            self._ctx.finish()
            if frame >= 0:
                times.append(1e3 * (time.perf_counter() - start))
        return statistics.median(times)

    def _release_framebuffer(self, framebuffer: moderngl.Framebuffer) -> None:
        """Release a framebuffer together with its attachments."""
        # moderngl binds the framebuffer used last again after it has read another one: that must not be a released one.
        self._ctx.detect_framebuffer(0).use()
        attachments = [*framebuffer.color_attachments, framebuffer.depth_attachment]
        framebuffer.release()
        for attachment in attachments:
            attachment.release()

    def release(self) -> None:
        """Give everything on the GPU back."""
        if self._target is not None:
            self._release_framebuffer(self._target)
            self._target = None
        for vertex_array in (self._shaded, self._arrays):
            program = vertex_array.program
            vertex_array.release()
            program.release()
        self._vertices.release()
        self._indices.release()
