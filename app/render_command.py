"""`surfelscope render`: draw without a window."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from app.errors import UsageError, graphics_errors
from app.export import check_writable, is_picture, read_picture, write_arrays, write_png
from app.framing import frame_scene, view_of_pose
from app.options import Options
from app.progress import Reporter
from app.scene import ModelSource, Scene, bake_scene, open_scene
from app.statistics import Statistic, draw_frames, frame_statistics, scene_statistics

if TYPE_CHECKING:
    from hierarchy.view import View
    from renderer.settings import Settings

DEFAULT_RESOLUTION = (1024, 1024)


def run_render(options: Options) -> None:
    """Draw the model and write the outputs.

    Raises UsageError, ModelError, ContextError, GraphicsError or OutputError, each with one line.
    """
    for path in options.outputs:
        check_writable(path)
    reporter = Reporter(options.verbose)
    source = ModelSource(options.model, options.texture, options.points)
    scene = open_scene(source, None, reporter.progress)
    reporter.warnings(scene.hierarchy.warnings)
    statistics = draw_scene(scene, options, reporter)
    if options.json:
        print(json.dumps(statistics, indent=2))


def draw_scene(scene: Scene, options: Options, reporter: Reporter) -> dict[str, Statistic]:
    """Draw a scene in a context of its own, write the outputs and return the statistics."""
    from renderer.context import create_headless_context
    from renderer.renderer import Renderer
    from renderer.settings import Settings

    resolution = options.resolution or DEFAULT_RESOLUTION
    try:
        view = view_of_pose(frame_scene(scene, options.camera, resolution), scene, resolution)
    except ValueError as error:
        raise UsageError(str(error)) from error
    # The inside of an open surface shows; a closed one's does not.
    settings = Settings(normal_mapping=options.normal_mapping, two_sided=not scene.hierarchy.closed)
    if options.normal_mapping:
        scene = _bake_what_is_seen(scene, view, settings, options, reporter)
    reporter.progress("Drawing", 0.0)
    ctx = create_headless_context()
    try:
        with graphics_errors():
            renderer = Renderer(ctx)
            renderer.set_hierarchy(scene.hierarchy)
            renderer.set_tiles(scene.tiles)
            framebuffer = ctx.simple_framebuffer(resolution)
            radii = (options.r_sil, options.r_inner)
            cut, times = draw_frames(renderer, framebuffer, scene, view, radii, settings, options.frames)
            statistics = scene_statistics(scene) | frame_statistics(cut, times, renderer, ctx)
            picture = read_picture(framebuffer)
            # The arrays take another two passes.
            wants_arrays = any(not is_picture(path) for path in options.outputs)
            frame = renderer.read_arrays() if wants_arrays else None
            renderer.release()
    finally:
        ctx.release()
    for path in options.outputs:
        if frame is None or is_picture(path):
            write_png(path, picture)
        else:
            write_arrays(path, frame)
        reporter.say(f"wrote {path}")
    return statistics


def _bake_what_is_seen(scene: Scene, view: View, settings: Settings, options: Options, reporter: Reporter) -> Scene:
    """Bake the tiles of the splats that the view draws: some thousands, where the model may have a million."""
    from hierarchy.lod import select_cut

    cut = select_cut(scene.hierarchy, view, options.r_sil, options.r_inner, two_sided=settings.two_sided)
    nodes = cut.splats[cut.splats < scene.hierarchy.node_count]
    return bake_scene(scene, options.texels, reporter.progress, nodes=nodes)


def render_instead_of_window(options: Options, reason: str, output: Path) -> None:
    """Draw what the window would have shown to a file, and say so on standard output."""
    options = replace(options, outputs=(output,))
    check_writable(output)
    reporter = Reporter(options.verbose)
    scene = open_scene(ModelSource(options.model, options.texture, options.points), None, reporter.progress)
    reporter.warnings(scene.hierarchy.warnings)
    draw_scene(scene, options, reporter)
    print(f"{reason}: the picture is in {output}")
    sys.stdout.flush()
