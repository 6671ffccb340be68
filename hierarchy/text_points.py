"""Read points from lines of numbers: XYZ, PTS, ASC, CSV and the like.

Columns are x y z, then in any order what can be told from the values: a normal (three numbers of unit length), a
colour (three numbers up to 255 or 1), an intensity (one number, which is passed over).
"""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import numpy as np

from hierarchy.model import Float64Array
from hierarchy.part import Part, UnreadableFile, colors_from_channels

# How far from 1 the median length of three columns may be for them to be normals; some write three decimals.
UNIT_TOLERANCE = 0.02


# Columns that are looked at. A scanner writes a dozen; a file that is one long line has as many as numbers.
MOST_COLUMNS = 64


def read_text_points(path: Path) -> list[Part]:
    """Read a text file of points. Raises UnreadableFile, OSError."""
    text = path.read_bytes()
    if b"\0" in text[:4096]:
        raise UnreadableFile("not a text file of points")
    table = _table(text)
    part = Part(np.ascontiguousarray(table[:, :3]))
    column = 3
    while column < min(table.shape[1], MOST_COLUMNS):
        three = table[:, column : column + 3]
        if three.shape[1] == 3 and part.normals is None and _are_normals(three):
            part.normals = np.ascontiguousarray(three)
        elif three.shape[1] == 3 and part.colors is None and _are_colors(three, table.shape[1] - column):
            part.colors = colors_from_channels(list(three.T))
        else:
            column += 1
            continue
        column += 3
    return [part]


def _table(text: bytes) -> Float64Array:
    """Return all lines of as many numbers as the first line of at least three, (N, columns)."""
    lines = text.replace(b",", b" ").replace(b";", b" ").replace(b"\t", b" ").splitlines()
    # A header, a comment, or the number of points that PTS starts with.
    start = 0
    while start < len(lines) and not _is_point(lines[start]):
        start += 1
    if start == len(lines):
        raise UnreadableFile("nothing to draw: no line of it starts with three numbers")
    columns = len(lines[start].split())
    body = b"\n".join(lines[start:])
    if b"#" in body or b"//" in body:
        body = re.sub(rb"(#|//)[^\n]*", b"", body)
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            values = np.fromstring(body, np.float64, sep=" ")
        except (DeprecationWarning, ValueError):
            raise UnreadableFile("damaged: a line holds something that is not a number") from None
    if len(values) % columns:
        raise UnreadableFile(f"truncated or damaged: not every line has {columns} numbers")
    return values.reshape(-1, columns)


def _is_point(line: bytes) -> bool:
    words = line.split()
    try:
        return len([float(word) for word in words]) >= 3
    except ValueError:
        return False


def _are_normals(values: Float64Array) -> bool:
    lengths = np.linalg.norm(np.nan_to_num(values), axis=1)
    return bool(abs(np.median(lengths) - 1.0) < UNIT_TOLERANCE) and bool((values < 0.0).any())


def _are_colors(values: Float64Array, columns_left: int) -> bool:
    """Tell colours from an intensity followed by two of three colours: four columns left are not three."""
    finite = np.nan_to_num(values)
    return columns_left % 3 == 0 and bool((finite >= 0.0).all()) and bool(finite.max() <= 255.0)
