"""The part of the window that shows the model: draws a frame when there is a new one, keeps it otherwise."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import moderngl
import numpy as np
import numpy.typing as npt

from app.cache import Cache
from app.errors import graphics_errors
from app.export import read_picture
from app.scene import Scene
from app.state import STAGES, FrameReport
from app.tile_cache import find_tiles
from app.tiling import Tiling
from app.viewer import Viewer
from hierarchy.inside import eye_is_inside
from hierarchy.lod import select_cut
from hierarchy.tile_shelf import ShownTiles
from renderer.allocation import GpuError
from renderer.limits import probe_limits
from renderer.renderer import Renderer
from renderer.targets import make_picture, release_picture


class Viewport:
    """Owns the renderer and the picture that it drew last.

    size : width and height of the picture in pixels
    """

    def __init__(
        self, ctx: moderngl.Context, wake: Callable[[], None], tile_bytes: int | None = None, cache: Cache | None = None
    ) -> None:
        """Start without a model.

        wake : called from the background when there is more to draw
        tile_bytes : most memory that the normal tiles may take on the GPU, None: what tile_pages.py takes
        cache : where tiles are looked for, None: nowhere
        """
        self._ctx = ctx
        self._renderer = Renderer(ctx, probe_limits(ctx, tile_bytes))
        self._tiling = Tiling(self._renderer, wake, self._find_tiles)
        self._cache = cache
        self._target: moderngl.Framebuffer | None = None
        self._uploaded: Scene | None = None
        # What the last picture was to show, also where it could not be drawn; it is not tried twice.
        self._tried: tuple[object, ...] | None = None
        self._drawn = False
        self._told: object = None
        self.size = (1, 1)

    @property
    def gpu_bytes(self) -> int:
        """Bytes that the renderer holds on the GPU."""
        return self._renderer.gpu_bytes

    def upload(self, scene: Scene) -> None:
        """Bring a scene to the GPU; raises GraphicsError where it does not fit, and keeps the last one then."""
        with graphics_errors():
            try:
                self._renderer.set_hierarchy(scene.hierarchy)
            except GpuError:
                # There may be room without the tiles of the last one, which are baked again otherwise.
                self._tiling.forget()
                self._renderer.set_hierarchy(scene.hierarchy)
            self._tiling.forget()
        self._uploaded = scene

    @property
    def is_baking(self) -> bool:
        """Tiles of the picture are being baked."""
        return self._tiling.busy

    def is_stale(self, viewer: Viewer) -> bool:
        """The picture is not the one that would be drawn now."""
        return viewer.scene is not None and (
            self._tried != self._wanted(viewer) or (self._drawn and self._tiling.has_news)
        )

    def draw(self, viewer: Viewer) -> FrameReport:
        """Draw the scene of the viewer, which has to have one, and tell what it took.

        Raises GraphicsError where the picture cannot be drawn; the last one then stays.
        """
        assert viewer.scene is not None
        self._tried, self._drawn = self._wanted(viewer), False
        with graphics_errors():
            target = self._framebuffer()
            try:
                report = self._draw(viewer, viewer.scene, target)
            except BaseException:
                if target is not self._target:
                    release_picture(target)
                raise
            self._keep(target)
            self._drawn = True
            return report

    def _draw(self, viewer: Viewer, scene: Scene, target: moderngl.Framebuffer) -> FrameReport:
        state, steering = viewer.state, viewer.steering
        start = time.perf_counter()
        view = viewer.view(self.size)
        settings = replace(state.settings, blending=steering.blends)
        if eye_is_inside(scene.hierarchy, view):
            # Where a closed surface shows nothing but its back.
            settings = replace(settings, two_sided=True)
        cut = select_cut(
            scene.hierarchy,
            view,
            steering.r_sil,
            steering.r_inner,
            two_sided=settings.two_sided,
            printed_cone_test=state.printed_cone_test,
        )
        selected = time.perf_counter()
        texels = steering.texels if settings.normal_mapping else 0
        missing = self._tiling.follow(scene.hierarchy, texels, cut, view)
        if self._tiling.trouble:
            state.say(self._tiling.trouble, is_error=True)
            self._tiling.trouble = ""
        self._renderer.draw(cut, view, settings, target)
        self._ctx.finish()
        end = time.perf_counter()
        stages = {"select": 1e3 * (selected - start), **self._renderer.timings}
        first, second, third, fourth = (float(stages.get(stage, 0.0)) for stage in STAGES)
        return FrameReport(
            splats=int(cut.splat_count),
            triangles=int(cut.triangle_count),
            silhouette=int(cut.silhouette_count),
            visited=int(cut.visited_nodes),
            milliseconds=(first, second, third, fourth),
            total=1e3 * (end - start),
            missing=missing,
            texels=self._tiling.texels if settings.normal_mapping else 0,
        )

    def show(self, screen: moderngl.Framebuffer) -> None:
        """Copy the picture into the lower left corner of the window's framebuffer."""
        if self._target is not None:
            self._ctx.copy_framebuffer(screen, self._target)

    def picture(self) -> npt.NDArray[np.uint8] | None:
        """Return what was drawn last, uint8 (H, W, 4), row 0 at the top; None: nothing yet."""
        if self._target is None:
            return None
        return read_picture(self._target)

    def depth_at(self, x: float, y: float) -> float | None:
        """Return the depth of the surface at a pixel, counted from the top left, in the file's lengths; None: none."""
        if self._target is None:
            return None
        width, height = self._target.size
        column, row = int(x), int(y)
        if not (0 <= column < width and 0 <= row < height):
            return None
        depth = float(self._renderer.depth_at(column, row))
        assert self._uploaded is not None
        return self._uploaded.hierarchy.scale * depth if np.isfinite(depth) else None

    def shortcoming(self, scene: Scene) -> str:
        """Say what the graphics card does not do for a scene that was drawn, once; "": nothing."""
        said = "; ".join(self._renderer.shortcomings)
        if self._told is scene or not said:
            return ""
        self._told = scene
        return said[:1].upper() + said[1:]

    def release(self) -> None:
        """Give back what is held on the GPU."""
        self._tiling.close()
        self._renderer.release()
        if self._target is not None:
            release_picture(self._target)
            self._target = None

    def take_unkept(self) -> ShownTiles | None:
        """Return the tiles of the last picture if they are for the cache, once; None: nothing is."""
        unkept, self._tiling.unkept = self._tiling.unkept, None
        return unkept

    def _find_tiles(self, texels: int) -> ShownTiles | None:
        assert self._uploaded is not None
        return find_tiles(self._cache, self._uploaded, texels)

    def _wanted(self, viewer: Viewer) -> tuple[object, ...]:
        """Everything that the picture depends on; equal means that the picture is the same."""
        state, steering = viewer.state, viewer.steering
        detail = (steering.r_sil, steering.r_inner, steering.texels, steering.blends)
        return (viewer.scene, viewer.camera, detail, state.printed_cone_test, state.settings, self.size)

    def _framebuffer(self) -> moderngl.Framebuffer:
        """Return what to draw into: where the size is another one, not what holds the last picture."""
        if self._target is not None and self._target.size == self.size:
            return self._target
        return make_picture(self._ctx, self._renderer.limits, self.size)

    def _keep(self, target: moderngl.Framebuffer) -> None:
        if self._target is not None and self._target is not target:
            release_picture(self._target)
        self._target = target
