"""The points of an E57 scan: packets, which bring a piece of one stream of bits for every field.

Based on: ASTM E2807-11, sections 9.3 to 9.6.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numba
import numpy as np

from hierarchy.e57_pages import PagedFile, logical
from hierarchy.model import Float64Array
from hierarchy.part import AnyArray, UnreadableFile

SECTION = struct.Struct("<B7xQQQ")
SECTION_POINTS = 1

# Starting threads costs as much as unpacking this many values, and a small file may have thousands of scans.
MANY = 1 << 15

PACKET_INDEX, PACKET_DATA, PACKET_IGNORED = 0, 1, 2


@dataclass(frozen=True)
class Field:
    """How the values of a field are stored.

    bits : of one value, 0 where all are `minimum`
    floating : values are floats of 32 or 64 bits; otherwise unsigned integers, to which `minimum` is added before
        they are multiplied by `scale` and `offset` is added
    maximum : the largest value before it is scaled; None where the file does not say
    """

    name: str
    bits: int
    floating: bool = False
    minimum: int = 0
    maximum: int | None = None
    scale: float = 1.0
    offset: float = 0.0


def section_length(file: PagedFile, start: int) -> int:
    """Return the length in bytes of the section at a physical offset, its header included. Raises UnreadableFile."""
    kind, length, _, _ = SECTION.unpack(file.read(start, SECTION.size).tobytes())
    if kind != SECTION_POINTS or length < SECTION.size:
        raise UnreadableFile("damaged: it has no points where it says they are")
    return int(length)


def read_columns(
    file: PagedFile, start: int, count: int, fields: Sequence[Field], wanted: set[str]
) -> dict[str, Float64Array]:
    """Return the values of the wanted fields, float64 (count,) each.

    start : physical offset of the section
    fields : all that the points have, in the file's order
    Raises UnreadableFile where there are fewer.
    """
    section = file.read(start, section_length(file, start))
    _, _, data_start, _ = SECTION.unpack(section[: SECTION.size].tobytes())
    chosen = {i: field for i, field in enumerate(fields) if field.name in wanted}
    needs = {i: (count * field.bits + 7) // 8 for i, field in chosen.items()}
    streams = _streams(section.tobytes(), logical(data_start) - logical(start), len(fields), needs)
    return {field.name: _decode(streams[i], count, field) for i, field in chosen.items()}


def _streams(section: bytes, place: int, fields: int, needs: dict[int, int]) -> dict[int, bytes]:
    """Put together the pieces of the streams whose numbers are in `needs`, until each has the bytes it needs.

    place : where in the section the first packet begins
    """
    pieces: dict[int, list[bytes]] = {i: [] for i in needs}
    missing = dict(needs)
    while any(need > 0 for need in missing.values()):
        if not SECTION.size <= place <= len(section) - 4:
            raise UnreadableFile("truncated or damaged: it holds fewer points than it promises")
        kind, length = section[place], int.from_bytes(section[place + 2 : place + 4], "little") + 1
        if kind == PACKET_DATA:
            _take_pieces(section[place : place + length], fields, pieces, missing)
        elif kind not in (PACKET_INDEX, PACKET_IGNORED):
            raise UnreadableFile("damaged: it has a packet of unknown kind")
        place += length
    return {i: b"".join(each) for i, each in pieces.items()}


def _take_pieces(packet: bytes, fields: int, pieces: dict[int, list[bytes]], missing: dict[int, int]) -> None:
    head = packet[4 : 6 + 2 * fields]
    lengths = np.frombuffer(head, "<u2", len(head) // 2)
    if len(lengths) < 1 + fields or lengths[0] != fields:
        raise UnreadableFile("damaged: a packet does not have the fields of the points")
    ends = 6 + 2 * fields + np.cumsum(lengths[1 : 1 + fields], dtype=np.int64)
    if ends[-1] > len(packet):
        raise UnreadableFile("damaged: a packet is longer than it says")
    for i, each in pieces.items():
        piece = packet[int(ends[i]) - int(lengths[1 + i]) : int(ends[i])]
        each.append(piece)
        missing[i] -= len(piece)


def _decode(stream: bytes, count: int, field: Field) -> Float64Array:
    if field.floating:
        return np.frombuffer(stream, f"<f{field.bits // 8}", count).astype(np.float64)
    if field.bits == 0:
        integers = np.full(count, field.minimum, np.int64)
    else:
        # A value may begin in the last byte but one; the kernel reads nine.
        padded = np.frombuffer(stream + bytes(9), np.uint8)
        # Modulo 2^64 the sum is right for every range that fits into signed integers.
        integers = unpack_bits(padded, field.bits, count).view(np.int64) + np.int64(field.minimum)
    return np.asarray(integers * field.scale + field.offset, np.float64)


@numba.njit(cache=True, nogil=True)
def _bits_at(data: AnyArray, place: int, bits: int) -> np.uint64:
    """Return the `bits` (1 to 64) that begin at bit `place`, lowest first."""
    byte, shift = place >> 3, np.uint64(place & 7)
    value = np.uint64(0)
    for k in range(8):
        value |= np.uint64(data[byte + k]) << np.uint64(8 * k)
    value >>= shift
    if shift:
        value |= np.uint64(data[byte + 8]) << (np.uint64(64) - shift)
    return value & (np.uint64(0xFFFFFFFFFFFFFFFF) >> np.uint64(64 - bits))


def unpack_bits(data: AnyArray, bits: int, count: int) -> AnyArray:
    """Return `count` integers of `bits` bits each from `data`, uint8 with nine bytes to spare: uint64 (count,)."""
    values: AnyArray = (_unpack_few if count < MANY else _unpack_many)(data, bits, count)
    return values


@numba.njit(cache=True, nogil=True)
def _unpack_few(data: AnyArray, bits: int, count: int) -> AnyArray:
    values = np.empty(count, np.uint64)
    for i in range(count):
        values[i] = _bits_at(data, i * bits, bits)
    return values


@numba.njit(cache=True, nogil=True, parallel=True)
def _unpack_many(data: AnyArray, bits: int, count: int) -> AnyArray:
    values = np.empty(count, np.uint64)
    for i in numba.prange(count):
        values[i] = _bits_at(data, i * bits, bits)
    return values
