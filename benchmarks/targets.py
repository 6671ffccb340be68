"""Measure one view of one mesh in one run: error against ray casting, and times against plain triangles.

    python -m benchmarks.targets igea.ply --camera-position=0,0,0.165 --camera-focal-point=0,0,0

prints JSON. Times are medians; the splats and the baseline are drawn in turn, so that a machine whose speed drifts
slows both down alike, and `frame_over_triangles` is the median of the ratios.
"""

from __future__ import annotations

import json
import statistics
import sys
import time
from collections.abc import Callable
from typing import TypeVar

import moderngl

from app.framing import frame_scene, view_of_pose
from app.options import Options, parse_options
from app.scene import ModelSource, Scene, open_scene
from benchmarks.error import measure
from benchmarks.reference import cast
from benchmarks.triangles import TriangleBaseline
from hierarchy.build import build_hierarchy
from hierarchy.load import load_model
from hierarchy.lod import select_cut
from hierarchy.meteoroid import make_meteoroid
from hierarchy.model import Mesh
from hierarchy.normal_tiles import bake_tiles
from hierarchy.view import View
from renderer.context import create_headless_context
from renderer.renderer import Renderer
from renderer.settings import Settings

T = TypeVar("T")

# Of a reference pixel, along each axis.
SAMPLES = 3
# Rounds of which the medians are taken; the first, which compiles and uploads, is not counted.
ROUNDS = 15
BUILDS = 5


def main(arguments: list[str]) -> int:
    """Measure the mesh and the view that a command line of `surfelscope render` names, and print JSON."""
    options = parse_options(["render", "--json", *arguments])
    mesh = make_meteoroid() if options.model is None else load_model(options.model, texture=options.texture)
    if not isinstance(mesh, Mesh):
        print(f"{mesh.name}: a point cloud has no surface to compare with", file=sys.stderr)
        return 2
    scene = open_scene(ModelSource(options.model, options.texture, options.points), options.texels)
    resolution = options.resolution or (1024, 1024)
    view = view_of_pose(frame_scene(scene, options.camera, resolution), scene, resolution)
    report = {"model": mesh.name, "triangles_of_mesh": len(mesh.faces), "nodes": scene.hierarchy.node_count}
    print(json.dumps(report | _build_times(mesh, options) | _pictures(mesh, scene, view, options), indent=2))
    return 0


def _build_times(mesh: Mesh, options: Options) -> dict[str, float]:
    """Return warm times of building and baking."""
    hierarchy, _ = _timed(lambda: build_hierarchy(mesh, points=options.points))
    builds = [_timed(lambda: build_hierarchy(mesh, points=options.points))[1] for _ in range(BUILDS)]
    bakes = [_timed(lambda: bake_tiles(hierarchy, options.texels))[1] for _ in range(BUILDS)]
    return {"build_s": statistics.median(builds) / 1e3, "bake_s": statistics.median(bakes) / 1e3}


def _pictures(mesh: Mesh, scene: Scene, view: View, options: Options) -> dict[str, object]:
    """Draw the view with and without normal mapping and measure both, and time it against the baseline."""
    reference = cast(mesh, view, SAMPLES)
    ctx = create_headless_context()
    renderer = Renderer(ctx)
    renderer.set_hierarchy(scene.hierarchy)
    renderer.set_tiles(scene.tiles)
    framebuffer = ctx.simple_framebuffer((view.width, view.height))
    errors = {}
    for name, settings in (("normal_mapping", Settings()), ("no_normal_mapping", Settings(normal_mapping=False))):
        cut = select_cut(scene.hierarchy, view, options.r_sil, options.r_inner)
        renderer.draw(cut, view, settings, framebuffer)
        frame = renderer.read_arrays()
        errors[name] = measure(frame.normal, frame.depth, frame.coverage, reference).to_dict()
    counts = {
        "splats": cut.splat_count,
        "leaf_triangles": cut.triangle_count,
        "silhouette": cut.silhouette_count,
        "visited_nodes": cut.visited_nodes,
    }
    times = _frame_times(ctx, renderer, framebuffer, TriangleBaseline(ctx, mesh), scene, view, options)
    return counts | times | {"gl_renderer": ctx.info["GL_RENDERER"], "error": errors}


def _frame_times(
    ctx: moderngl.Context,
    renderer: Renderer,
    framebuffer: moderngl.Framebuffer,
    baseline: TriangleBaseline,
    scene: Scene,
    view: View,
    options: Options,
) -> dict[str, float]:
    """Draw the splats and the plain triangles in turn."""
    rows: dict[str, list[float]] = {}

    def record(name: str, milliseconds: float) -> None:
        rows.setdefault(name, []).append(milliseconds)

    def draw() -> None:
        renderer.draw(cut, view, Settings(), framebuffer)
        ctx.finish()

    def draw_baseline() -> None:
        baseline.draw(view)
        ctx.finish()

    for _ in range(ROUNDS + 1):
        cut, select_ms = _timed(lambda: select_cut(scene.hierarchy, view, options.r_sil, options.r_inner))
        _, draw_ms = _timed(draw)
        _, triangles_ms = _timed(draw_baseline)
        record("select_ms", select_ms)
        record("frame_ms", select_ms + draw_ms)
        record("triangles_ms", triangles_ms)
        record("frame_over_triangles", (select_ms + draw_ms) / triangles_ms)
        for stage, milliseconds in renderer.timings.items():
            record(f"{stage}_ms", milliseconds)
    return {name: statistics.median(values[1:]) for name, values in rows.items()}


def _timed(work: Callable[[], T]) -> tuple[T, float]:
    """Return what the work returns and the milliseconds that it took."""
    start = time.perf_counter()
    result = work()
    return result, 1e3 * (time.perf_counter() - start)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
