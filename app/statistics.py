"""What `--json` reports: sizes of what was built, and medians of what the frames took."""

from __future__ import annotations

import time
from dataclasses import dataclass
from statistics import median
from typing import TYPE_CHECKING

import moderngl

from app.memory import peak_memory_mb
from app.scene import Scene
from hierarchy.model import Progress, ignore_progress
from hierarchy.view import View

if TYPE_CHECKING:
    from hierarchy.lod import Cut
    from hierarchy.normal_tiles import TileCount
    from renderer.cut_tiles import CutTiles
    from renderer.renderer import Renderer
    from renderer.settings import Settings

Statistic = str | int | float | bool | None

# r_sil and r_inner in pixels.
Radii = tuple[float, float]


@dataclass(frozen=True)
class FrameTimes:
    """What one frame took, in milliseconds.

    select : choosing the level of detail
    draw : the three passes, until the GPU has finished
    stages : the passes by name
    """

    select: float
    draw: float
    stages: dict[str, float]

    @property
    def frame(self) -> float:
        return self.select + self.draw


@dataclass(frozen=True, eq=False)
class Shot:
    """All that a picture depends on but the radii of its splats.

    printed_cone_test : tell the silhouette by the test as printed in the paper
    tiles : None: it is drawn without
    """

    scene: Scene
    view: View
    settings: Settings
    printed_cone_test: bool = False
    tiles: CutTiles | None = None

    def cut(self, radii: Radii) -> Cut:
        """Choose the level of detail."""
        from hierarchy.lod import select_cut

        return select_cut(
            self.scene.hierarchy,
            self.view,
            *radii,
            two_sided=self.settings.two_sided,
            printed_cone_test=self.printed_cone_test,
        )


def draw_frames(
    renderer: Renderer,
    framebuffer: moderngl.Framebuffer,
    shot: Shot,
    radii: Radii,
    count: int,
    progress: Progress = ignore_progress,
) -> tuple[Cut, list[FrameTimes]]:
    """Draw the same frame `count` times, each from the selection on; return the last cut and the times.

    Its tiles are baked before.
    """
    if shot.tiles is not None:
        shot.tiles.bring(shot.cut(radii), shot.view, progress)
    progress("Drawing", 0.0)
    times = []
    for _ in range(count):
        start = time.perf_counter()
        cut = shot.cut(radii)
        selected = time.perf_counter()
        renderer.draw(cut, shot.view, shot.settings, framebuffer)
        framebuffer.ctx.finish()
        drawn = time.perf_counter()
        times.append(FrameTimes(1e3 * (selected - start), 1e3 * (drawn - selected), renderer.timings))
    return cut, times


def scene_statistics(scene: Scene) -> dict[str, Statistic]:
    """Return sizes and times of what was built."""
    hierarchy = scene.hierarchy
    return {
        "model": hierarchy.name,
        "base_primitives": hierarchy.leaf_count,
        "base_kind": hierarchy.leaf_kind,
        "nodes": hierarchy.node_count,
        "hierarchy_bytes": hierarchy.nbytes,
        "load_s": round(scene.load_s, 4),
        "build_s": round(scene.build_s, 4),
    }


def tile_statistics(tiles: TileCount | CutTiles | None, bake_s: float) -> dict[str, Statistic]:
    """Return sizes and times of the tiles that were baked or drawn with; None: none were."""
    return {
        "tiles": tiles.tiles if tiles else 0,
        "tile_texels": tiles.texels if tiles else 0,
        "tile_bytes": tiles.nbytes if tiles else 0,
        "bake_s": round(bake_s, 4),
    }


def frame_statistics(
    cut: Cut, times: list[FrameTimes], renderer: Renderer, ctx: moderngl.Context
) -> dict[str, Statistic]:
    """Return what the last frame drew and the medians of the times."""
    return {
        "splats": int(cut.splat_count),
        "triangles": int(cut.triangle_count),
        "silhouette_splats": int(cut.silhouette_splats),
        "silhouette_triangles": int(cut.silhouette_triangles),
        "visited_nodes": int(cut.visited_nodes),
        "frames": len(times),
        "select_ms": round(median(t.select for t in times), 4),
        "draw_ms": round(median(t.draw for t in times), 4),
        "frame_ms": round(median(t.frame for t in times), 4),
        **{f"{stage}_ms": round(median(t.stages[stage] for t in times), 4) for stage in times[-1].stages},
        "gpu_bytes": int(renderer.gpu_bytes),
        "gl_renderer": ctx.info["GL_RENDERER"],
        "gl_version": ctx.info["GL_VERSION"],
        "peak_memory_mb": peak_memory_mb(),
    }
