"""The shaded truth against the viewer's own resolve, and against means taken by hand."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import moderngl
import numpy as np
import pytest

from benchmarks import shading
from benchmarks.rays import RayCaster
from benchmarks.reference import cast
from benchmarks.shading import PictureShader, cast_with_picture, light_source
from hierarchy.model import BoolArray, Float32Array, Mesh, UInt8Array
from hierarchy.spans import STRIP
from hierarchy.view import look_at
from renderer.resolve_passes import Resolve
from renderer.settings import Settings
from renderer.targets import Targets

WIDTH, HEIGHT = 60, 44
VIEW = look_at((1, 2, 3), (0, 0, 0), (0, 1, 0), math.radians(40), (WIDTH, HEIGHT), bounds=((0, 0, 0), 2.0))


@pytest.fixture
def shader(ctx: moderngl.Context) -> Iterator[PictureShader]:
    made = PictureShader(ctx)
    yield made
    made.release()


def normals_all_round(seed: int = 1) -> tuple[Float32Array, BoolArray, Float32Array]:
    """Return unit normals in all directions, a mask and colours, in model space."""
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=(HEIGHT, WIDTH, 3))
    # Exact in floats of any width.
    normal = np.round(normal / np.linalg.norm(normal, axis=-1, keepdims=True) * 512.0) / 512.0
    # In blocks: the viewer would close what is as narrow as a crack.
    hit = np.kron(rng.random((6, 8)) < 0.7, np.ones((8, 8), np.bool_))[:HEIGHT, :WIDTH]
    color = np.round(rng.random((HEIGHT, WIDTH, 3)) * 255.0) / 255.0
    return normal.astype(np.float32), hit, color.astype(np.float32)


def resolved(
    ctx: moderngl.Context, eye_normal: Float32Array, hit: BoolArray, color: Float32Array | None, settings: Settings
) -> UInt8Array:
    """Let the viewer's resolve shade normals in eye space."""
    targets, resolve = Targets(ctx, (WIDTH, HEIGHT), color=color is not None), Resolve(ctx)

    def sums(values: Float32Array) -> bytes:
        return (
            np.where(hit[..., None], np.concatenate([values, np.ones_like(values[..., :1])], -1), 0.0)[::-1]
            .astype(np.float32)
            .tobytes()
        )

    targets.sums["normal"].write(sums(eye_normal))
    if color is not None:
        targets.sums["color"].write(sums(color))
    targets.visible_depth.write(np.where(hit[::-1], 0.5, 1.0).astype(np.float32).tobytes())
    spans = np.tile(np.array([0.0, WIDTH], np.float32), (-(-HEIGHT // STRIP), 1))
    resolve.shade(targets, VIEW, settings, has_colors=color is not None, ground=(0.0, 1.0), spans=spans)
    picture = np.frombuffer(targets.picture.read(components=3, alignment=1), np.uint8)
    ctx.detect_framebuffer(0).use()
    resolve.release()
    targets.release()
    return picture.reshape(HEIGHT, WIDTH, 3)[::-1]


@pytest.mark.parametrize("two_sided", [False, True])
@pytest.mark.parametrize("colored", [False, True])
def test_one_sample_is_what_the_viewer_shows(
    ctx: moderngl.Context, shader: PictureShader, two_sided: bool, colored: bool
) -> None:
    eye_normal, hit, color = normals_all_round()
    shown = resolved(ctx, eye_normal, hit, color if colored else None, Settings(two_sided=two_sided))
    normal = (eye_normal @ VIEW.eye_from_model[:3, :3]).astype(np.float32)
    shader.start(VIEW, two_sided=two_sided)
    shader.add(normal, hit, color if colored else None)
    picture = shader.picture()
    # What lies between two levels may be rounded the other way.
    difference = np.abs(picture.astype(int) - shown)
    assert difference.max() <= 1
    assert (difference == 0).mean() > 0.95
    assert np.ptp(picture[hit]) > 100
    if not colored:
        assert np.array_equal(shader.shade(normal, hit.astype(np.float32), VIEW, two_sided=two_sided), picture)


def level(linear: Float32Array) -> Float32Array:
    return 255.0 * np.clip(linear, 0.0, 1.0) ** (1.0 / 2.2)


def linear(levels: UInt8Array) -> Float32Array:
    return (levels / 255.0) ** 2.2


def test_samples_and_background_are_averaged_in_linear_light(shader: PictureShader) -> None:
    samples = [normals_all_round(seed)[:2] for seed in (1, 2, 3)]
    empty = np.zeros((HEIGHT, WIDTH), np.bool_)
    shader.start(VIEW)
    shader.add(samples[0][0], empty)
    background = shader.picture()
    each = []
    for normal, hit in samples:
        shader.start(VIEW)
        shader.add(normal, hit)
        each.append(shader.picture())
        assert np.array_equal(each[-1][~hit], background[~hit])
    shader.start(VIEW)
    for normal, hit in samples:
        shader.add(normal, hit)
    # Half a level of rounding in each of the four pictures, more where dark ones meet bright ones.
    assert np.abs(shader.picture() - level(np.mean([linear(one) for one in each], axis=0))).max() < 1.6


def test_background_is_the_viewer_s_gradient_with_its_top_at_row_zero(shader: PictureShader) -> None:
    normal = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    background = shader.shade(normal, np.zeros((HEIGHT, WIDTH), np.float32), VIEW)
    look = Settings()
    t = 1.0 - (np.arange(HEIGHT) + 0.5) / HEIGHT
    t = (t * t * (3.0 - 2.0 * t))[:, None]
    expected = 255.0 * ((1.0 - t) * np.array(look.background_bottom) + t * np.array(look.background_top))
    # Half a level of dither, half a level of rounding.
    assert np.abs(background - expected[:, None]).max() <= 1.01
    assert np.abs(background.mean(axis=1) - expected).max() <= 0.2


def test_the_same_samples_added_again_change_nothing(shader: PictureShader) -> None:
    normal, hit, _ = normals_all_round()
    once = shader.shade(normal, hit.astype(np.float32), VIEW)
    shader.start(VIEW)
    for _ in range(16):
        shader.add(normal, hit)
    assert np.array_equal(shader.picture(), once)


def test_the_size_follows_the_view(shader: PictureShader) -> None:
    for width, height in ((7, 5), (60, 44), (1, 1)):
        view = replace(VIEW, width=width, height=height)
        shape = (height, width)
        assert shader.shade(np.ones((*shape, 3), np.float32), np.ones(shape, np.float32), view).shape == (*shape, 3)


def test_what_comes_too_early_or_does_not_fit_is_refused(shader: PictureShader) -> None:
    normal, hit, color = normals_all_round()
    with pytest.raises(RuntimeError, match="start comes before add"):
        shader.add(normal, hit)
    shader.start(VIEW)
    with pytest.raises(RuntimeError, match="add come before picture"):
        shader.picture()
    for arguments in ((normal[1:], hit), (normal, hit[1:]), (normal, hit, color[1:])):
        with pytest.raises(ValueError, match="the view is"):
            shader.add(*arguments)


def test_a_shader_whose_output_has_changed_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    sources = {
        "include/output.glsl": "float noise(vec2 p);",
        "resolve_shade.frag": "float noise(vec2 p); void main() {}",
    }
    monkeypatch.setattr(shading, "shader_source", sources.__getitem__)
    with pytest.raises(RuntimeError, match="does not take dither"):
        light_source()


def test_reference_and_picture_come_from_the_same_rays(shader: PictureShader) -> None:
    pytest.importorskip("embreex", reason="embreex casts the reference rays")
    corners = np.array([(-0.6, -0.5, 0.0), (0.7, -0.4, 0.1), (0.1, 0.8, -0.2)], np.float32)
    normals = np.array([(0.6, 0.0, 0.8), (0.0, 0.6, 0.8), (0.0, -0.28, 0.96)], np.float32)
    mesh = Mesh("triangle", np.zeros(3), corners, np.array([[0, 1, 2]], np.int32), normals)
    caster = RayCaster(mesh)
    truth = cast_with_picture(caster, VIEW, shader, 3)
    plain = cast(caster, VIEW, 3)
    assert np.array_equal(truth.normal, plain.normal)
    assert np.array_equal(truth.coverage, plain.coverage)
    assert truth.picture is not None
    full, empty = truth.coverage == 1.0, truth.coverage == 0.0
    # The normals hardly change within a pixel: shading their mean gives the same, the outline excepted.
    shaded = shader.shade(truth.normal, truth.coverage, VIEW)
    assert np.abs(truth.picture[full].astype(int) - shaded[full]).max() <= 1
    assert np.array_equal(truth.picture[empty], shaded[empty])
    background = shader.shade(truth.normal, np.zeros_like(truth.coverage), VIEW)
    share = truth.coverage[..., None]
    mixed = level(share * linear(shaded) + (1.0 - share) * linear(background))
    assert np.abs(truth.picture - mixed).max() < 2.0
    assert ((truth.coverage > 0.0) & ~full).sum() > 20

    colored = replace(mesh, colors=np.full((3, 4), (255, 0, 0, 255), np.uint8))
    red = cast_with_picture(colored, VIEW, shader, 2).picture
    assert red is not None
    assert (red[full][:, 0] > red[full][:, 1] + 40).all()
