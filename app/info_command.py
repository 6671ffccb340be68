"""`surfelscope info`: what the file holds and what was built from it."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict

from app.cache_command import user_cache
from app.memory import peak_memory_mb
from app.options import Options
from app.progress import Reporter
from app.scene import ModelSource, Scene, keep_scene, open_scene
from app.statistics import scene_statistics


def run_info(options: Options) -> None:
    """Print a description of a model; raises ModelError."""
    reporter = Reporter(options.verbose)
    cache = user_cache(options, reporter.say)
    source = ModelSource(options.model, options.texture, options.points)
    scene = open_scene(source, options.baked_texels, reporter.progress, cache=cache)
    if options.json:
        # The warnings are in the description.
        print(json.dumps(describe(scene), indent=2))
    else:
        reporter.warnings(scene.hierarchy.warnings)
        print(as_text(scene))
    if cache is not None:
        # What was asked for comes first, whoever reads it.
        sys.stdout.flush()
        keep_scene(scene, cache)


def describe(scene: Scene) -> dict[str, object]:
    """Return everything that is known about a scene, ready for JSON."""
    return {
        **asdict(scene.content),
        "warnings": list(scene.hierarchy.warnings),
        **scene_statistics(scene),
        "peak_memory_mb": peak_memory_mb(),
    }


def as_text(scene: Scene) -> str:
    """Return the description for people, a label and a value a line."""
    content, hierarchy, tiles = scene.content, scene.hierarchy, scene.tiles
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
        lines["tiles"] = f"{tiles.count:,} of {tiles.texels} x {tiles.texels} normals, {tiles.nbytes / 1e6:.1f} MB"
    lines["times"] = f"load {scene.load_s:.2f} s, build {scene.build_s:.2f} s, bake {scene.bake_s:.2f} s"
    peak = peak_memory_mb()
    if peak is not None:
        lines["memory"] = f"{peak:.0f} MB at most"
    return "\n".join(f"{label:<10} {value}" for label, value in lines.items())
