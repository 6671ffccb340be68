"""What the program promises of speed and error, beside what a run measured."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from benchmarks.findings import Point, of_method, points_of, savings
from benchmarks.run_file import Json, Record, Run
from benchmarks.scaling import growth
from benchmarks.setting_text import count, numbers
from benchmarks.tables import table

IGEA, BUNNY = "igea.ply", "stanford-bunny.obj"
# Of the normals on average, of 95 in a hundred pixels, and of the outline.
DEGREES, DEGREES_OF_95, PIXELS = 0.8, 2.5, 0.25
AT_ERROR = f"at {DEGREES:g} degrees ({DEGREES_OF_95:g} at the 95th percentile) and {PIXELS:g} px"
# The share of the plain triangles' time that a frame may take, of Igea and of the growing surface at some sizes.
IGEA_SHARE = 0.6
SIZES = {4_000_000: 0.08, 17_000_000: 0.02}
# The methods by which the window draws what rests, and a mesh that moves (app/steering.py).
STILL, MOVING = "surfelscope", "not blended"

Row = tuple[str, str, str, str]


def targets(run: Run) -> str:
    """Return the table of targets; those that the run has nothing for are left out."""
    return table(("", "target", "measured", ""), list(_rows(run)))


def _rows(run: Run) -> Iterator[Row]:
    igea = points_of(run, IGEA) if any(record.setting.model == IGEA for record in run.records) else []
    for method in (STILL, MOVING):
        yield from _igea_frame(igea, method)
    for size, share in SIZES.items():
        for entry in (each for each in run.scaling if each["size"] == size):
            still = [entry] + ([entry | entry["coarser"]] if "coarser" in entry else [])
            yield _size_row(still, share)
            if "moving" in entry:
                yield _size_row([entry | entry["moving"]], share, ", while it moves")
    yield from _bunny([record for record in run.records if record.setting.model == BUNNY])
    grown = growth(run.scaling)
    if grown is not None:
        yield (f"frame time, 0.27 M to {count(max(entry['size'] for entry in run.scaling))} triangles",
               "at most 1.15 times", f"{grown:.2f} times", _met(grown <= 1.15))  # fmt: skip
    yield from _normal_mapping(igea)


class Candidate(NamedTuple):
    """A setting: its share of the triangles' time, its errors, and how it reads."""

    ratio: float
    degrees: float
    degrees_of_95: float
    pixels: float
    numbers: str

    @property
    def excess(self) -> float:
        """By which factor it misses the error that is allowed."""
        return max(self.degrees / DEGREES, self.degrees_of_95 / DEGREES_OF_95, self.pixels / PIXELS)


def _frame_row(what: str, share: float, candidates: Sequence[Candidate], digits: int) -> Row:
    """Take the fastest setting that is good enough, or the one that comes nearest to it."""
    good = [each for each in candidates if each.excess <= 1.0]
    best = min(good, key=lambda each: each.ratio) if good else min(candidates, key=lambda each: each.excess)
    outline = f"{best.pixels:.2f} px" if math.isfinite(best.pixels) else "no outline"
    return (
        what,
        f"frame at most {share:g} of plain triangles {AT_ERROR}",
        f"{best.ratio:.{digits}f} at {best.degrees:.2f} degrees ({best.degrees_of_95:.2f}) and {outline}{best.numbers}",
        _met(bool(good) and best.ratio <= share),
    )


def _igea_frame(points: Sequence[Point], method: str) -> Iterator[Row]:
    own = [p for p in of_method(points, method) if math.isfinite(p.displacement)]
    if own:
        candidates = [Candidate(p.ratio, p.error, p.p95, p.displacement, numbers(p.setting)) for p in own]
        what = f"Igea, {_views(own[0])}{', while it moves' if method == MOVING else ''}"
        yield _frame_row(what, IGEA_SHARE, candidates, 2)


def _size_row(entries: Sequence[Json], share: float, when: str = "") -> Row:
    """entries : the same size, at different settings."""
    candidates = [
        Candidate(
            entry["cost"]["frame_over_triangles"],
            entry["error"]["normal_degrees"]["mean"],
            entry["error"]["normal_degrees"]["p95"],
            math.inf if entry["error"]["silhouette"]["mean"] is None else entry["error"]["silhouette"]["mean"],
            f", r_sil {entry['r_sil']:g}, r_inner {entry['r_inner']:g}, w_s {entry['w_s']}",
        )
        for entry in entries
    ]
    return _frame_row(f"growing surface, {count(entries[0]['size'])} triangles{when}", share, candidates, 3)


def _bunny(records: Sequence[Record]) -> Iterator[Row]:
    """Take the setting and view of at most 4,000 primitives that comes nearest to both limits."""
    few = [r for r in records if r.setting.method == "surfelscope" and _primitives(r) <= 4_000]

    def worst(record: Record) -> float:
        missing = (1.0 - record.value("error.iou")) / (1.0 - 0.994)
        return max(record.value("error.normal_degrees.mean") / 1.8, missing)

    if few:
        best = min(few, key=worst)
        degrees, iou = best.value("error.normal_degrees.mean"), best.value("error.iou")
        yield (
            f"Stanford bunny, {best.setting.view}",
            "at most 4,000 splats and triangles for 1.8 degrees and IoU 0.994",
            f"{_primitives(best):,.0f} for {degrees:.2f} degrees and IoU {iou:.4f}{numbers(best.setting)}",
            _met(degrees <= 1.8 and iou >= 0.994),
        )


def _primitives(record: Record) -> float:
    return record.value("cost.splats") + record.value("cost.triangles")


def _normal_mapping(points: Sequence[Point]) -> Iterator[Row]:
    using, without = of_method(points, "surfelscope"), of_method(points, "no tiles")
    axis: Callable[[Point], float] = lambda p: p.primitives  # noqa: E731
    for saving in savings(using, without, axis, lambda p: p.error, (DEGREES,)):
        yield (
            f"normal mapping, Igea, {_views(points[0])}",
            f"5 times fewer splats and triangles at {DEGREES:g} degrees",
            f"{saving.factor:.1f} times ({saving.using:,.0f} instead of {saving.without:,.0f})",
            _met(saving.factor >= 5.0),
        )


def _views(point: Point) -> str:
    return f"mean of {len(point.records)} views" if len(point.records) > 1 else point.setting.view


def _met(met: bool) -> str:
    return "met" if met else "missed"
