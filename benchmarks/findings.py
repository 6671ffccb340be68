"""What the records of a run say: means over views, Pareto fronts, and what is saved at equal error."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from statistics import fmean, median

from benchmarks.run_file import Record, Run, Setting

# The model that the paper measures.
PREFERRED = "igea.ply"


@dataclass(frozen=True)
class Point:
    """One setting, its figures the means over the views that the whole sweep was measured on.

    setting : with the views' names, joined, as its view
    ms : frame time in milliseconds, its ratio to the plain triangles times their median time in the whole run, so that
        a machine whose speed drifts moves no point
    ratio : frame time over that of the plain triangles
    error, p95 : of the angle between normals, degrees
    displacement : of the outline, mean, pixels
    splats, triangles : drawn
    tile_bytes, cut_tile_bytes : of all tiles of the model, and of those that are drawn, mean over the views
    records : one a view
    """

    setting: Setting
    ms: float
    ratio: float
    error: float
    p95: float
    displacement: float
    splats: float
    triangles: float
    tile_bytes: float
    cut_tile_bytes: float
    records: tuple[Record, ...]

    def mean(self, path: str) -> float:
        """Return the mean over the views of a number by its path, as of `Record.value`; nan where one has none."""
        return fmean(record.value(path) for record in self.records)

    @property
    def primitives(self) -> float:
        """Splats and leaf triangles together."""
        return self.splats + self.triangles


Axis = Callable[[Point], float]


def main_model(run: Run) -> str | None:
    """Return the model that plots are drawn of: Igea where it was measured, else the first with records."""
    names = list(dict.fromkeys(record.setting.model for record in run.records))
    return PREFERRED if PREFERRED in names else next(iter(names), None)


def swept_views(run: Run, model: str) -> list[str]:
    """Return the views of a model that the most settings were measured on."""
    counts: dict[str, int] = {}
    for record in run.records:
        if record.setting.model == model:
            counts[record.setting.view] = counts.get(record.setting.view, 0) + 1
    return [view for view, count in counts.items() if count == max(counts.values())]


def points_of(run: Run, model: str) -> list[Point]:
    """Return the settings of a model that were measured on all of its swept views, in the run's order."""
    views = swept_views(run, model)
    groups: dict[tuple[str, float, float, int], list[Record]] = {}
    for record in run.records:
        s = record.setting
        if s.model == model and s.view in views:
            groups.setdefault((s.method, s.r_sil, s.r_inner, s.w_s), []).append(record)
    triangles_ms = triangles_time(run, model)
    return [
        _point(records, Setting(model, ", ".join(views), *key), triangles_ms)
        for key, records in groups.items()
        if len(records) == len(views)
    ]


def triangles_time(run: Run, model: str) -> float:
    """Return the median over all records of the milliseconds that the model's plain triangles took; nan if none."""
    times = [record.value("cost.triangles_ms.median") for record in run.records if record.setting.model == model]
    times = [time for time in times if not math.isnan(time)]
    return median(times) if times else math.nan


def _point(records: Sequence[Record], setting: Setting, triangles_ms: float) -> Point:
    def mean(path: str) -> float:
        return fmean(record.value(path) for record in records)

    ratio = mean("cost.frame_over_triangles")
    return Point(
        setting=setting,
        ms=ratio * triangles_ms,
        ratio=ratio,
        error=mean("error.normal_degrees.mean"),
        p95=mean("error.normal_degrees.p95"),
        displacement=mean("error.silhouette.mean"),
        splats=mean("cost.splats"),
        triangles=mean("cost.triangles"),
        tile_bytes=mean("cost.tile_bytes"),
        cut_tile_bytes=mean("cost.cut_tile_bytes"),
        records=tuple(records),
    )


def pareto_front(points: Iterable[Point], x: Axis, y: Axis) -> list[Point]:
    """Return the points to which no other is better in both, by rising x and falling y; smaller is better."""
    front: list[Point] = []
    for point in sorted((p for p in points if math.isfinite(x(p) + y(p))), key=lambda p: (x(p), y(p))):
        if not front or y(point) < y(front[-1]):
            front.append(point)
    return front


def x_at(front: Sequence[Point], x: Axis, y: Axis, value: float) -> float | None:
    """Return x where a front reaches y = value, None outside of its range.

    Between two points of the front log x is linear in log y; where one of them is 0, in y.
    """
    for left, right in itertools.pairwise(front):
        if y(right) <= value <= y(left):
            if min(y(right), x(left)) > 0.0:
                share = math.log(y(left) / value) / math.log(y(left) / y(right))
                return float(x(left) * (x(right) / x(left)) ** share)
            share = (y(left) - value) / (y(left) - y(right))
            return x(left) + share * (x(right) - x(left))
    return None


@dataclass(frozen=True)
class Saving:
    """What two methods need for the same error."""

    error: float
    without: float
    using: float

    @property
    def factor(self) -> float:
        """How many times fewer."""
        return self.without / self.using


def savings(
    using: Sequence[Point], without: Sequence[Point], x: Axis, y: Axis, values: Iterable[float]
) -> list[Saving]:
    """Return what `without` needs of x for each value of y, beside what `using` needs, where both reach it."""
    fronts = pareto_front(using, x, y), pareto_front(without, x, y)
    rows = []
    for value in values:
        needed = [x_at(front, x, y, value) for front in fronts]
        if needed[0] is not None and needed[1] is not None:
            rows.append(Saving(value, needed[1], needed[0]))
    return rows


def of_method(points: Iterable[Point], method: str, **wanted: float) -> list[Point]:
    """Return the points of a method whose settings have the wanted values (r_sil, r_inner, w_s)."""
    return [
        point
        for point in points
        if point.setting.method == method and all(getattr(point.setting, n) == v for n, v in wanted.items())
    ]


def with_refinement(points: Iterable[Point]) -> list[Point]:
    """Return the settings that draw the silhouette finer than the inside, with tiles of any size."""
    return [p for p in of_method(points, "surfelscope") if p.setting.r_sil < p.setting.r_inner]


def without_refinement(points: Iterable[Point]) -> list[Point]:
    """Return the settings whose one radius limits silhouette and inside alike, with tiles of any size."""
    return [p for p in of_method(points, "surfelscope") if p.setting.r_sil == p.setting.r_inner]
