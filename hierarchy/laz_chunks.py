"""Check the chunk table of a LAZ file before lazrs sees it.

lazrs trusts the table: where a file is cut off it allocates what the bytes in the table's place happen to say, and a
failed allocation in Rust ends the whole process.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

from hierarchy.las_header import LasHeader
from hierarchy.part import UnreadableFile


def check_chunks(path: Path, header: LasHeader) -> None:
    """Raise UnreadableFile unless the chunks of a LAZ file, whose `header` is given, lie inside the file."""
    size = path.stat().st_size
    start = header.start
    if start + 8 > size:
        raise UnreadableFile("truncated: the file ends before its points")
    with path.open("rb") as stream:
        stream.seek(start)
        table = _read_integer(stream, "<q")
        if table == -1:
            # A writer that could not go back puts the place of the table at the very end.
            stream.seek(size - 8)
            table = _read_integer(stream, "<q")
        if not start + 8 <= table <= size - 8:
            raise UnreadableFile("truncated: the file ends before its table of chunks")
        stream.seek(table)
        _, chunks = struct.unpack("<II", stream.read(8))
        # A chunk starts with one whole point.
        if chunks > (table - start - 8) // header.point_size:
            raise UnreadableFile("truncated or damaged: its table of chunks makes no sense")
        if _chunk_bytes(stream, header) > table - start - 8:
            raise UnreadableFile("truncated or damaged: its chunks run beyond the end of the file")


def _read_integer(stream: Any, layout: str) -> int:
    return int(struct.unpack(layout, stream.read(struct.calcsize(layout)))[0])


def _chunk_bytes(stream: Any, header: LasHeader) -> int:
    """Return the size of all chunks together, in bytes, as the table says."""
    import lazrs

    stream.seek(header.start)
    return sum(size for _, size in lazrs.read_chunk_table(stream, lazrs.LazVlr(header.laszip)))
