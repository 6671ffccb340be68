"""The splatting renderer: a hierarchy's cut, drawn into any framebuffer, or read as arrays."""

from __future__ import annotations

from dataclasses import replace

import moderngl
import numpy as np

from hierarchy.drawn_rows import records_of
from hierarchy.hierarchy import Hierarchy
from hierarchy.lod import Cut
from hierarchy.normal_tiles import NormalTiles
from hierarchy.spans import reached_spans
from hierarchy.view import View
from renderer.allocation import GpuError
from renderer.cut_buffers import CutBuffers
from renderer.frame import Frame
from renderer.leaf_buffers import LeafBuffers
from renderer.limits import Limits, probe_limits
from renderer.resolve_passes import CRACK_REACH, MARKED, MATCAP_UNIT, Resolve
from renderer.settings import Settings
from renderer.splat_passes import (
    SplatPass,
    Variant,
    draw_attributes,
    draw_nearest,
    draw_visibility,
    pass_uniforms,
)
from renderer.targets import Targets
from renderer.tile_pages import TilePages
from renderer.timers import StageTimers


class Renderer:
    """Draws cuts of one hierarchy at a time: visibility, attributes, resolve (Botsch et al. 2005)."""

    def __init__(self, ctx: moderngl.Context, limits: Limits | None = None) -> None:
        """Ask the context for its limits, unless they are given.

        ctx : OpenGL 3.3 core or later; the renderer leaves it current and owns nothing else of it
        """
        self._ctx = ctx
        self.limits = limits or probe_limits(ctx)
        self._timers = StageTimers(ctx)
        self._cut_buffers = CutBuffers(ctx, self.limits)
        self._hierarchy: Hierarchy | None = None
        self._leaf_buffers: LeafBuffers | None = None
        self._tiles: TilePages | None = None
        self._targets: Targets | None = None
        self._passes: dict[tuple[str, Variant], SplatPass] = {}
        self._resolve = Resolve(ctx)
        self._ground_heights: dict[tuple[float, float, float], float] = {}
        self._last: tuple[Cut, View, Settings, moderngl.Framebuffer] | None = None

    # What is drawn

    def set_hierarchy(self, hierarchy: Hierarchy) -> None:
        """Bring a hierarchy to the GPU in place of the last one, whose tiles go with it.

        Raises GpuError where it does not fit; the last one is then still there.
        """
        leaf_buffers = LeafBuffers(self._ctx, hierarchy.leaves)
        self.set_tiles(None)
        self._release_passes()
        if self._leaf_buffers is not None:
            self._leaf_buffers.release()
        self._hierarchy, self._leaf_buffers = hierarchy, leaf_buffers
        self._ground_heights.clear()

    def make_pages(self, texels: int) -> TilePages:
        """Make room for tiles of the hierarchy that are baked one after the other; the caller's until `set_tiles`.

        texels : w_s, LAYER_WIDTH (tile_places.py) at most

        Raises RuntimeError where no hierarchy was set, GpuError where there is no memory, ValueError for a larger w_s.
        """
        return self._make_pages(texels)

    def _make_pages(self, texels: int, most: int | None = None) -> TilePages:
        if self._hierarchy is None:
            raise RuntimeError("tiles come after set_hierarchy")
        colored = self._hierarchy.colors is not None
        return TilePages(self._ctx, self.limits, texels, self._hierarchy.node_count, colored=colored, most=most)

    def set_tiles(self, tiles: NormalTiles | TilePages | None) -> None:
        """Draw with the tiles of pages from now on, or with tiles that all have one size; None: there are none yet.

        Raises GpuError where they do not fit, ValueError where they are wider than LAYER_WIDTH (tile_places.py); the
        last ones are then still there.
        """
        pages = self._pages_of(tiles) if isinstance(tiles, NormalTiles) else tiles
        if self._tiles is not None and self._tiles is not pages:
            self._tiles.release()
        self._tiles = pages
        self._last = None

    def _pages_of(self, tiles: NormalTiles) -> TilePages:
        pages = self._make_pages(tiles.texels, tiles.count)
        if not pages.add(tiles.as_fitted()):
            pages.release()
            raise GpuError("there is no room for the normal tiles; choose a smaller w_s")
        return pages

    # Drawing

    def draw(self, cut: Cut, view: View, settings: Settings, framebuffer: moderngl.Framebuffer) -> None:
        """Draw a cut of the hierarchy into a framebuffer of the view's size, and leave that bound.

        Its viewport, scissor and depth do not matter and stay as they are; it has one colour attachment.
        Where floats do not blend the nearest splat alone shows, as without `settings.blending`.
        Raises RuntimeError where no hierarchy was set, GpuError where there is no memory for the frame.
        """
        if self._hierarchy is None:
            raise RuntimeError("set_hierarchy comes before draw")
        self._last = None
        settings = settings if self.limits.float_blending else replace(settings, blending=False)
        try:
            self._draw(cut, view, settings, framebuffer)
        except BaseException:
            # What was interrupted half-way may have any state; moderngl binds anew what was bound before, which must
            # not be one that is gone.
            self._leave(framebuffer)
            self._release_targets()
            raise
        self._last = (cut, view, settings, framebuffer)

    def _draw(self, cut: Cut, view: View, settings: Settings, framebuffer: moderngl.Framebuffer) -> None:
        assert self._hierarchy is not None
        tint = settings.silhouette_overlay or settings.splat_outlines or settings.lod_colors
        variant = self._variant(settings, view, depth=False, tint=tint)
        targets = self._targets_for(view, variant)
        self._enter()
        with self._timers.stage("visibility"):
            # A software renderer erases while this core prepares what comes next.
            self._resolve.erase(targets)
            records, uniforms = self._upload(cut, view, settings)
            if settings.blending:
                draw_visibility(self._ctx, targets, self._pass("visibility", variant, targets), cut, uniforms)
        with self._timers.stage("attributes"):
            draw = draw_attributes if settings.blending else draw_nearest
            draw(self._ctx, targets, self._pass("attributes", variant, targets), cut, uniforms)
            targets.drawn = spans = reached_spans(records, self._hierarchy.leaves, cut.indices, view, CRACK_REACH)
        with self._timers.stage("resolve"):
            # Looking for it takes a tenth of a second where there are millions of vertices.
            ground = self._ground(settings.ground_up) if settings.ground else (0.0, self._hierarchy.bounds[1])
            has_colors = self._hierarchy.colors is not None
            self._resolve.shade(targets, view, settings, has_colors=has_colors, ground=ground, spans=spans)
            self._ctx.copy_framebuffer(framebuffer, targets.picture_only)
            self._leave(framebuffer)

    def read_arrays(self) -> Frame:
        """Return the frame that was drawn last as arrays; its framebuffer must still hold the picture.

        Raises RuntimeError where nothing was drawn since the hierarchy or its tiles were set, GpuError where there is
        no memory for the arrays.
        """
        if self._last is None:
            raise RuntimeError("draw comes before read_arrays")
        cut, view, settings, framebuffer = self._last
        targets = self._make_targets(view, color=False, depth=True)
        variant = self._variant(settings, view, depth=True, tint=False)
        try:
            self._enter()
            targets.clear()
            _, uniforms = self._upload(cut, view, settings)
            if settings.blending:
                draw_visibility(self._ctx, targets, self._pass("visibility", variant, targets), cut, uniforms)
            draw = draw_attributes if settings.blending else draw_nearest
            draw(self._ctx, targets, self._pass("attributes", variant, targets), cut, uniforms)
            eye_normal, depth = self._resolve.arrays(targets)
        finally:
            self._leave(framebuffer)
            targets.release()
        pixels = np.frombuffer(framebuffer.read(components=4), np.uint8).reshape(view.height, view.width, 4)
        coverage = np.ascontiguousarray(eye_normal[..., 3])
        # Row vectors: n R is R^T n, from eye to model axes.
        normal = eye_normal[..., :3] @ view.eye_from_model[:3, :3].astype(np.float32)
        return Frame(
            normal=normal,
            depth=np.where(coverage > 0.0, depth + np.float32(view.depth_of_eye), np.float32(np.inf)),
            coverage=coverage,
            color=pixels[::-1].copy(),
        )

    def depth_at(self, column: int, row: int) -> float:
        """Return the distance along the view axis of what was drawn last at a pixel, counted from the top left.

        inf where nothing is drawn there. Off by the epsilon of the visibility pass, a fraction of a splat.
        """
        if self._last is None or self._targets is None:
            return float("inf")
        view = self._last[1]
        depths = np.frombuffer(self._targets.visible_depth.read(), np.float32).reshape(view.height, view.width)
        value = float(depths[view.height - 1 - row, column])
        ndc = 2.0 * value - 1.0
        if ndc >= MARKED - 1e-7:
            return float("inf")
        return view.depth_of_ndc(ndc) + view.depth_of_eye

    # What it costs

    @property
    def timings(self) -> dict[str, float]:
        """Milliseconds of "visibility", "attributes" and "resolve" of the last frame.

        The first begins with erasing the frame before and bringing the cut, which is all of it without blending.
        """
        return self._timers.milliseconds

    @property
    def shortcomings(self) -> list[str]:
        """What the last frame lacks for want of memory or of what the graphics card can do, a line each."""
        lines = []
        if self._tiles is not None and self._tiles.untiled:
            lines.append(
                f"no room for the tiles of {self._tiles.untiled:,} splats, which are drawn with one normal each"
            )
        if not self.limits.float_blending:
            lines.append("this graphics card cannot add up floats: splats are not blended")
        return lines

    @property
    def gpu_bytes(self) -> int:
        """Bytes of buffers and textures on the GPU."""
        held = (self._leaf_buffers, self._tiles, self._targets, self._cut_buffers)
        return sum(each.nbytes for each in held if each is not None)

    def release(self) -> None:
        """Give back everything on the GPU."""
        self._release_passes()
        self._resolve.release()
        for each in (self._leaf_buffers, self._tiles, self._targets, self._cut_buffers):
            if each is not None:
                each.release()
        self._hierarchy = self._leaf_buffers = self._tiles = self._targets = self._last = None

    # What is kept from frame to frame

    def _upload(self, cut: Cut, view: View, settings: Settings) -> tuple[np.ndarray, dict[str, object]]:
        """Bring the cut to the GPU and bind it; return the records of its splats, and the uniforms of the passes."""
        assert self._hierarchy is not None
        assert self._leaf_buffers is not None
        records = records_of(self._hierarchy, cut.splats)
        self._leaf_buffers.bring(cut.indices)
        self._cut_buffers.upload(cut, records, self._hierarchy.colors, self._tiles)
        return records, pass_uniforms(cut, view, settings, self._cut_buffers, self._tiles)

    def _variant(self, settings: Settings, view: View, *, depth: bool, tint: bool) -> Variant:
        assert self._hierarchy is not None
        color = self._hierarchy.colors is not None and not depth
        return Variant(
            normal_mapping=settings.normal_mapping and self._tiles is not None,
            sprite=settings.splat == "sprite",
            color=color,
            depth=depth,
            tint=tint,
            parallel=view.is_parallel,
        )

    def _targets_for(self, view: View, variant: Variant) -> Targets:
        size, kind = (view.width, view.height), (variant.color, variant.depth, variant.tint)
        if self._targets is None or self._targets.size != size or self._targets.kind != kind:
            self._release_targets()
            self._targets = self._make_targets(view, *kind)
        return self._targets

    def _make_targets(self, view: View, color: bool, depth: bool, tint: bool = False) -> Targets:
        size = (view.width, view.height)
        self.limits.check_picture(size)
        return Targets(self._ctx, size, color=color, depth=depth, tint=tint)

    def _pass(self, kind: str, variant: Variant, targets: Targets) -> SplatPass:
        """Return the pass for a variant; of the visibility pass there is one for each kind of splat and projection."""
        assert self._leaf_buffers is not None
        if kind == "visibility":
            plain = Variant(False, variant.sprite, color=False, depth=False, tint=False, parallel=variant.parallel)
            variant = plain
        key = (kind, variant)
        if key not in self._passes:
            defines = variant.defines(targets) if kind == "attributes" else variant.visibility_defines
            self._passes[key] = SplatPass(self._ctx, kind, defines, self._leaf_buffers, self._cut_buffers)
        return self._passes[key]

    def _ground(self, up: tuple[float, float, float]) -> tuple[float, float]:
        """Return the height of the model's lowest point along `up`, model space, and the model's radius."""
        assert self._hierarchy is not None
        if up not in self._ground_heights:
            direction = np.asarray(up, np.float32) / np.linalg.norm(up)
            self._ground_heights[up] = float((self._hierarchy.leaves.positions @ direction).min())
        return self._ground_heights[up], self._hierarchy.bounds[1]

    def _enter(self) -> None:
        """Reset what the passes do not set themselves, whoever drew before."""
        self._ctx.wireframe = False
        self._ctx.front_face = "ccw"
        self._ctx.polygon_offset = 0.0, 0.0
        # A sampler object would override the filters of the textures.
        self._ctx.clear_samplers(0, MATCAP_UNIT + 1)

    def _leave(self, framebuffer: moderngl.Framebuffer) -> None:
        """Leave the caller's framebuffer bound, nothing enabled, and moderngl's own blending and depth functions."""
        framebuffer.use()
        self._ctx.enable_only(moderngl.NOTHING)
        self._ctx.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        self._ctx.depth_func = "<="

    def _release_targets(self) -> None:
        if self._targets is not None:
            self._targets.release()
            self._targets = None

    def _release_passes(self) -> None:
        for each in self._passes.values():
            each.release()
        self._passes.clear()
        self._last = None
