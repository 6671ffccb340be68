"""Read STL files, binary and ascii."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import numpy as np

from hierarchy.model import Float64Array
from hierarchy.part import Part, UnreadableFile

# Eighty bytes that say nothing, and the number of triangles.
HEADER_SIZE = 84

TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(path: Path) -> list[Part]:
    """Read the triangles; every corner is a vertex of its own. Raises UnreadableFile, OSError."""
    data = path.read_bytes()
    # Binary files that start with "solid" are common; only their size gives them away.
    count = int(np.frombuffer(data, "<u4", 1, 80)[0]) if len(data) >= HEADER_SIZE else 0
    complete = HEADER_SIZE + count * TRIANGLE.itemsize
    looks_like_text = data.lstrip()[:5].lower() == b"solid" and b"\0" not in data[:512]
    if looks_like_text and len(data) != complete:
        corners = _read_ascii(data)
    elif len(data) < HEADER_SIZE:
        raise UnreadableFile("truncated: it is shorter than the header of an STL file")
    elif len(data) < complete:
        raise UnreadableFile(f"truncated: its header promises {count} triangles, the file holds fewer")
    else:
        corners = np.frombuffer(data, TRIANGLE, count, HEADER_SIZE)["corners"].reshape(-1, 3).astype(np.float64)
    if len(corners) == 0:
        raise UnreadableFile("nothing to draw: it holds no triangles")
    return [Part(corners, np.arange(len(corners), dtype=np.int64).reshape(-1, 3))]


def _read_ascii(data: bytes) -> Float64Array:
    """Return the corners of an ascii file, (3 T, 3)."""
    if re.search(rb"endsolid", data, re.IGNORECASE) is None:
        raise UnreadableFile("truncated: it has no 'endsolid'")
    lines = re.findall(rb"vertex([^\r\n]*)", data, re.IGNORECASE)
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            values = np.fromstring(b" ".join(lines), np.float64, sep=" ") if lines else np.empty(0)
        except (DeprecationWarning, ValueError):
            raise UnreadableFile("damaged: a vertex holds something that is not a number") from None
    if len(values) % 9 or len(values) != 3 * len(lines):
        raise UnreadableFile("truncated or damaged: not every facet has three vertices of three numbers")
    return values.reshape(-1, 3)
