"""Read LAS and LAZ files, cloud-optimised ones too, through laspy and lazrs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from hierarchy.laz_chunks import check_chunks
from hierarchy.model import Progress, ignore_progress
from hierarchy.part import Part, UnreadableFile, colors_from_channels

# Points decoded at once: what a damaged header promises is never allocated, and the work can be cancelled.
BATCH = 1 << 20


def read_las(path: Path, progress: Progress = ignore_progress) -> list[Part]:
    """Read the points and their colours.

    Coordinates are the file's own, float64. Colours are 16-bit, or 8-bit where no value of the file exceeds 255, as
    many writers have it. Raises UnreadableFile, OSError and whatever laspy and lazrs raise, a Rust panic too.
    """
    import laspy

    positions, colors = [], []
    with laspy.open(path) as reader:
        header = reader.header
        if not header.are_points_compressed:
            room = path.stat().st_size - header.offset_to_point_data
            if header.point_count * header.point_format.size > room:
                raise UnreadableFile(
                    f"truncated: its header promises {header.point_count} points, the file holds fewer"
                )
        else:
            check_chunks(path, header)
        colored = {"red", "green", "blue"} <= set(header.point_format.dimension_names)
        found = 0
        for points in reader.chunk_iterator(BATCH):
            found += len(points)
            progress("load", 0.3 * found / max(header.point_count, found))
            positions.append(np.stack([np.asarray(points[axis], np.float64) for axis in "xyz"], axis=1))
            if colored:
                colors.append(_channels(points))
    if found < header.point_count:
        raise UnreadableFile(f"truncated: its header promises {header.point_count} points, the file holds {found}")
    if found == 0:
        raise UnreadableFile("nothing to draw: it holds no points")
    part = Part(np.concatenate(positions))
    if colored:
        channels = np.concatenate(colors)
        # Some formats reserve room for colours that were never taken: all black.
        if channels.any():
            part.colors = colors_from_channels(list(channels.T))
    return [part]


def _channels(points: Any) -> np.ndarray:
    return np.stack([np.asarray(points[name], np.uint16) for name in ("red", "green", "blue")], axis=1)
