"""What a frame tells OpenGL: the corners of its splats, and of the uniforms those that have changed."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest

from hierarchy.hierarchy import SPLAT
from hierarchy.lod import Cut
from renderer.cut_buffers import CORNERS, TRIANGLES_OF_CORNERS, CutBuffers
from renderer.limits import Limits
from renderer.programs import Uniforms

LIMITS = Limits(texture_size=4096, array_layers=256, picture_size=(4096, 4096))

VERTEX = """
#version 330 core
in vec4 in_color;
flat out int v_splat;
flat out int v_corner;
void main()
{
    ivec4 bytes = ivec4(255.0 * in_color + 0.5);
    v_splat = bytes.x | bytes.y << 8 | bytes.z << 16 | bytes.w << 24;
    v_corner = gl_VertexID & 3;
    gl_Position = vec4(0.0);
}
"""


def cut_of(splats):
    return Cut(np.asarray(splats, np.uint32), np.empty((0, 3), np.uint32), 0, 0, 0)


def drawn(ctx, buffers, program, count):
    """Return the splat and the corner of every vertex that drawing so many splats takes."""
    array = buffers.splat_array(program, sprite=False)
    vertices = count * len(TRIANGLES_OF_CORNERS)
    captured = ctx.buffer(reserve=8 * vertices)
    framebuffer = ctx.simple_framebuffer((1, 1))
    framebuffer.use()
    array.transform(captured, moderngl.TRIANGLES, vertices)
    values = np.frombuffer(captured.read(), np.int32).reshape(-1, 2)
    ctx.detect_framebuffer(0).use()
    for each in (array, captured, framebuffer):
        each.release()
    return values


@pytest.mark.parametrize("counts", [(1,), (3, 2, 5), (7, 3000, 4, 5000)])
def test_every_splat_is_drawn_as_two_triangles_of_its_corners(ctx, counts):
    program = ctx.program(VERTEX, varyings=("v_splat", "v_corner"))
    buffers = CutBuffers(ctx, LIMITS)
    try:
        for count in counts:
            numbers = 1000 + 3 * np.arange(count)
            # The colour of a splat is its number.
            colors = np.arange(numbers[-1] + 1, dtype=np.uint32).view(np.uint8).reshape(-1, 4)
            buffers.upload(cut_of(numbers), np.zeros(count, SPLAT), colors, None)
            splats, corners = drawn(ctx, buffers, program, count).T
            np.testing.assert_array_equal(splats, np.repeat(numbers, len(TRIANGLES_OF_CORNERS)))
            np.testing.assert_array_equal(corners, np.tile(TRIANGLES_OF_CORNERS, count))
            assert buffers.nbytes >= (SPLAT.itemsize + 4 * CORNERS) * count
    finally:
        buffers.release()
        program.release()


def test_uniforms_are_told_what_they_do_not_hold(ctx):
    program = ctx.program(
        "#version 330 core\nuniform vec2 at; uniform int number;\n"
        "void main() { gl_Position = vec4(at, float(number), 1.0); }"
    )
    uniforms = Uniforms(program)
    uniforms.set({"at": (1.0, 2.0), "number": 3, "unknown": 4})
    assert program["at"].value == (1.0, 2.0)
    assert program["number"].value == 3
    # Behind its back, to see what it tells again.
    program["at"].value = (7.0, 7.0)
    uniforms.set({"at": (1.0, 2.0), "number": 4})
    assert program["at"].value == (7.0, 7.0)
    assert program["number"].value == 4
    uniforms.set({"at": (5.0, 2.0)})
    assert program["at"].value == (5.0, 2.0)
    assert program["number"].value == 4
    program.release()
