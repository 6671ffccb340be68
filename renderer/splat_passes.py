"""The visibility and the attribute pass: the cut's splats and leaf triangles, drawn twice.

Based on: Botsch et al., "High-Quality Surface Splatting on Today's GPUs", 2005, sections 4-5.
"""

from __future__ import annotations

from dataclasses import dataclass

import moderngl

from hierarchy.kernel import SHARPNESS, SMALLEST
from hierarchy.lod import Cut
from hierarchy.view import View
from renderer.cut_buffers import ROW_BITS, TRIANGLES_OF_CORNERS, CutBuffers
from renderer.leaf_buffers import LeafBuffers
from renderer.programs import Uniforms, make_program
from renderer.settings import Settings
from renderer.targets import Targets
from renderer.tile_pages import TilePages

# How far the visibility pass pushes a disc back, as shares of its thickness and of its radius. Neighbours that stand
# for the same surface differ by their thicknesses; the share of the radius is for the noise of single surfels. Igea's
# mean error is 0.45, 0.43 and 0.43 degrees at 1, 2 and 3 thicknesses; thin sheets are safer with less.
EPSILON = (2.0, 0.2)
# How far a silhouette disc sinks, as a share of its thickness. The outline of many overlapping discs is that of the
# most prominent ones, so discs at the mean height of the surface make it grow. Igea's grows by 0.10, 0.06, 0.02 and
# -0.04 pixels at 0.4, 0.5, 0.6 and 3/4; from 0.6 on it gets holes.
SINK = 0.5
# Pixels by which every disc that is not on the silhouette is widened, tile and all. Discs of different heights part by
# less than that in most places where a view from the side would open a crack between them: without, 6 hole pixels a
# view are left on the meteoroid at r_inner 24.
GROW = 0.25
# The share of its weight that a primitive keeps which faces away from the eye. Where the two sides of a thin sheet lie
# within epsilon of each other, normals that add up alike would cancel; so the side that faces the eye decides, and
# where there is none the other is all there is.
FACING_AWAY = 1.0 / 1024.0
# By how much a splat's rectangle exceeds what lies below it, in pixels and as a share of its thickness: neighbours
# share an edge, and lie at different heights.
MARGIN = (0.5, 0.5)


@dataclass(frozen=True)
class Variant:
    """Which shaders a frame needs.

    normal_mapping : fragments look up the tiles
    sprite : splats are point sprites
    color : the model has colours
    depth : distances are summed, too
    tint : overlays are summed, too
    parallel : the view rays are
    """

    normal_mapping: bool
    sprite: bool
    color: bool
    depth: bool
    tint: bool
    parallel: bool

    def defines(self, targets: Targets) -> dict[str, str | int | float]:
        """Return the macros of the attribute pass."""
        macros: dict[str, str | int | float] = {
            "ROW_BITS": ROW_BITS,
            "SHARPNESS": f"{SHARPNESS:.9g}",
            "FACING_AWAY": f"{FACING_AWAY:.9g}",
        }
        if self.normal_mapping:
            macros["NORMAL_MAPPING"] = 1
        if self.sprite:
            macros["SPRITE"] = 1
        if self.parallel:
            macros["PARALLEL"] = 1
        for name in ("color", "depth", "tint"):
            if name in targets.sums:
                macros[name.upper()] = targets.location(name)
        return macros

    @property
    def visibility_defines(self) -> dict[str, str | int | float]:
        """The macros of the visibility pass."""
        macros: dict[str, str | int | float] = {"ROW_BITS": ROW_BITS, "VISIBILITY": 1}
        if self.sprite:
            macros["SPRITE"] = 1
        if self.parallel:
            macros["PARALLEL"] = 1
        return macros


class SplatPass:
    """One of the two passes: a program for splats, one for leaf triangles, and their vertex arrays."""

    def __init__(
        self,
        ctx: moderngl.Context,
        kind: str,
        defines: dict[str, str | int | float],
        leaves: LeafBuffers,
        cut: CutBuffers,
    ) -> None:
        """kind : "visibility" or "attributes"."""
        self._ctx = ctx
        self.splats = make_program(ctx, "splat.vert", f"splat_{kind}.frag", defines)
        self.triangles = make_program(ctx, "triangle.vert", f"triangle_{kind}.frag", defines)
        self._splat_uniforms, self._triangle_uniforms = Uniforms(self.splats), Uniforms(self.triangles)
        self._sprite = "SPRITE" in defines
        self._splat_array = cut.splat_array(self.splats, sprite=self._sprite)
        used = [vertices for vertices in leaves.vertices if vertices[2] in self.triangles]
        self._triangle_array = ctx.vertex_array(self.triangles, used, index_buffer=cut.indices) if used else None

    def render(self, cut: Cut, uniforms: dict[str, object]) -> None:
        """Draw the cut with the framebuffer and the state that are current."""
        if len(cut.splats):
            self._splat_uniforms.set(uniforms)
            if self._sprite:
                self._ctx.enable(moderngl.PROGRAM_POINT_SIZE)
                self._splat_array.render(moderngl.POINTS, len(cut.splats))
                self._ctx.disable(moderngl.PROGRAM_POINT_SIZE)
            else:
                self._splat_array.render(moderngl.TRIANGLES, len(TRIANGLES_OF_CORNERS) * len(cut.splats))
        if len(cut.indices) and self._triangle_array is not None:
            self._triangle_uniforms.set(uniforms)
            self._triangle_array.render(moderngl.TRIANGLES, cut.indices.size)

    def release(self) -> None:
        self._splat_array.release()
        if self._triangle_array is not None:
            self._triangle_array.release()
        self.splats.release()
        self.triangles.release()


# Texture units of what the passes read.
RECORDS_UNIT, NORMALS_UNIT, TILE_COLORS_UNIT = 0, 1, 2


def pass_uniforms(
    cut: Cut, view: View, settings: Settings, buffers: CutBuffers, tiles: TilePages | None
) -> dict[str, object]:
    """Bind the textures of a cut and of its tiles, and return the uniforms of both passes.

    buffers : the cut has been uploaded to them
    """
    buffers.records.use(RECORDS_UNIT)
    uniforms: dict[str, object] = {
        "eye_from_model": tuple(view.eye_from_model.T.ravel()),
        "clip_from_eye": tuple(view.clip_from_eye.T.ravel()),
        "clip_from_model": tuple((view.clip_from_eye @ view.eye_from_model).T.ravel()),
        "clip_planes": (view.near, view.far),
        "splat_records": RECORDS_UNIT,
        "silhouette_splats": cut.silhouette_splats,
        "silhouette_triangles": cut.silhouette_triangles,
        "epsilon": EPSILON,
        "sink": SINK,
        "grow": GROW,
        "smallest": SMALLEST,
        "margin": MARGIN,
        "picture_size": (float(view.width), float(view.height)),
        "focal": view.focal_pixels,
        "show_silhouette": settings.silhouette_overlay,
        "show_outlines": settings.splat_outlines,
        "show_lod": settings.lod_colors,
    }
    if tiles is not None:
        tiles.normals.use(NORMALS_UNIT)
        uniforms |= {"tile_normals": NORMALS_UNIT, "tile_texels": tiles.texels}
        if tiles.colors is not None:
            tiles.colors.use(TILE_COLORS_UNIT)
            uniforms["tile_colors"] = TILE_COLORS_UNIT
    return uniforms


def draw_visibility(
    ctx: moderngl.Context, targets: Targets, visibility: SplatPass, cut: Cut, uniforms: dict[str, object]
) -> None:
    """Fill the depth buffer, which is clear, with the nearest surface, pushed back by epsilon along the view rays."""
    targets.visibility.use()
    targets.visibility.depth_mask = True
    ctx.enable_only(moderngl.DEPTH_TEST)
    ctx.depth_func = "<="
    visibility.render(cut, uniforms)


def draw_attributes(
    ctx: moderngl.Context, targets: Targets, attributes: SplatPass, cut: Cut, uniforms: dict[str, object]
) -> None:
    """Add up the attributes of everything that lies before the visible depth; the sums are zero before."""
    targets.attributes.use()
    targets.attributes.depth_mask = False
    ctx.enable_only(moderngl.DEPTH_TEST | moderngl.BLEND)
    ctx.depth_func = "<="
    ctx.blend_equation = moderngl.FUNC_ADD, moderngl.FUNC_ADD
    ctx.blend_func = moderngl.ONE, moderngl.ONE
    attributes.render(cut, uniforms)
    targets.attributes.depth_mask = True


def draw_nearest(
    ctx: moderngl.Context, targets: Targets, attributes: SplatPass, cut: Cut, uniforms: dict[str, object]
) -> None:
    """Write the attributes of the nearest splat or triangle alone, without blending: one pass instead of two.

    The sums are zero and the depth buffer is clear before.
    """
    targets.attributes.use()
    targets.attributes.depth_mask = True
    ctx.enable_only(moderngl.DEPTH_TEST)
    ctx.depth_func = "<"
    attributes.render(cut, uniforms)
