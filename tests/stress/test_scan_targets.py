"""The scan sees what it is for, and nothing in a frame of an ordinary model."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest
from scan_targets import scan_targets
from small_models import bumpy_sphere

from hierarchy.build import build_hierarchy
from hierarchy.lod import select_cut
from hierarchy.view import look_at
from renderer import programs as renderer_programs
from renderer.renderer import Renderer
from renderer.settings import Settings


def draw(ctx: moderngl.Context, renderer: Renderer, **settings: object) -> list[str]:
    hierarchy = build_hierarchy(bumpy_sphere(3))
    renderer.set_hierarchy(hierarchy)
    view = look_at((1, 2, 3), (0, 0, 0), (0, 1, 0), 0.7, (48, 40), bounds=hierarchy.bounds)
    framebuffer = ctx.simple_framebuffer((48, 40))
    cut = select_cut(hierarchy, view, 0.5, 0.5)
    assert cut.triangle_count > 50
    renderer.draw(cut, view, Settings(**settings), framebuffer)  # type: ignore[arg-type]
    before = framebuffer.read()
    wrong = scan_targets(renderer)
    assert framebuffer.read() == before
    ctx.detect_framebuffer(0).use()
    framebuffer.release()
    return wrong


@pytest.mark.parametrize("settings", [{}, {"splat_outlines": True, "ground": True}, {"blending": False}], ids=str)
def test_a_scan_finds_nothing_in_an_ordinary_frame(
    ctx: moderngl.Context, renderer: Renderer, settings: dict[str, object]
) -> None:
    assert draw(ctx, renderer, **settings) == []


def test_a_scan_finds_sums_that_are_not_numbers(
    ctx: moderngl.Context, renderer: Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = renderer_programs.shader_source

    def broken(name: str) -> str:
        return read(name).replace("sum_normal = vec4(norm", "weight *= sqrt(-weight); sum_normal = vec4(norm")

    monkeypatch.setattr(renderer_programs, "shader_source", broken)
    wrong = [line.split(":")[0] for line in draw(ctx, renderer)]
    assert wrong[:2] == ["sum of normal", "sum of weights"]


def test_a_scan_finds_colours_that_are_not_numbers(ctx: moderngl.Context, renderer: Renderer) -> None:
    wrong = draw(ctx, renderer, background_top=(np.nan, 0.0, 0.0))
    assert [line.split(":")[0] for line in wrong] == ["picture"]


def test_a_scan_needs_a_frame(renderer: Renderer) -> None:
    with pytest.raises(RuntimeError, match="draw comes before"):
        scan_targets(renderer)
