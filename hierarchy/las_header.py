"""What stands in front of the points of a LAS or LAZ file.

Based on: ASPRS, "LAS Specification 1.4 - R15", 2019. Reads bytes that are there and nothing else, so that no count or
offset of a damaged file costs time or memory.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hierarchy.model import Float64Array
from hierarchy.part import UnreadableFile

# Bytes of a point of formats 0 to 10, and where its red, green and blue (uint16 each) begin.
POINT_SIZES = (20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67)
COLOR_OFFSETS = {2: 20, 3: 28, 5: 28, 7: 30, 8: 30, 10: 30}

# The variable-length record that says how points are compressed.
LASZIP_USER, LASZIP_RECORD = b"laszip encoded", 22204

SMALLEST_HEADER = 227
VLR_HEADER = 54


@dataclass(frozen=True, eq=False)
class LasHeader:
    """Where the points of a file are, and how to read them.

    start : offset of the points in bytes
    point_count : as the header promises
    point_size : bytes of one point, extra bytes included
    scales, offsets : float64 (3,) each, coordinates are integers times scales plus offsets
    color_offset : where in a point its colours begin, or None
    laszip : the record with the compression's parameters, or None where points are not compressed
    """

    start: int
    point_count: int
    point_size: int
    scales: Float64Array
    offsets: Float64Array
    color_offset: int | None
    laszip: bytes | None

    @property
    def point(self) -> np.dtype[np.void]:
        """What is read of a point: "raw", int32 (3,), and "colors", uint16 (3,), where it has some."""
        names, formats, places = ["raw"], ["(3,)<i4"], [0]
        if self.color_offset is not None:
            names, formats, places = ["raw", "colors"], ["(3,)<i4", "(3,)<u2"], [0, self.color_offset]
        return np.dtype({"names": names, "formats": formats, "offsets": places, "itemsize": self.point_size})


def read_las_header(path: Path) -> LasHeader:
    """Read the header of a LAS or LAZ file of versions 1.0 to 1.4. Raises UnreadableFile, OSError."""
    size = path.stat().st_size
    with path.open("rb") as stream:
        header = stream.read(375)
        if not header.startswith(b"LASF"):
            raise UnreadableFile("not a LAS file: it does not begin with LASF")
        if len(header) < SMALLEST_HEADER:
            raise UnreadableFile("truncated: the file ends in its header")
        header_size, start, records, kind, point_size, count = struct.unpack_from("<HIIBHI", header, 94)
        if header[25] >= 4 and header_size >= 255 and len(header) >= 255:
            # Since version 1.4 a field of 64 bits counts; the old one is 0 where it is too small.
            count = struct.unpack_from("<Q", header, 247)[0] or count
        if start < max(header_size, SMALLEST_HEADER):
            raise UnreadableFile("damaged: its points begin inside its header")
        if start > size:
            raise UnreadableFile("truncated: the file ends before its points")
        # LASzip marks compressed points by the highest bit of the format.
        compressed, kind = bool(kind & 0x80), kind & 0x3F
        if kind >= len(POINT_SIZES):
            raise UnreadableFile(f"points of format {kind} are unknown")
        if point_size < POINT_SIZES[kind]:
            raise UnreadableFile(f"damaged: points of format {kind} do not fit into {point_size} bytes")
        stream.seek(header_size)
        laszip = find_laszip(stream.read(start - header_size), records) if compressed else None
    return LasHeader(
        start=start,
        point_count=count,
        point_size=point_size,
        scales=np.array(struct.unpack_from("<3d", header, 131)),
        offsets=np.array(struct.unpack_from("<3d", header, 155)),
        color_offset=COLOR_OFFSETS.get(kind),
        laszip=laszip,
    )


def find_laszip(data: bytes, records: int) -> bytes:
    """Return the body of the LASzip record among `records` variable-length records. Raises UnreadableFile."""
    place = 0
    while records > 0 and place + VLR_HEADER <= len(data):
        user, record, length = struct.unpack_from("<2x16sHH", data, place)
        place += VLR_HEADER
        if record == LASZIP_RECORD and user.rstrip(b"\0") == LASZIP_USER and place + length <= len(data):
            return data[place : place + length]
        place += length
        records -= 1
    raise UnreadableFile("damaged: it does not say how its points are compressed")
