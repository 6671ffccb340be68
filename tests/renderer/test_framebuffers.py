"""The renderer draws the same picture into any framebuffer of any size, after whatever others did to the context."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator

import moderngl
import numpy as np
import pytest

from hierarchy.hierarchy import Hierarchy
from hierarchy.lod import select_cut
from hierarchy.normal_tiles import NormalTiles
from hierarchy.view import View, look_at
from renderer.context import ContextError, create_headless_context, is_software
from renderer.frame import Frame
from renderer.renderer import Renderer
from renderer.settings import Settings
from renderer.timers import StageTimers

Scene = tuple[Hierarchy, NormalTiles]
SIZE = (61, 47)

FOREIGN_VERTEX = """
#version 330 core
in vec3 in_position;
void main() { gl_Position = vec4(in_position, 1.0); }
"""
FOREIGN_FRAGMENT = """
#version 330 core
out vec4 out_color;
void main() { out_color = vec4(0.9, 0.5, 0.1, 0.4); }
"""


def view_of(hierarchy: Hierarchy, size: tuple[int, int] = SIZE) -> View:
    return look_at((1, 2, 3), (0, 0, 0), (0, 1, 0), 0.8, size, bounds=hierarchy.bounds)


def read(framebuffer: moderngl.Framebuffer) -> np.ndarray:
    width, height = framebuffer.size
    return np.frombuffer(framebuffer.read(components=4, alignment=1), np.uint8).reshape(height, width, 4)[::-1].copy()


@pytest.fixture
def loaded(renderer: Renderer, meteoroid: Scene) -> Renderer:
    renderer.set_hierarchy(meteoroid[0])
    renderer.set_tiles(meteoroid[1])
    return renderer


DrawInto = Callable[..., np.ndarray]


@pytest.fixture
def draw_into(loaded: Renderer, meteoroid: Scene) -> DrawInto:
    """draw_into(framebuffer) draws the meteoroid in the framebuffer's size and returns the picture."""

    def draw(framebuffer: moderngl.Framebuffer, **settings: object) -> np.ndarray:
        view = view_of(meteoroid[0], framebuffer.size)
        cut = select_cut(meteoroid[0], view, 2.0, 16.0)
        loaded.draw(cut, view, Settings(**settings), framebuffer)  # type: ignore[arg-type]
        return read(framebuffer)

    return draw


@pytest.fixture
def expected(ctx: moderngl.Context, draw_into: DrawInto) -> np.ndarray:
    """The picture in a context that nobody has touched."""
    return draw_into(ctx.simple_framebuffer(SIZE))


def color_only(ctx: moderngl.Context) -> moderngl.Framebuffer:
    return ctx.framebuffer([ctx.texture(SIZE, 4)])


def float_color(ctx: moderngl.Context) -> moderngl.Framebuffer:
    return ctx.framebuffer([ctx.renderbuffer(SIZE, 4, dtype="f2")], ctx.depth_renderbuffer(SIZE))


def three_components(ctx: moderngl.Context) -> moderngl.Framebuffer:
    return ctx.framebuffer([ctx.texture(SIZE, 3)], ctx.depth_texture(SIZE))


def with_viewport_and_scissor(ctx: moderngl.Context) -> moderngl.Framebuffer:
    framebuffer = ctx.simple_framebuffer(SIZE)
    framebuffer.viewport, framebuffer.scissor = (5, 7, 20, 20), (30, 2, 8, 8)
    return framebuffer


def without_depth_mask(ctx: moderngl.Context) -> moderngl.Framebuffer:
    framebuffer = ctx.simple_framebuffer(SIZE)
    framebuffer.depth_mask = False
    return framebuffer


@pytest.mark.parametrize(
    "make", [color_only, float_color, three_components, with_viewport_and_scissor, without_depth_mask]
)
def test_any_framebuffer(
    ctx: moderngl.Context,
    draw_into: DrawInto,
    expected: np.ndarray,
    make: Callable[[moderngl.Context], moderngl.Framebuffer],
) -> None:
    framebuffer = make(ctx)
    viewport, scissor, depth_mask = framebuffer.viewport, framebuffer.scissor, framebuffer.depth_mask
    assert np.array_equal(draw_into(framebuffer), expected)
    assert (framebuffer.viewport, framebuffer.scissor, framebuffer.depth_mask) == (viewport, scissor, depth_mask)
    assert ctx.fbo.glo == framebuffer.glo


def test_a_framebuffer_with_many_samples(
    ctx: moderngl.Context, loaded: Renderer, expected: np.ndarray, meteoroid: Scene
) -> None:
    if ctx.max_samples < 4:
        pytest.skip(f"this OpenGL has {ctx.max_samples} samples at most")
    many, one = ctx.simple_framebuffer(SIZE, samples=4), ctx.simple_framebuffer(SIZE)
    view = view_of(meteoroid[0])
    loaded.draw(select_cut(meteoroid[0], view, 2.0, 16.0), view, Settings(), many)
    # Only a copy can be read.
    ctx.copy_framebuffer(one, many)
    assert np.array_equal(read(one), expected)


@pytest.mark.parametrize("size", [(1, 1), (1, 400), (400, 1), (3, 2), (255, 129), (1025, 3)])
def test_any_size(loaded: Renderer, ctx: moderngl.Context, draw_into: DrawInto, size: tuple[int, int]) -> None:
    picture = draw_into(ctx.simple_framebuffer(size))
    frame = loaded.read_arrays()
    assert np.array_equal(frame.color, picture)
    assert frame.normal.shape == (size[1], size[0], 3)
    # The model is in the middle.
    assert frame.coverage[size[1] // 2, size[0] // 2] == 1.0
    assert (picture[..., 3] == 255).all()


def test_a_new_size_leaves_nothing_of_the_old(ctx: moderngl.Context, draw_into: DrawInto, expected: np.ndarray) -> None:
    for size in ((400, 300), (20, 90), SIZE):
        picture = draw_into(ctx.simple_framebuffer(size))
    assert np.array_equal(picture, expected)


@pytest.fixture
def foreign(ctx: moderngl.Context) -> Iterator[Callable[[moderngl.Framebuffer], np.ndarray]]:
    """Draws a translucent triangle as someone would who relies on the defaults of moderngl."""
    program = ctx.program(FOREIGN_VERTEX, FOREIGN_FRAGMENT)
    corners = np.array([[-1, -1, 0], [1, -1, 0.2], [0, 1, 0.4]], np.float32)
    array = ctx.vertex_array(program, [(ctx.buffer(corners), "3f", "in_position")])

    def draw(framebuffer: moderngl.Framebuffer) -> np.ndarray:
        framebuffer.use()
        framebuffer.clear(0.1, 0.2, 0.3, 1.0)
        ctx.enable_only(moderngl.BLEND | moderngl.DEPTH_TEST)
        array.render(moderngl.TRIANGLES)
        array.render(moderngl.TRIANGLES)
        return read(framebuffer)

    yield draw
    array.release()


def blend_and_cull(ctx: moderngl.Context) -> None:
    ctx.enable_only(moderngl.BLEND | moderngl.CULL_FACE | moderngl.PROGRAM_POINT_SIZE)
    ctx.cull_face = "front_and_back"
    ctx.blend_func = moderngl.ZERO, moderngl.SRC_COLOR
    ctx.blend_equation = moderngl.FUNC_REVERSE_SUBTRACT, moderngl.MAX
    ctx.depth_func = "!="


def scissor_the_bound(ctx: moderngl.Context) -> None:
    framebuffer = ctx.simple_framebuffer((16, 16))
    framebuffer.use()
    framebuffer.depth_mask = False
    ctx.scissor = (0, 0, 3, 3)
    ctx.viewport = (2, 2, 4, 4)


def lines_and_offset(ctx: moderngl.Context) -> None:
    ctx.wireframe = True
    ctx.polygon_offset = 3.0, 1000.0
    ctx.front_face = "cw"


def samplers(ctx: moderngl.Context) -> None:
    nearest = ctx.sampler(filter=(moderngl.NEAREST, moderngl.NEAREST), compare_func="<=")
    for unit in range(8):
        nearest.use(unit)
        ctx.texture((1, 1), 4, b"\xff\x00\xff\xff").use(unit)


@pytest.mark.parametrize("disturb", [blend_and_cull, scissor_the_bound, lines_and_offset, samplers])
def test_what_others_left_does_not_matter(
    ctx: moderngl.Context,
    draw_into: DrawInto,
    expected: np.ndarray,
    foreign: Callable[[moderngl.Framebuffer], np.ndarray],
    loaded: Renderer,
    disturb: Callable[[moderngl.Context], None],
) -> None:
    frame = dataclasses.astuple(loaded.read_arrays())
    foreign(ctx.simple_framebuffer((30, 20)))
    try:
        disturb(ctx)
        assert np.array_equal(draw_into(ctx.simple_framebuffer(SIZE)), expected)
        disturb(ctx)
        again: Frame = loaded.read_arrays()
    finally:
        ctx.wireframe, ctx.polygon_offset, ctx.front_face = False, (0.0, 0.0), "ccw"
        ctx.cull_face = "back"
        ctx.blend_equation = moderngl.FUNC_ADD, moderngl.FUNC_ADD
        ctx.clear_samplers(0, 8)
    assert all(np.array_equal(a, b) for a, b in zip(frame, dataclasses.astuple(again), strict=True))


def test_it_leaves_nothing_that_others_would_see(
    ctx: moderngl.Context, draw_into: DrawInto, foreign: Callable[[moderngl.Framebuffer], np.ndarray], loaded: Renderer
) -> None:
    ctx.blend_func, ctx.depth_func = moderngl.DEFAULT_BLENDING, "<="
    before = foreign(ctx.simple_framebuffer((30, 20)))
    # Blended: the background shows through, and equal depths pass.
    assert len(np.unique(before.reshape(-1, 4), axis=0)) == 2
    draw_into(ctx.simple_framebuffer(SIZE), ground=True, splat_outlines=True)
    assert np.array_equal(foreign(ctx.simple_framebuffer((30, 20))), before)
    loaded.read_arrays()
    assert np.array_equal(foreign(ctx.simple_framebuffer((30, 20))), before)


def test_two_renderers_share_a_context(
    ctx: moderngl.Context, draw_into: DrawInto, expected: np.ndarray, meteoroid: Scene
) -> None:
    other = Renderer(ctx)
    other.set_hierarchy(meteoroid[0])
    view = view_of(meteoroid[0], (30, 30))
    framebuffer = ctx.simple_framebuffer((30, 30))
    other.draw(select_cut(meteoroid[0], view, 1.0, 4.0), view, Settings(material="jade"), framebuffer)
    assert np.array_equal(draw_into(ctx.simple_framebuffer(SIZE)), expected)
    other.release()
    assert np.array_equal(draw_into(ctx.simple_framebuffer(SIZE)), expected)


def test_no_opengl_is_one_line_with_advice(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(**_: object) -> None:
        raise Exception("cannot\n  open libEGL.so")

    monkeypatch.setattr("moderngl.create_context", fail)
    monkeypatch.setattr("sys.platform", "linux")
    with pytest.raises(ContextError) as caught:
        create_headless_context()
    message = str(caught.value)
    assert message == "no OpenGL 3.3 without a window: cannot open libEGL.so; on Debian: apt install libegl1 libgl1"
    monkeypatch.setattr("sys.platform", "darwin")
    with pytest.raises(ContextError, match=r"cannot open libEGL\.so$"):
        create_headless_context()


def test_timers_measure_what_is_between(ctx: moderngl.Context, monkeypatch: pytest.MonkeyPatch) -> None:
    if not is_software(ctx):
        pytest.skip("only the wall clock can be set")
    clock = iter([1.0, 1.25, 2.0, 2.002])
    monkeypatch.setattr("time.perf_counter", lambda: next(clock))
    timers = StageTimers(ctx)
    for _ in range(2):
        with timers.stage("resolve"):
            pass
    assert timers.milliseconds == {"resolve": pytest.approx(2.0)}
