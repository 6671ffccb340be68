"""`surfelscope render`: draw without a window."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

from app.budget import Controller, coarsened
from app.cache_command import user_cache
from app.errors import UsageError, graphics_errors
from app.export import check_writable, is_picture, read_picture, write_arrays, write_png
from app.framing import frame_scene, view_of_pose
from app.option_values import TEXELS
from app.options import Options
from app.progress import Reporter
from app.scene import ModelSource, Scene, keep_scene, open_scene
from app.statistics import (
    FrameTimes,
    Radii,
    Shot,
    Statistic,
    draw_frames,
    frame_statistics,
    scene_statistics,
    tile_statistics,
)
from app.tile_cache import find_tiles, keep_tiles

if TYPE_CHECKING:
    import moderngl

    from app.cache import Cache
    from hierarchy.lod import Cut
    from hierarchy.tile_shelf import ShownTiles
    from renderer.renderer import Renderer

DEFAULT_RESOLUTION = (1024, 1024)

# Enough to find a coarseness in spite of noise; a load that changes all the time has none.
MOST_SETTLING_FRAMES = 120
# Times the time that a frame may take: beyond what the controller leaves alone and noise.
MUCH_TOO_SLOW = 1.25


def run_render(options: Options) -> None:
    """Draw the model and write the outputs.

    Raises UsageError, ModelError, ContextError, GraphicsError or OutputError, each with one line.
    """
    for path in options.outputs:
        check_writable(path)
    reporter = Reporter(options.verbose)
    cache = user_cache(options, reporter.say)
    source = ModelSource(options.model, options.texture, options.points)
    scene = open_scene(source, reporter.progress, cache=cache)
    reporter.warnings(scene.hierarchy.warnings)
    statistics, unkept = draw_scene(scene, options, reporter, cache)
    if options.json:
        print(json.dumps(statistics, indent=2))
    _keep(scene, unkept, cache)


def _keep(scene: Scene, unkept: ShownTiles | None, cache: Cache | None) -> None:
    """Put into the cache what is not there: the hierarchy, and then the tiles of the picture."""
    if cache is not None:
        # What was asked for comes first, whoever reads it.
        sys.stdout.flush()
        keep_scene(scene, cache)
        if unkept is not None:
            keep_tiles(cache, scene, unkept)


def draw_scene(
    scene: Scene, options: Options, reporter: Reporter, cache: Cache | None = None
) -> tuple[dict[str, Statistic], ShownTiles | None]:
    """Draw a scene in a context of its own, and write the outputs.

    cache : where tiles are looked for, None: nowhere
    Returns the statistics, and the tiles of the picture, None: they are in the cache or cannot go there.
    """
    from hierarchy.tile_shelf import TileShelf
    from hierarchy.tile_sizes import tiles_seen
    from renderer.context import create_headless_context
    from renderer.cut_tiles import CutTiles
    from renderer.limits import probe_limits
    from renderer.renderer import Renderer
    from renderer.targets import make_picture

    shot, radii, texels = _prepare(scene, options, reporter)
    ctx = create_headless_context()
    try:
        with graphics_errors():
            renderer = Renderer(ctx, probe_limits(ctx, options.tile_bytes))
            renderer.set_hierarchy(scene.hierarchy)
            kept = find_tiles(cache, scene, texels) if options.normal_mapping else None
            shelf = TileShelf(scene.hierarchy, texels, kept)
            tiles = CutTiles(renderer, scene.hierarchy, texels, shelf) if options.normal_mapping else None
            shot = replace(shot, tiles=tiles)
            framebuffer = make_picture(ctx, renderer.limits, (shot.view.width, shot.view.height))
            coarseness = 1.0 if options.fps is None else _settle(renderer, framebuffer, shot, radii, options.fps)
            radii = coarsened(radii[0], coarseness), coarsened(radii[1], coarseness)
            cut, times = draw_frames(renderer, framebuffer, shot, radii, options.frames, reporter.progress)
            if options.fps is not None:
                _warn_of_rate(times, options.fps, reporter)
            reporter.warnings(renderer.shortcomings)
            brought = tile_statistics(tiles, 0.0 if tiles is None else tiles.seconds) | {"tiles_cached": shelf.found}
            statistics = scene_statistics(scene) | brought | frame_statistics(cut, times, renderer, ctx)
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
            write_arrays(path, frame, scene.hierarchy.scale)
        reporter.say(f"wrote {path}")
    if options.json:
        statistics |= _goal_statistics(shot, cut, radii, coarseness)
    return statistics, shelf.worth_keeping(*tiles_seen(scene.hierarchy, shot.view, cut.splats, texels))


def _prepare(scene: Scene, options: Options, reporter: Reporter) -> tuple[Shot, Radii, int]:
    """Return what shall be drawn, the radii in full detail and the texels along one side of a tile."""
    from hierarchy.inside import eye_is_inside
    from renderer.settings import Settings

    resolution = options.resolution or DEFAULT_RESOLUTION
    try:
        view = view_of_pose(frame_scene(scene, options.camera, resolution), scene, resolution)
    except ValueError as error:
        raise UsageError(str(error)) from error
    # The inside of an open surface shows; a closed one's does not but to an eye that is there.
    two_sided = not scene.hierarchy.closed or eye_is_inside(scene.hierarchy, view)
    settings = Settings(normal_mapping=options.normal_mapping, splat=options.splat, two_sided=two_sided)
    shot = Shot(scene, view, settings, options.printed_cone_test)
    if options.max_error is None:
        return shot, (options.r_sil, options.r_inner), options.texels
    from hierarchy.goals import ErrorGoal, detail_for_goal

    goal = ErrorGoal(*options.max_error)
    detail, promise = detail_for_goal(scene.hierarchy, view, goal, texels=TEXELS)
    if promise.degrees > goal.degrees or promise.pixels > goal.pixels:
        reporter.warnings([
            f"no less than {promise.degrees:.2g} degrees and {promise.pixels:.2g} px can be promised in this view"
        ])  # fmt: skip
    return shot, (detail.r_sil, detail.r_inner), detail.texels


def _settle(
    renderer: Renderer, framebuffer: moderngl.Framebuffer, shot: Shot, radii: Radii, frames_per_second: float
) -> float:
    """Draw until the frames take what they may, or no coarseness will do it; return the coarseness."""
    controller = Controller(1e3 / frames_per_second)
    # The first frame compiles the shaders.
    draw_frames(renderer, framebuffer, shot, radii, 1)
    for _ in range(MOST_SETTLING_FRAMES):
        if controller.settled:
            break
        now = coarsened(radii[0], controller.coarseness), coarsened(radii[1], controller.coarseness)
        _, times = draw_frames(renderer, framebuffer, shot, now, 1)
        controller.measure(times[0].frame)
    return controller.coarseness


def _warn_of_rate(times: list[FrameTimes], frames_per_second: float, reporter: Reporter) -> None:
    """Say that the rate is not held where frames take far longer than they may."""
    took = 1e-3 * median(each.frame for each in times)
    if took * frames_per_second > MUCH_TOO_SLOW:
        reporter.warnings([f"{frames_per_second:g} frames a second are not held: {1.0 / took:.1f} are"])


def _goal_statistics(shot: Shot, cut: Cut, radii: Radii, coarseness: float) -> dict[str, Statistic]:
    """Return what the frames were drawn with and which error is promised of that; None without normal mapping."""
    tiles, promise = shot.tiles, None
    if tiles is not None:
        from hierarchy.goals import promise_of_cut

        promise = promise_of_cut(shot.scene.hierarchy, shot.view, cut, tiles.texels)
    return {
        "r_sil": round(radii[0], 4),
        "r_inner": round(radii[1], 4),
        "w_s": tiles.texels if tiles is not None else 0,
        "coarseness": round(coarseness, 4),
        "promised_degrees": round(promise.degrees, 4) if promise is not None else None,
        "promised_pixels": round(promise.pixels, 4) if promise is not None else None,
    }


def render_instead_of_window(options: Options, reason: str, output: Path) -> None:
    """Draw what the window would have shown at rest to a file, and say so on standard output."""
    options = replace(options, outputs=(output,), fps=None)
    check_writable(output)
    reporter = Reporter(options.verbose)
    cache = user_cache(options, reporter.say)
    source = ModelSource(options.model, options.texture, options.points)
    scene = open_scene(source, reporter.progress, cache=cache)
    reporter.warnings(scene.hierarchy.warnings)
    _, unkept = draw_scene(scene, options, reporter, cache)
    print(f"{reason}: the picture is in {output}")
    _keep(scene, unkept, cache)
