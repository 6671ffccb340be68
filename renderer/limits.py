"""What an OpenGL context can hold and do: asked of it once, or less of it as a test or the user wants."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np

from renderer.allocation import GpuError

_VERTEX = """#version 330 core
void main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0); }
"""
# 1, for floats of both widths that the sums have: twice 1 is 2 where they blend.
_BLENDING = """#version 330 core
layout(location = 0) out vec4 half_float;
layout(location = 1) out vec4 full_float;
void main() { half_float = full_float = vec4(1.0); }
"""
# What lies half way between two texels.
_FILTERING = """#version 330 core
uniform sampler2D bytes;
layout(location = 0) out vec4 filtered;
void main() { filtered = texture(bytes, vec2(0.5)); }
"""


@dataclass(frozen=True)
class Limits:
    """What is not to be exceeded.

    texture_size : texels along a side of a texture; 4096 or more wherever there is OpenGL 3.3
    array_layers : layers of an array texture, at least 256
    picture_size : width and height of the largest picture that is drawn in one piece
    float_blending : sums of floats add up; without, the nearest splat alone is shown
    tile_bytes : that the normal tiles may take, None: what tile_pages.py takes
    fine_filter : what is filtered between bytes is more than bytes; Mesa's llvmpipe rounds it, which bends the normals
        of tiles by up to a degree, but not what is filtered between numbers of 16 bits
    """

    texture_size: int
    array_layers: int
    picture_size: tuple[int, int]
    float_blending: bool = True
    tile_bytes: int | None = None
    fine_filter: bool = True

    def check_picture(self, size: tuple[int, int]) -> None:
        """Raise GpuError where a picture of a width and a height is larger than can be drawn."""
        if size[0] > self.picture_size[0] or size[1] > self.picture_size[1]:
            raise GpuError("{} x {} pixels are too many: {} x {} can be drawn".format(*size, *self.picture_size))


def probe_limits(ctx: moderngl.Context, tile_bytes: int | None = None) -> Limits:
    """Ask a context for its limits.

    tile_bytes : as in `Limits`
    """
    info = ctx.info
    texture_size = int(info["GL_MAX_TEXTURE_SIZE"])
    side = min(texture_size, int(info["GL_MAX_RENDERBUFFER_SIZE"]))
    width, height = info["GL_MAX_VIEWPORT_DIMS"]
    return Limits(
        texture_size,
        int(info["GL_MAX_ARRAY_TEXTURE_LAYERS"]),
        (min(side, int(width)), min(side, int(height))),
        blends_floats(ctx),
        tile_bytes,
        filters_finely(ctx),
    )


def blends_floats(ctx: moderngl.Context) -> bool:
    """Tell whether floats of 16 and 32 bits can be drawn into and add up, by trying."""
    sums = _drawn_twice(ctx, _BLENDING, {4: "f2", 2: "f4"})
    return len(sums) > 0 and all((each == 2.0).all() for each in sums)


def filters_finely(ctx: moderngl.Context) -> bool:
    """Tell whether what is filtered half way between two bytes lies between them, by trying."""
    texture = ctx.texture((2, 1), 1, bytes([0, 1]), alignment=1)
    texture.filter = moderngl.LINEAR, moderngl.LINEAR
    texture.use(0)
    sums = _drawn_twice(ctx, _FILTERING, {4: "f4"})
    texture.release()
    # Where floats cannot be drawn into there is nothing to tell it by.
    return len(sums) == 0 or bool(abs(255.0 * sums[0][0] - 1.0) < 0.1)


def _drawn_twice(ctx: moderngl.Context, fragment: str, kinds: dict[int, str]) -> list[np.ndarray]:
    """Draw a pixel twice into cleared textures that add up; return the sums, none where that cannot be drawn into.

    kinds : components and dtype of each texture
    """
    textures = [ctx.texture((1, 1), components, dtype=dtype) for components, dtype in kinds.items()]
    try:
        framebuffer = ctx.framebuffer(textures)
    except moderngl.Error:
        for texture in textures:
            texture.release()
        return []
    # A context that nothing was drawn in knows of no framebuffer.
    bound = ctx.fbo or ctx.detect_framebuffer(0)
    program = ctx.program(_VERTEX, fragment)
    array = ctx.vertex_array(program, [])
    framebuffer.use()
    framebuffer.clear()
    ctx.enable_only(moderngl.BLEND)
    ctx.blend_equation = moderngl.FUNC_ADD, moderngl.FUNC_ADD
    ctx.blend_func = moderngl.ONE, moderngl.ONE
    for _ in range(2):
        array.render(moderngl.TRIANGLES, 3)
    sums = [np.frombuffer(texture.read(), dtype) for texture, dtype in zip(textures, kinds.values(), strict=True)]
    ctx.enable_only(moderngl.NOTHING)
    ctx.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
    bound.use()
    for texture in textures:
        texture.release()
    framebuffer.release()
    array.release()
    program.release()
    return sums
