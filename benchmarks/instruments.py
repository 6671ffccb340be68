"""The renderer with instruments: times of the whole frame without those of its stages, and the fragments it blends."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import moderngl

from renderer.renderer import Renderer
from renderer.splat_passes import draw_attributes, draw_nearest, draw_visibility
from renderer.timers import StageTimers


class InstrumentedRenderer(Renderer):
    """A renderer that can be watched more closely than a viewer needs."""

    def __init__(self, ctx: moderngl.Context) -> None:
        super().__init__(ctx)
        self._stage_timers = self._timers
        self._no_timers = _NoTimers(ctx)

    @contextmanager
    def without_stages(self) -> Iterator[None]:
        """Draw without timing the stages: on a software renderer that waits for each to finish."""
        self._timers = self._no_timers
        try:
            yield
        finally:
            self._timers = self._stage_timers

    def count_blended(self) -> int:
        """Return how many fragments the attribute pass of the last frame sums up, or writes where it does not blend.

        Draws it again. Raises RuntimeError where nothing was drawn.
        """
        if self._last is None:
            raise RuntimeError("draw comes before count_blended")
        cut, view, settings, framebuffer = self._last
        variant = self._variant(settings, view, depth=False, tint=False)
        targets = self._targets_for(view, variant)
        self._enter()
        targets.clear()
        _, uniforms = self._upload(cut, view, settings)
        if settings.blending:
            draw_visibility(self._ctx, targets, self._pass("visibility", variant, targets), cut, uniforms)
        draw = draw_attributes if settings.blending else draw_nearest
        query = self._ctx.query(samples=True)
        with query:
            draw(self._ctx, targets, self._pass("attributes", variant, targets), cut, uniforms)
        self._leave(framebuffer)
        return int(query.samples)


class _NoTimers(StageTimers):
    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time nothing."""
        yield
