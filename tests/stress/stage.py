"""Where stress tests draw: a renderer of their own, and what is wrong with what it drew."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np

from hierarchy.hierarchy import Hierarchy
from hierarchy.lod import Cut, select_cut
from hierarchy.normal_tiles import NormalTiles
from hierarchy.view import View
from renderer.frame import Frame
from renderer.renderer import Renderer
from renderer.settings import Settings


class Stage:
    """Draws hierarchies; keeps what is on the GPU as long as the next picture needs it again."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self.ctx = ctx
        self.renderer = Renderer(ctx)
        self._shown: tuple[Hierarchy | None, NormalTiles | None] = (None, None)
        self._framebuffer: moderngl.Framebuffer | None = None

    def draw(
        self,
        hierarchy: Hierarchy,
        tiles: NormalTiles | None,
        view: View,
        settings: Settings,
        radii: tuple[float, float],
    ) -> tuple[Frame, Cut]:
        """Select and draw, and return the frame and its cut; numpy's floating-point errors raise in the selection."""
        with np.errstate(all="raise"):
            cut = select_cut(hierarchy, view, *radii, two_sided=settings.two_sided)
        if self._shown[0] is not hierarchy:
            self.renderer.set_hierarchy(hierarchy)
            self._shown = hierarchy, None
        if self._shown[1] is not tiles:
            self.renderer.set_tiles(tiles)
            self._shown = hierarchy, tiles
        self.renderer.draw(cut, view, settings, self._target((view.width, view.height)))
        frame = self.renderer.read_arrays()
        assert self.ctx.error == "GL_NO_ERROR"
        return frame, cut

    def _target(self, size: tuple[int, int]) -> moderngl.Framebuffer:
        if self._framebuffer is None or self._framebuffer.size != size:
            if self._framebuffer is not None:
                # moderngl binds the last framebuffer again after it read another one.
                self.ctx.detect_framebuffer(0).use()
                self._framebuffer.release()
            self._framebuffer = self.ctx.simple_framebuffer(size)
        return self._framebuffer

    def release(self) -> None:
        self.renderer.release()
        self.ctx.detect_framebuffer(0).use()
        if self._framebuffer is not None:
            self._framebuffer.release()


def faults_of_frame(frame: Frame, view: View) -> Sequence[str]:
    """Return what is wrong with the numbers of a frame, whatever it shows.

    Depths are negative behind the eye, where parallel rays show the model, too.
    """
    covered = frame.coverage > 0.0
    lengths = np.linalg.norm(frame.normal.astype(np.float64), axis=-1)
    checks = {
        "a coverage is not in 0..1": not ((frame.coverage >= 0.0) & (frame.coverage <= 1.0)).all(),
        "a normal is not finite": not np.isfinite(frame.normal).all(),
        "a normal is not unit": bool((np.abs(lengths[covered] - 1.0) > 1e-3).any()),
        "a normal where nothing is drawn": bool((lengths[~covered] > 0.0).any()),
        "a depth is not finite": not np.isfinite(frame.depth[covered]).all(),
        "a depth is not positive": bool((frame.depth[covered] <= 0.0).any()) and not view.is_parallel,
        "a depth where nothing is drawn": not np.isinf(frame.depth[~covered]).all(),
        "the picture is not opaque": bool((frame.color[..., 3] != 255).any()),
    }
    return [sentence for sentence, wrong in checks.items() if wrong]


def same_frame(a: Frame, b: Frame) -> bool:
    """Tell whether two frames are the same to the last bit."""
    pairs = ((a.normal, b.normal), (a.depth, b.depth), (a.coverage, b.coverage), (a.color, b.color))
    return all(first.tobytes() == second.tobytes() for first, second in pairs)
