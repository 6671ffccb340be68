"""The run file: everything that one run of the benchmarks measured, as one JSON document and as a table beside it.

    {"format": 1,
     "environment": {"commit", "dirty", "code", "date", "cpu", "cores", "memory_mb", "os", "python", "numpy", "numba",
                     "moderngl", "gl_renderer", "gl_version"},
     "settings": {"resolution": [width, height], "rounds", "samples", "view_angle": degrees},
     "models": {name: what subject.py says of it},
     "records": [{"model", "view", "method", "r_sil", "r_inner", "w_s", "cost": {...}, "error": {...}}],
     "paper": [rows of paper_table.py], "scaling": [entries of scaling.py], "bounds": [entries of promise_check.py]}

A `w_s` of 0 means: no tiles. `cost` is what measurement.py makes of a setting: "select_ms", "visibility_ms",
"attributes_ms", "resolve_ms", "frame_ms" and "triangles_ms" as {"median", "min", "spread"} (spread: between the
quartiles), "frame_over_triangles" (median of the rounds' ratios), and numbers. `error` is `PictureError.to_dict()`
and "psnr", "ssim", "flip". The table has one row a record; its columns are the paths of `Record.value`.
"""

from __future__ import annotations

import csv
import io
import json
import math
import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

FORMAT = 1
# More than anything here is measured to, few enough to read.
DIGITS = 6

Json = dict[str, Any]


class RunFileError(Exception):
    """A run file cannot be read, written or continued. The message is one line."""


@dataclass(frozen=True, order=True)
class Setting:
    """What identifies a record.

    method : one of methods.METHODS
    r_sil, r_inner : radii in pixels; 0 where the method has none
    w_s : texels along one side of a tile, 0: no tiles
    """

    model: str
    view: str
    method: str
    r_sil: float
    r_inner: float
    w_s: int


@dataclass(frozen=True)
class Record:
    """One setting with what it costs and how far its picture is from the truth."""

    setting: Setting
    cost: Json
    error: Json

    def value(self, path: str) -> float:
        """Return a number by its path, such as "cost.frame_ms.median" or "r_inner"; nan where there is none."""
        found = self.row.get(path)
        return float(found) if isinstance(found, int | float) else math.nan

    def to_dict(self) -> Json:
        """Return the record as it stands in the file."""
        return {**asdict(self.setting), "cost": self.cost, "error": self.error}

    # A record never changes, and all of them are written whenever one is added.

    @cached_property
    def line(self) -> str:
        """The record as JSON."""
        return _dump(self.to_dict())

    @cached_property
    def row(self) -> Json:
        """The record's values by their paths."""
        return flat(plain(self.to_dict()))

    @staticmethod
    def from_dict(document: Json) -> Record:
        """Read what `to_dict` returned; raises KeyError or TypeError where something is missing."""
        names = ("model", "view", "method", "r_sil", "r_inner", "w_s")
        return Record(Setting(*(document[name] for name in names)), dict(document["cost"]), dict(document["error"]))


@dataclass
class Run:
    """A run file's content; see the head of this file."""

    environment: Json
    settings: Json
    models: dict[str, Json] = field(default_factory=dict)
    records: list[Record] = field(default_factory=list)
    paper: list[Json] = field(default_factory=list)
    scaling: list[Json] = field(default_factory=list)
    bounds: list[Json] = field(default_factory=list)

    def measured(self) -> set[Setting]:
        """Return the settings that have a record."""
        return {record.setting for record in self.records}


def read_run(path: Path) -> Run:
    """Read a run file; raises RunFileError."""
    try:
        document = json.loads(path.read_text("utf-8"))
    except OSError as error:
        raise RunFileError(f"{path}: {error.strerror or error}") from error
    except ValueError as error:
        raise RunFileError(f"{path}: not a run of the benchmarks") from error
    if not isinstance(document, dict) or "format" not in document:
        raise RunFileError(f"{path}: not a run of the benchmarks")
    if document["format"] != FORMAT:
        raise RunFileError(f"{path}: its format is {document['format']}, this program reads format {FORMAT}")
    try:
        _check_entries(document)
        return Run(
            environment=document["environment"],
            settings=document["settings"],
            models=document["models"],
            records=[Record.from_dict(each) for each in document["records"]],
            paper=document["paper"],
            scaling=document["scaling"],
            bounds=document["bounds"],
        )
    except (KeyError, TypeError, ValueError) as error:
        raise RunFileError(f"{path}: not a run of the benchmarks, or a damaged one") from error


def _check_entries(document: Json) -> None:
    """Look for what is read of each entry; raises KeyError, TypeError or ValueError where it is missing or odd."""
    for entry in document["records"]:
        if any(isinstance(value, str) for value in flat({"cost": entry["cost"], "error": entry["error"]}).values()):
            raise ValueError("text where numbers belong")
    for entry in document["bounds"]:
        entry["model"], entry["view"], entry["goal"]
        entry["promised"]["degrees"], entry["measured"]["degrees"]
    for entry in document["scaling"]:
        float(entry["size"]), entry["cost"]["frame_over_triangles"], entry["error"]["normal_degrees"]
    for entry in document["paper"]:
        entry["w_s"]


def write_run(path: Path, run: Run) -> None:
    """Put the run in place of the file, and its table beside it under the suffix .csv.

    At every moment the file is the old one or the new one, whole, also where the process is killed here.
    Raises RunFileError where it cannot be written.
    """
    try:
        _replace(path, _json_text(run))
        _replace(table_path(path), _table_text(run.records))
    except OSError as error:
        raise RunFileError(f"{path}: cannot be written ({error.strerror or error})") from error


def table_path(path: Path) -> Path:
    """Return where the table of a run file lies."""
    return path.with_suffix(".csv")


def flat(document: Json, prefix: str = "") -> Json:
    """Return nested dictionaries as one, its keys the paths joined by dots."""
    result: Json = {}
    for name, value in document.items():
        if isinstance(value, dict):
            result |= flat(value, f"{prefix}{name}.")
        else:
            result[f"{prefix}{name}"] = value
    return result


def plain(value: Any) -> Any:
    """Return a value as JSON has it: numpy's numbers as Python's, to DIGITS digits; None where they are not finite."""
    if isinstance(value, dict):
        return {str(name): plain(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    if hasattr(value, "item"):
        value = value.item()
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None
    return value


def _json_text(run: Run) -> str:
    """Write lists with one entry a line, so that two runs can be compared line by line."""
    document = {"format": FORMAT, **{name: getattr(run, name) for name in vars(run)}}
    return "{\n" + ",\n".join(f"{_dump(name)}: {_value_text(value)}" for name, value in document.items()) + "\n}\n"


def _value_text(value: Any) -> str:
    if isinstance(value, list):
        lines = [each.line if isinstance(each, Record) else _dump(each) for each in value]
        return "[" + ",".join(f"\n {line}" for line in lines) + "]"
    if isinstance(value, dict):
        return "{" + ",".join(f"\n {_dump(name)}: {_dump(each)}" for name, each in value.items()) + "}"
    return _dump(value)


def _dump(value: Any) -> str:
    return json.dumps(plain(value), allow_nan=False)


def _table_text(records: list[Record]) -> str:
    rows = [record.row for record in records]
    columns = list(dict.fromkeys(_names(rows)))
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _names(rows: list[Json]) -> Iterator[str]:
    for row in rows:
        yield from row


def _replace(path: Path, text: str) -> None:
    part = path.with_name(f".{path.name}.part")
    with part.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        # Without this a loss of power may leave the new name with nothing behind it.
        os.fsync(file.fileno())
    part.replace(path)
