"""Figure 10 of Holst and Schumann 2007, a table, measured anew: w_s, size of the normal map, surfels and fps of Igea.

The paper's own test selects, from a point hierarchy as theirs: the cone test as printed (section 5), r_sil 2 and
r_inner = w_s. Sizes are by eq. 16-17, as they read once |S_base| and |S without S_base| are counts of surfels: a width
and a height in texels, of which the first row, without normal mapping, needs none.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from benchmarks.measurement import Workbench
from benchmarks.methods import DEFAULT, FLAT, METHODS, Method
from benchmarks.run_file import Json, Setting
from hierarchy.view import View

MODEL, VIEW = "igea.ply", "front"
R_SIL = 2.0


@dataclass(frozen=True)
class PaperRow:
    """A row as printed: size in millions of texels; GeForce 6800, Athlon64, 1024 x 1024."""

    w_s: int
    tiles: bool
    size: float
    surfels: int
    fps: float


# Holst and Schumann 2007, figure 10.
PRINTED = (
    PaperRow(2, False, 0.0, 250_000, 20.0),
    PaperRow(2, True, 0.34, 250_000, 17.0),
    PaperRow(4, True, 1.1, 119_000, 37.0),
    PaperRow(8, True, 4.1, 70_000, 59.0),
    PaperRow(16, True, 16.2, 49_000, 85.0),
)


def normal_map_size(inner: int, base: int, w_s: int) -> tuple[int, int]:
    """Return width and height in texels of the paper's one normal map for all surfels (eq. 16-17).

    inner, base : number of inner and of base surfels; a base surfel has one texel, an inner one w_s x w_s
    """
    width = math.ceil(math.sqrt(inner)) * w_s
    return width, math.ceil(base / width) + width


def measure_paper_table(bench: Workbench, view: View, rounds: int) -> list[Json]:
    """Return a row for each of the paper's, with the paper's beside it, for the "paper" part of a run file."""
    hierarchy = bench.subject.hierarchy(points=True)
    rows = []
    for printed in PRINTED:
        settings = DEFAULT if printed.tiles else FLAT
        method = Method("as printed", METHODS["printed cone test"].select, settings, points=True)
        w_s = printed.w_s if printed.tiles else 0
        setting = Setting(bench.subject.name, VIEW, "printed cone test", R_SIL, float(printed.w_s), w_s)
        cost, _ = bench.measure(method, setting, view, rounds)
        size = normal_map_size(hierarchy.node_count, hierarchy.leaf_count, w_s) if printed.tiles else (0, 0)
        rows.append(
            {
                "model": bench.subject.name,
                "view": VIEW,
                "w_s": printed.w_s,
                "tiles": printed.tiles,
                "r_sil": R_SIL,
                "r_inner": float(printed.w_s),
                "map": list(size),
                "texels": size[0] * size[1],
                "surfels": cost["splats"],
                "frame_ms": cost["frame_ms"],
                "fps": 1e3 / cost["frame_ms"]["median"],
                "paper": {"texels": 1e6 * printed.size, "surfels": printed.surfels, "fps": printed.fps},
            }
        )
    return rows
