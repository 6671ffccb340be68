"""The part of the window that shows the model: draws a frame when there is a new one, keeps it otherwise."""

from __future__ import annotations

import time

import moderngl
import numpy as np
import numpy.typing as npt

from app.errors import GraphicsError, graphics_errors
from app.export import read_picture
from app.scene import Scene
from app.state import STAGES, FrameReport
from app.viewer import Viewer
from hierarchy.lod import select_cut
from renderer.renderer import Renderer


class Viewport:
    """Owns the renderer and the picture that it drew last.

    size : width and height of the picture in pixels
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._renderer = Renderer(ctx)
        self._target: moderngl.Framebuffer | None = None
        self._uploaded: Scene | None = None
        self._drawn: tuple[object, ...] | None = None
        self.size = (1, 1)

    @property
    def gpu_bytes(self) -> int:
        """Bytes that the renderer holds on the GPU."""
        return self._renderer.gpu_bytes

    def upload(self, scene: Scene) -> None:
        """Bring a scene to the GPU; raises GraphicsError where it does not fit, and keeps the last one then."""
        last = self._uploaded
        try:
            with graphics_errors():
                if last is None or last.hierarchy is not scene.hierarchy:
                    self._renderer.set_hierarchy(scene.hierarchy)
                self._renderer.set_tiles(scene.tiles)
        except GraphicsError:
            if last is not None:
                self._renderer.set_hierarchy(last.hierarchy)
                self._renderer.set_tiles(last.tiles)
            raise
        self._uploaded = scene

    def is_stale(self, viewer: Viewer) -> bool:
        """The picture is not the one that would be drawn now."""
        return viewer.scene is not None and self._drawn != self._wanted(viewer)

    def draw(self, viewer: Viewer) -> FrameReport:
        """Draw the scene of the viewer, which has to have one, and tell what it took."""
        assert viewer.scene is not None
        state, steering, target = viewer.state, viewer.steering, self._framebuffer()
        start = time.perf_counter()
        view = viewer.view(self.size)
        cut = select_cut(
            viewer.scene.hierarchy,
            view,
            steering.r_sil,
            steering.r_inner,
            two_sided=state.settings.two_sided,
            printed_cone_test=state.printed_cone_test,
        )
        selected = time.perf_counter()
        self._renderer.draw(cut, view, state.settings, target)
        self._ctx.finish()
        end = time.perf_counter()
        self._drawn = self._wanted(viewer)
        stages = {"select": 1e3 * (selected - start), **self._renderer.timings}
        first, second, third, fourth = (float(stages.get(stage, 0.0)) for stage in STAGES)
        return FrameReport(
            splats=int(cut.splat_count),
            triangles=int(cut.triangle_count),
            silhouette=int(cut.silhouette_count),
            visited=int(cut.visited_nodes),
            milliseconds=(first, second, third, fourth),
            total=1e3 * (end - start),
        )

    def show(self, screen: moderngl.Framebuffer) -> None:
        """Copy the picture into the lower left corner of the window's framebuffer."""
        if self._target is not None and self._drawn is not None:
            self._ctx.copy_framebuffer(screen, self._target)

    def picture(self) -> npt.NDArray[np.uint8] | None:
        """Return what was drawn last, uint8 (H, W, 4), row 0 at the top; None: nothing yet."""
        if self._target is None or self._drawn is None:
            return None
        return read_picture(self._target)

    def depth_at(self, x: float, y: float) -> float | None:
        """Return the depth of the surface at a pixel, counted from the top left, in the file's lengths; None: none."""
        if self._drawn is None or self._target is None:
            return None
        width, height = self._target.size
        column, row = int(x), int(y)
        if not (0 <= column < width and 0 <= row < height):
            return None
        depth = float(self._renderer.depth_at(column, row))
        assert self._uploaded is not None
        return self._uploaded.hierarchy.scale * depth if np.isfinite(depth) else None

    def release(self) -> None:
        """Give back what is held on the GPU."""
        self._renderer.release()
        self._release_target()

    def _wanted(self, viewer: Viewer) -> tuple[object, ...]:
        """Everything that the picture depends on; equal means that the picture is the same."""
        state, radii = viewer.state, (viewer.steering.r_sil, viewer.steering.r_inner)
        return (viewer.scene, viewer.camera, radii, state.printed_cone_test, state.settings, self.size)

    def _framebuffer(self) -> moderngl.Framebuffer:
        if self._target is None or self._target.size != self.size:
            self._release_target()
            # No depth: OpenGL refuses to copy it to a window whose depth has another format.
            self._target = self._ctx.framebuffer([self._ctx.renderbuffer(self.size, 4)])
        return self._target

    def _release_target(self) -> None:
        if self._target is not None:
            attachments = self._target.color_attachments
            self._target.release()
            for attachment in attachments:
                attachment.release()
            self._target = None
