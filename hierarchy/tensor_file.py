"""Named arrays in a file that is mapped into memory: the safetensors format, with a checksum over every byte.

Format: the header's length as 8 bytes, little-endian; the header as JSON; the arrays, one behind the other. Any
safetensors reader reads these files; the library's own one for numpy copies every array, so here numpy maps them.
The header's metadata holds checksums (XXH3, 64 bits) of the header itself and of every block of every array: what is
accepted is what was written.

Based on: https://huggingface.co/docs/safetensors, "Format".
"""

from __future__ import annotations

import json
import math
import mmap
import os
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import xxhash

from hierarchy.atomic_file import replacing

DTYPES = {name: np.dtype(code) for name, code in (
    ("F64", "<f8"), ("F32", "<f4"), ("U32", "<u4"), ("I32", "<i4"), ("U16", "<u2"), ("U8", "|u1"),
)}  # fmt: skip
NAMES = {dtype: name for name, dtype in DTYPES.items()}

# Where the arrays begin. All elements are aligned then, and kernels need not be compiled again for some that are not.
ALIGNMENT = 64
# Bytes under one checksum: threads check different blocks, and the numbers are still in the cache for the next check.
BLOCK = 1 << 20
THREADS = 4
# So many blocks one thread has checked before others have begun, a millisecond.
FEW = 8
LONGEST_HEADER = 16 << 20
NO_CHECKSUM = "0" * 16


class DamagedFile(Exception):
    """A file does not hold what it should. The message says why in a few words."""


def write_tensors(
    path: Path,
    tensors: Mapping[str, np.ndarray],
    metadata: Mapping[str, str],
    progress: Callable[[float], None] = lambda fraction: None,
) -> int:
    """Write arrays and strings to a file, whole or not at all (atomic_file.py), and return its size in bytes.

    tensors : of the dtypes in DTYPES
    metadata : keys other than "checksum" and "blocks"
    progress : called with the fraction written; an exception that it raises ends the work and leaves nothing behind
    Raises OSError.
    """
    # The format allows no gaps; with larger elements before smaller ones all of them are aligned.
    items = sorted(tensors.items(), key=lambda item: -item[1].itemsize)
    parts = {name: np.ascontiguousarray(array).reshape(-1).view(np.uint8).data for name, array in items}
    header = _header({name: (array.dtype, array.shape) for name, array in items}, parts, metadata)
    size = len(header) + sum(map(len, parts.values()))
    written = 0
    with replacing(path) as file:
        written += file.write(header)
        for data in parts.values():
            for begin in range(0, len(data), BLOCK):
                progress(written / size)
                written += file.write(data[begin : begin + BLOCK])
    return size


def map_tensors(path: Path) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Map a file's arrays and return them with its metadata; every byte has been checked.

    The arrays may be written to, which changes neither the file nor what others see of it, and stay valid when the
    file is replaced or removed. (Read-only ones would have every kernel compiled a second time.)
    Raises DamagedFile, also where a float is not finite; OSError.
    """
    with _opened(path) as file:
        header, size = _read_header(file)
        entries, metadata = _parse(header)
        places = _places(entries, len(header), size)
        mapped = mmap.mmap(file.fileno(), size, access=mmap.ACCESS_COPY)
    tensors = {
        name: np.frombuffer(mapped, dtype, math.prod(shape), offset).reshape(shape)
        for name, (dtype, shape, offset) in places.items()
    }
    _check_blocks(tensors, metadata)
    return tensors, metadata


def read_metadata(path: Path) -> dict[str, str]:
    """Read a file's metadata; the header and the file's length have been checked. Raises DamagedFile, OSError."""
    with _opened(path) as file:
        header, size = _read_header(file)
    entries, metadata = _parse(header)
    _places(entries, len(header), size)
    return metadata


def _header(
    kinds: Mapping[str, tuple[np.dtype, tuple[int, ...]]],
    parts: Mapping[str, memoryview],
    metadata: Mapping[str, str],
) -> bytes:
    """Return the length and the JSON, padded by blanks up to where the arrays begin."""
    blocks = {name: "".join(_digests(data)) for name, data in parts.items()}
    described: dict[str, Any] = {"__metadata__": {**metadata, "blocks": json.dumps(blocks), "checksum": NO_CHECKSUM}}
    offset = 0
    for name, (dtype, shape) in kinds.items():
        end = offset + len(parts[name])
        described[name] = {"dtype": NAMES[dtype], "shape": list(shape), "data_offsets": [offset, end]}
        offset = end
    text = json.dumps(described, separators=(",", ":")).encode()
    text += b" " * (-(8 + len(text)) % ALIGNMENT)
    header = len(text).to_bytes(8, "little") + text
    marked = f'"checksum":"{NO_CHECKSUM}"'.encode()
    checksum = f'"checksum":"{xxhash.xxh3_64_hexdigest(header)}"'.encode()
    # What comes from outside stands before it in the metadata and may hold the same characters.
    before, _, after = header.rpartition(marked)
    return before + checksum + after


def _digests(data: memoryview) -> list[str]:
    return [xxhash.xxh3_64_hexdigest(data[begin : begin + BLOCK]) for begin in range(0, len(data), BLOCK)]


def _opened(path: Path) -> BinaryIO:
    if path.exists() and not path.is_file():
        # A pipe, for one, would have to be waited for.
        raise DamagedFile("it is no file")
    return path.open("rb")


def _read_header(file: BinaryIO) -> tuple[bytes, int]:
    """Return the header with the length before it, and the file's size."""
    size = os.fstat(file.fileno()).st_size
    start = file.read(8)
    length = int.from_bytes(start, "little")
    if len(start) < 8 or not 2 <= length <= min(size - 8, LONGEST_HEADER):
        raise DamagedFile("it has no header")
    return start + file.read(length), size


def _parse(header: bytes) -> tuple[dict[str, Any], dict[str, str]]:
    """Check the header's checksum; return what it says of the arrays, and the metadata."""
    try:
        described = json.loads(header[8:])
        metadata = described.pop("__metadata__")
        checksum = f'"checksum":"{metadata["checksum"]}"'.encode()
        strings = all(isinstance(value, str) for value in metadata.values())
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        raise DamagedFile("its header cannot be read") from error
    before, found, after = header.rpartition(checksum)
    unmarked = before + f'"checksum":"{NO_CHECKSUM}"'.encode() + after
    if not found or not strings or xxhash.xxh3_64_hexdigest(unmarked) != metadata["checksum"]:
        raise DamagedFile("its header does not match its checksum")
    return described, metadata


def _places(entries: Mapping[str, Any], start: int, size: int) -> dict[str, tuple[np.dtype, tuple[int, ...], int]]:
    """Return dtype, shape and place of every array: one behind the other from `start` up to the end of the file."""
    places = {}
    offset = start
    try:
        for name, entry in entries.items():
            dtype, shape = DTYPES[entry["dtype"]], tuple(int(extent) for extent in entry["shape"])
            nbytes = math.prod(shape) * dtype.itemsize
            if min(shape, default=0) < 0 or entry["data_offsets"] != [offset - start, offset - start + nbytes]:
                raise DamagedFile("its arrays do not lie one behind the other")
            places[name] = dtype, shape, offset
            offset += nbytes
    except (LookupError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise DamagedFile("its header does not describe arrays") from error
    if offset != size:
        raise DamagedFile(f"it has {size} bytes instead of {offset}")
    return places


def _check_blocks(tensors: Mapping[str, np.ndarray], metadata: Mapping[str, str]) -> None:
    """Compare all blocks with their checksums, and look for floats that are not finite."""
    try:
        expected = {name: str(digests) for name, digests in json.loads(metadata["blocks"]).items()}
    except (ValueError, LookupError, AttributeError) as error:
        raise DamagedFile("it has no checksums") from error
    work = []
    for name, array in tensors.items():
        step = BLOCK // array.itemsize
        digests, flat = expected.get(name, ""), array.reshape(-1)
        if len(digests) != 16 * -(-len(flat) // step):
            raise DamagedFile(f"checksums of {name} are missing")
        for number, begin in enumerate(range(0, len(flat), step)):
            work.append((name, flat[begin : begin + step], digests[16 * number : 16 * number + 16]))
    # Both the checksum and numpy let go of the interpreter lock.
    with ThreadPoolExecutor(THREADS) as pool:
        for name, good in (map if len(work) <= FEW else pool.map)(_is_good, work):
            if not good:
                raise DamagedFile(f"its {name} are not what was written")


def _is_good(block: tuple[str, np.ndarray, str]) -> tuple[str, bool]:
    name, values, digest = block
    good = xxhash.xxh3_64_hexdigest(values.data) == digest
    return name, good and (values.dtype.kind != "f" or bool(np.isfinite(values).all()))
