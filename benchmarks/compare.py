"""What became slower or worse from one run to another.

Times are compared as ratios to the plain triangles of the same run, drawn in turn with them, so that the machines may
differ. A record is flagged where one of its figures grew by more than 5 % and by more than what is too small to matter.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from benchmarks.run_file import Record, Run, Setting, flat, read_run
from benchmarks.setting_text import describe

TOLERANCE = 0.05
# Rows of each kind that are printed; all of them count.
MOST_ROWS = 40


@dataclass(frozen=True)
class Figure:
    """A figure of a record that should not grow.

    text : how it is printed
    paths : whose sum it is
    floor : a growth up to this is never flagged, in the figure's own unit
    timed : it is a ratio of times, and varies from run to run
    """

    text: str
    paths: tuple[str, ...]
    floor: float
    timed: bool = False


FIGURES = (
    Figure("frame / triangles", ("cost.frame_over_triangles",), 0.002, timed=True),
    Figure("splats + triangles", ("cost.splats", "cost.triangles"), 20.0),
    Figure("mean error, degrees", ("error.normal_degrees.mean",), 0.01),
    Figure("95th percentile, degrees", ("error.normal_degrees.p95",), 0.03),
    Figure("displacement, px", ("error.silhouette.mean",), 0.01),
    Figure("holes", ("error.holes",), 2.0),
    Figure("bytes of tiles", ("cost.tile_bytes",), 4096.0),
    Figure("bytes on the GPU", ("cost.gpu_bytes",), 65536.0),
)


@dataclass(frozen=True)
class Change:
    """One figure of one setting in both runs.

    spread : what the times of both runs vary by, as a share of the figure (quartile distances); 0 of what is counted
    """

    setting: Setting
    figure: Figure
    old: float
    new: float
    spread: float

    @property
    def share(self) -> float:
        """Growth as a share of the old value; infinite where that is 0."""
        if self.new == self.old:
            return 0.0
        return self.new / self.old - 1.0 if self.old > 0.0 else math.inf


@dataclass(frozen=True)
class Comparison:
    """What differs between two runs.

    flagged, better : figures that grew or shrank by more than `TOLERANCE`, the largest change first
    compared : settings that are in both runs
    only_old, only_new : settings that are in one of them
    notes : one line each on what makes the runs hard to compare
    """

    flagged: tuple[Change, ...]
    better: tuple[Change, ...]
    compared: int
    only_old: tuple[Setting, ...]
    only_new: tuple[Setting, ...]
    notes: tuple[str, ...]

    @property
    def status(self) -> int:
        """The exit status: 1 where something is flagged, else 0."""
        return 1 if self.flagged else 0

    def text(self) -> str:
        """Return a short table for people, lines without a newline at the end."""
        lines = [*self.notes]
        if self.flagged:
            lines += [f"Slower or worse by more than {TOLERANCE:.0%}:", *_rows(self.flagged)]
        if self.better:
            lines += [f"Better by more than {TOLERANCE:.0%}:", *_rows(self.better)]
        for only, text in ((self.only_old, "only in the old run"), (self.only_new, "only in the new run")):
            if only:
                lines += [f"{len(only)} {text}:", *_cut_short([f"  {describe(setting)}" for setting in only])]
        lines.append(
            f"{self.compared} settings compared, {len({change.setting for change in self.flagged})} flagged, "
            f"{len(self.flagged)} figures worse, {len(self.better)} better"
        )
        return "\n".join(lines)


def compare(old: Path, new: Path) -> Comparison:
    """Compare two run files; raises RunFileError where one cannot be read."""
    return compare_runs(read_run(old), read_run(new))


def compare_runs(old: Run, new: Run) -> Comparison:
    """Compare two runs, the sizes of their growing surfaces included."""
    before, after = ({record.setting: record for record in _records(run)} for run in (old, new))
    both = [setting for setting in before if setting in after]
    changes = [change for setting in both for change in _changes(before[setting], after[setting])]
    flagged = [change for change in changes if _grew(change.old, change.new, change.figure.floor)]
    better = [change for change in changes if _grew(change.new, change.old, change.figure.floor)]
    return Comparison(
        flagged=tuple(sorted(flagged, key=lambda change: -change.share)),
        better=tuple(sorted(better, key=lambda change: change.share)),
        compared=len(both),
        only_old=tuple(setting for setting in before if setting not in after),
        only_new=tuple(setting for setting in after if setting not in before),
        notes=tuple(_notes(old, new)),
    )


def _records(run: Run) -> list[Record]:
    """Return the records, and one for each size of the growing surface."""
    sizes = [
        Record(
            Setting(f"surface of {size['size']}", "front", "surfelscope", size["r_sil"], size["r_inner"], size["w_s"]),
            size["cost"],
            size["error"],
        )
        for size in run.scaling
    ]
    return [*run.records, *sizes]


def _changes(old: Record, new: Record) -> Iterable[Change]:
    for figure in FIGURES:
        before, after = (sum(record.value(path) for path in figure.paths) for record in (old, new))
        if not math.isnan(before + after):
            spread = _spread(old) + _spread(new) if figure.timed else 0.0
            yield Change(old.setting, figure, before, after, spread)


def _spread(record: Record) -> float:
    """Return the distance between the quartiles of a record's frame times, as a share of their median."""
    times = flat(record.cost)
    median = times.get("frame_ms.median") or 0.0
    return float(times.get("frame_ms.spread", 0.0)) / median if median > 0.0 else 0.0


def _grew(old: float, new: float, floor: float) -> bool:
    return new - old > floor and new > old * (1.0 + TOLERANCE)


def _notes(old: Run, new: Run) -> Iterable[str]:
    for name in ("gl_renderer", "cpu", "cores"):
        before, after = old.environment.get(name), new.environment.get(name)
        if before != after:
            yield f"another machine: {name} {before} then, {after} now; times are compared as ratios to the triangles"
    for name in ("resolution", "samples", "view_angle"):
        before, after = old.settings.get(name), new.settings.get(name)
        if before != after:
            yield f"not the same measurement: {name} {before} then, {after} now"
    for name, model in new.models.items():
        before = old.models.get(name)
        if before is not None and before.get("content") != model.get("content"):
            yield f"not the same model: {name} has changed"


def _rows(changes: Iterable[Change]) -> list[str]:
    rows = []
    for change in changes:
        share = "was 0" if math.isinf(change.share) else f"{change.share:+.1%}"
        spread = f"  (spread {change.spread:.0%})" if change.figure.timed else ""
        figures = f"{change.old:.4g} -> {change.new:.4g}"
        rows.append(f"  {share:>8}  {change.figure.text:<24} {figures:<22} {describe(change.setting)}{spread}")
    return _cut_short(rows)


def _cut_short(rows: list[str]) -> list[str]:
    more = len(rows) - MOST_ROWS
    return rows if more <= 0 else [*rows[:MOST_ROWS], f"  ... and {more} more"]
