"""Read LAS and LAZ files, cloud-optimised ones too.

LAS is read here. LAZ is decoded by lazrs, which on damaged files panics, loops without end or reserves memory without
bound: `read_laz` is for the child process of `contained.py`.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from hierarchy.las_header import LasHeader, read_las_header
from hierarchy.laz_chunks import check_chunks
from hierarchy.model import Progress, ignore_progress
from hierarchy.part import AnyArray, Part, UnreadableFile, colors_from_channels
from hierarchy.unpacking import check_unpacked

# Bytes read or decoded at once: what a damaged header promises is never allocated, and the work can be cancelled.
BATCH = 1 << 25


def is_compressed(path: Path) -> bool:
    """Tell whether the points are compressed, whatever the file is called. Raises UnreadableFile, OSError."""
    return read_las_header(path).laszip is not None


def read_las(path: Path, progress: Progress = ignore_progress) -> list[Part]:
    """Read the points and their colours of a file that is not compressed.

    Coordinates are the file's own, float64. Colours are 16-bit, or 8-bit where no value of the file exceeds 255, as
    many writers have it. Raises UnreadableFile, OSError.
    """
    header = read_las_header(path)
    if header.point_count * header.point_size > path.stat().st_size - header.start:
        raise UnreadableFile(f"truncated: its header promises {header.point_count} points, the file holds fewer")
    return [_gather(_stored_points(path, header), header, progress)]


def read_laz(path: Path, progress: Progress = ignore_progress) -> list[Part]:
    """Read the points and their colours of a compressed file, as `read_las` does.

    Raises UnreadableFile, OSError and whatever lazrs raises, a Rust panic too; may loop without end or end the process.
    """
    header = read_las_header(path)
    check_unpacked(header.point_count, path.stat().st_size)
    if header.point_count:
        check_chunks(path, header)
    return [_gather(_unpacked_points(path, header), header, progress)]


def _batches(header: LasHeader) -> Iterator[int]:
    """Yield how many points to take at once, until all are taken."""
    batch = max(BATCH // header.point_size, 1)
    for begin in range(0, header.point_count, batch):
        yield min(batch, header.point_count - begin)


def _stored_points(path: Path, header: LasHeader) -> Iterator[AnyArray]:
    with path.open("rb") as stream:
        stream.seek(header.start)
        for count in _batches(header):
            data = stream.read(count * header.point_size)
            if len(data) < count * header.point_size:
                raise UnreadableFile("truncated: the file became shorter while it was read")
            yield np.frombuffer(data, header.point)


def _unpacked_points(path: Path, header: LasHeader) -> Iterator[AnyArray]:
    import lazrs

    assert header.laszip is not None
    if lazrs.LazVlr(header.laszip).item_size() != header.point_size:
        raise UnreadableFile("damaged: its points are not as long as its compression says")
    with path.open("rb") as stream:
        stream.seek(header.start)
        decompressor = lazrs.ParLasZipDecompressor(stream, header.laszip) if header.point_count else None
        for count in _batches(header):
            assert decompressor is not None
            data = bytearray(count * header.point_size)
            decompressor.decompress_many(data)
            yield np.frombuffer(data, header.point)


def _gather(batches: Iterator[AnyArray], header: LasHeader, progress: Progress) -> Part:
    positions, colors, found = [], [], 0
    for points in batches:
        found += len(points)
        progress("load", 0.3 * found / header.point_count)
        positions.append(points["raw"] * header.scales + header.offsets)
        if header.color_offset is not None:
            colors.append(points["colors"].copy())
    if found == 0:
        raise UnreadableFile("nothing to draw: it holds no points")
    part = Part(np.concatenate(positions))
    # Some formats reserve room for colours that were never taken: all black.
    if colors and any(each.any() for each in colors):
        part.colors = colors_from_channels(list(np.concatenate(colors).T))
    return part
