"""`surfelscope info`: what the file holds and what was built from it."""

from __future__ import annotations

import json
import sys
import time
from dataclasses import asdict
from typing import TYPE_CHECKING

from app.cache_command import user_cache
from app.memory import peak_memory_mb
from app.options import Options
from app.progress import Reporter
from app.scene import ModelSource, Scene, keep_scene, open_scene
from app.statistics import scene_statistics, tile_statistics

if TYPE_CHECKING:
    from hierarchy.normal_tiles import TileCount


def run_info(options: Options) -> None:
    """Print a description of a model; raises ModelError."""
    reporter = Reporter(options.verbose)
    cache = user_cache(options, reporter.say)
    source = ModelSource(options.model, options.texture, options.points)
    scene = open_scene(source, reporter.progress, cache=cache)
    tiles, bake_s = None, 0.0
    if options.baked_texels is not None:
        from hierarchy.normal_tiles import count_tiles

        start = time.perf_counter()
        tiles = count_tiles(scene.hierarchy, options.baked_texels, reporter.progress)
        bake_s = time.perf_counter() - start
    if options.json:
        # The warnings are in the description.
        print(json.dumps(describe(scene, tiles, bake_s), indent=2))
    else:
        reporter.warnings(scene.hierarchy.warnings)
        print(as_text(scene, tiles, bake_s))
    if cache is not None:
        # What was asked for comes first, whoever reads it.
        sys.stdout.flush()
        keep_scene(scene, cache)


def describe(scene: Scene, tiles: TileCount | None, bake_s: float) -> dict[str, object]:
    """Return everything that is known about a scene, ready for JSON; as in `as_text`."""
    return {
        **asdict(scene.content),
        "warnings": list(scene.hierarchy.warnings),
        **scene_statistics(scene),
        **tile_statistics(tiles, bake_s),
        "peak_memory_mb": peak_memory_mb(),
    }


def as_text(scene: Scene, tiles: TileCount | None, bake_s: float) -> str:
    """Return the description for people, a label and a value a line.

    tiles : of all nodes, None: they were not baked
    bake_s : seconds that they took
    """
    content, hierarchy = scene.content, scene.hierarchy
    holds = f"{content.points:,} points"
    if content.kind == "mesh":
        side = "closed" if content.closed else "open"
        holds = f"{content.triangles:,} triangles, {content.points:,} vertices (creases split), {side}"
    lines = {
        "model": f"{hierarchy.name} ({content.kind})",
        "holds": holds,
        "colours": "yes" if content.colored else "no",
        "normals": content.normals,
        "from": ", ".join(f"{value:.6g}" for value in content.lower),
        "to": ", ".join(f"{value:.6g}" for value in content.upper),
        "hierarchy": f"{hierarchy.node_count:,} nodes over {hierarchy.leaf_count:,} {hierarchy.leaf_kind}, "
        f"{hierarchy.nbytes / 1e6:.1f} MB",
    }
    if tiles is not None:
        size = f"up to {tiles.texels} x {tiles.texels} normals, {tiles.nbytes / 1e6:.1f} MB"
        lines["tiles"] = f"{tiles.tiles:,} for {tiles.nodes:,} nodes, of {size}"
    lines["times"] = f"load {scene.load_s:.2f} s, build {scene.build_s:.2f} s"
    if tiles is not None:
        lines["times"] += f", bake {bake_s:.2f} s"
    peak = peak_memory_mb()
    if peak is not None:
        lines["memory"] = f"{peak:.0f} MB at most"
    return "\n".join(f"{label:<10} {value}" for label, value in lines.items())
