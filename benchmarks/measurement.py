"""One setting of one view: what it costs and how far its picture is from the truth.

Times are taken in rounds, in each of which the setting and the plain triangles are drawn in turn, so that a machine
whose speed drifts slows both down alike. The first round, which compiles and uploads, is not counted. The frame's time
runs from the selection until the GPU has finished; the stages' times are of frames of their own.

"pixels_blended" counts the fragments that the attribute pass adds up; of triangles, those that were the nearest so far.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import moderngl

from app.errors import graphics_errors
from app.memory import peak_memory_mb
from benchmarks.instruments import InstrumentedRenderer
from benchmarks.methods import Method
from benchmarks.run_file import Json, Setting
from benchmarks.shading import PictureShader
from benchmarks.subject import Subject, nodes_of
from benchmarks.triangles import TriangleBaseline
from hierarchy.hierarchy import Hierarchy
from hierarchy.lod import Cut
from hierarchy.model import Float32Array, Mesh, UInt8Array
from hierarchy.normal_tiles import bake_tiles
from hierarchy.view import View
from renderer.cut_tiles import CutTiles
from renderer.settings import Settings

Rows = dict[str, list[float]]


@dataclass(frozen=True, eq=False)
class Picture:
    """What a setting shows, row 0 at the top; as in `Frame`, `color` without its alpha."""

    normal: Float32Array
    depth: Float32Array
    coverage: Float32Array
    color: UInt8Array


class Workbench:
    """A subject on the GPU: the renderer and the triangles beside each other in one context."""

    def __init__(
        self, ctx: moderngl.Context, subject: Subject, shader: PictureShader, resolution: tuple[int, int]
    ) -> None:
        """Bring nothing but the triangles to the GPU yet.

        shader : lights the triangles' normals as the viewer would
        resolution : width and height of the views in pixels
        """
        self.subject = subject
        self._shader = shader
        self._ctx = ctx
        self._renderer = InstrumentedRenderer(ctx)
        self._framebuffer = ctx.simple_framebuffer(resolution)
        self._triangles = {False: TriangleBaseline(ctx, subject.mesh)}
        self._hierarchy: Hierarchy | None = None

    def measure(self, method: Method, setting: Setting, view: View, rounds: int) -> tuple[Json, Picture]:
        """Return what a setting of a method costs, and its picture.

        Raises GraphicsError where the GPU refuses.
        """
        with graphics_errors():
            if method.select is None:
                return self._measure_triangles(method, view, rounds)
            return self._measure_splats(method, setting, view, rounds)

    def _measure_splats(self, method: Method, setting: Setting, view: View, rounds: int) -> tuple[Json, Picture]:
        select = method.select
        assert select is not None
        hierarchy = self.subject.hierarchy(points=method.points)
        cut = select(hierarchy, view, setting.r_sil, setting.r_inner)
        cut_tile_bytes = self._bring(method, setting, cut, view)
        settings = replace(method.settings, two_sided=not hierarchy.closed)

        def draw(rows: Rows) -> None:
            start = time.perf_counter()
            cut = select(hierarchy, view, setting.r_sil, setting.r_inner)
            selected = time.perf_counter()
            self._renderer.draw(cut, view, settings, self._framebuffer)
            self._ctx.finish()
            note(rows, "frame_ms", start)
            rows.setdefault("select_ms", []).append(1e3 * (selected - start))

        with self._renderer.without_stages():
            cost = self._rounds(draw, view, rounds)
        cost |= self._stages(cut, view, settings, max(1, rounds // 2))
        cost |= {
            "splats": cut.splat_count,
            "triangles": cut.triangle_count,
            "silhouette": cut.silhouette_count,
            "visited_nodes": cut.visited_nodes,
            "pixels_blended": self._renderer.count_blended(),
            "gpu_bytes": self._renderer.gpu_bytes,
            "tile_bytes": self.subject.tile_bytes(points=method.points, texels=setting.w_s, fitted=method.fitted),
            "cut_tile_bytes": cut_tile_bytes,
            "peak_memory_mb": peak_memory_mb(),
        }
        return cost, self._read()

    def draw(self, method: Method, setting: Setting, view: View) -> Picture:
        """Return the picture of a setting of a method that has a cut, with tiles of no more than what it draws.

        Raises GraphicsError where the GPU refuses.
        """
        select = method.select
        assert select is not None
        hierarchy = self.subject.hierarchy(points=method.points)
        cut = select(hierarchy, view, setting.r_sil, setting.r_inner)
        with graphics_errors():
            self._bring(method, setting, cut, view)
            settings = replace(method.settings, two_sided=not hierarchy.closed)
            self._renderer.draw(cut, view, settings, self._framebuffer)
            return self._read()

    def _read(self) -> Picture:
        """Return what was drawn last."""
        frame = self._renderer.read_arrays()
        return Picture(frame.normal, frame.depth, frame.coverage, frame.color[..., :3])

    def _measure_triangles(self, method: Method, view: View, rounds: int) -> tuple[Json, Picture]:
        baseline = self._baseline(cull=method.cull)

        def draw(rows: Rows) -> None:
            start = time.perf_counter()
            baseline.draw(view)
            self._ctx.finish()
            note(rows, "frame_ms", start)

        cost = self._rounds(draw, view, rounds)
        query = self._ctx.query(samples=True)
        with query:
            baseline.draw(view)
        cost |= {
            "splats": 0,
            "triangles": len(self.subject.mesh.faces),
            "pixels_blended": int(query.samples),
            "gpu_bytes": triangle_bytes(self.subject.mesh, view),
            "tile_bytes": 0,
            "cut_tile_bytes": 0,
            "peak_memory_mb": peak_memory_mb(),
        }
        shown = baseline.arrays(view)
        two_sided = not self.subject.mesh.closed
        color = self._shader.shade(shown.normal, shown.coverage, view, two_sided=two_sided)
        return cost, Picture(shown.normal, shown.depth, shown.coverage, color)

    def _rounds(self, draw: Callable[[Rows], None], view: View, rounds: int) -> Json:
        """Draw in turn with the plain triangles and return what the times are."""
        rows: Rows = {}
        baseline = self._baseline(cull=False)
        for _ in range(rounds + 1):
            draw(rows)
            start = time.perf_counter()
            baseline.draw(view)
            self._ctx.finish()
            note(rows, "triangles_ms", start)
        ratios = [frame / own for frame, own in zip(rows["frame_ms"], rows["triangles_ms"], strict=True)]
        times: Json = {name: figures(values[1:]) for name, values in rows.items()}
        return times | {"frame_over_triangles": statistics.median(ratios[1:])}

    def _stages(self, cut: Cut, view: View, settings: Settings, rounds: int) -> Json:
        """Return the times of the stages, of frames of their own: on a software renderer timing them takes time."""
        rows: Rows = {}
        for _ in range(rounds + 1):
            self._renderer.draw(cut, view, settings, self._framebuffer)
            self._ctx.finish()
            for stage, milliseconds in self._renderer.timings.items():
                rows.setdefault(f"{stage}_ms", []).append(milliseconds)
        return {name: figures(values[1:]) for name, values in rows.items()}

    def _baseline(self, *, cull: bool) -> TriangleBaseline:
        if cull not in self._triangles:
            self._triangles[cull] = TriangleBaseline(self._ctx, self.subject.mesh, cull_back_faces=cull)
        return self._triangles[cull]

    def _bring(self, method: Method, setting: Setting, cut: Cut, view: View) -> int:
        """Bring the hierarchy and the tiles that a setting draws to the GPU; return the bytes of the tiles."""
        hierarchy = self.subject.hierarchy(points=method.points)
        if self._hierarchy is not hierarchy:
            self._renderer.set_hierarchy(hierarchy)
            self._hierarchy = hierarchy
        if not setting.w_s:
            self._renderer.set_tiles(None)
            return 0
        if method.fitted:
            fitted = CutTiles(self._renderer, hierarchy, setting.w_s)
            fitted.bring(cut, view)
            return fitted.nbytes
        tiles = bake_tiles(hierarchy, setting.w_s, nodes=nodes_of(cut, hierarchy))
        self._renderer.set_tiles(tiles)
        return tiles.nbytes

    def release(self) -> None:
        """Give everything on the GPU back."""
        self._renderer.release()
        for baseline in self._triangles.values():
            baseline.release()
        self._ctx.detect_framebuffer(0).use()
        for attachment in (*self._framebuffer.color_attachments, self._framebuffer.depth_attachment):
            attachment.release()
        self._framebuffer.release()


def triangle_bytes(mesh: Mesh, view: View) -> int:
    """Return the bytes that the plain triangles take on the GPU: vertices, indices, colour and depth."""
    return 24 * len(mesh.positions) + 12 * len(mesh.faces) + 8 * view.width * view.height


def figures(milliseconds: list[float]) -> Json:
    """Return the median, the minimum and the distance between the quartiles of some times."""
    if len(milliseconds) < 2:
        return {"median": milliseconds[0], "min": milliseconds[0], "spread": 0.0}
    low, median, high = statistics.quantiles(milliseconds, n=4, method="inclusive")
    return {"median": median, "min": min(milliseconds), "spread": high - low}


def note(rows: Rows, name: str, start: float) -> None:
    """Add the milliseconds since `start` to a row."""
    rows.setdefault(name, []).append(1e3 * (time.perf_counter() - start))
