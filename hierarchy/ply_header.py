"""The header of a PLY file: its byte order and the elements that follow.

Based on: Greg Turk, The PLY Polygon File Format, 1994.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hierarchy.part import UnreadableFile

# Both families of names are in use: Turk's own and the sized ones that VCGLIB and others write.
SCALAR_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "float32": "f4", "float64": "f8", "int64": "i8", "uint64": "u8",
}  # fmt: skip

BYTE_ORDERS: dict[str, Literal["<", ">", "="]] = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": "="}

# A header is some dozens of lines; a file without its end in the first mebibyte is no PLY.
LONGEST_HEADER = 1 << 20


@dataclass(frozen=True)
class Property:
    """One property of an element: a scalar, or a list where `count_type` is set. Types are numpy's, with byte order."""

    name: str
    type: np.dtype[np.generic]
    count_type: np.dtype[np.generic] | None = None

    @property
    def smallest_size(self) -> int:
        """Bytes that one row takes at least."""
        return self.type.itemsize if self.count_type is None else self.count_type.itemsize


@dataclass(frozen=True)
class Element:
    """One element of the file: `count` rows of `properties`."""

    name: str
    count: int
    properties: tuple[Property, ...]


@dataclass(frozen=True)
class Header:
    """What the header says; `size` is the byte at which the data start."""

    ascii: bool
    elements: tuple[Element, ...]
    texture_name: str | None
    size: int


def parse_header(data: bytes) -> Header:
    """Parse the header at the start of `data`. Raises UnreadableFile."""
    ending = re.match(rb"ply[ \t]*(\r\n|\n|\r)", data)
    if ending is None:
        raise UnreadableFile("not a PLY file")
    found = re.compile(rb"[\r\n]end_header[ \t]*" + re.escape(ending[1])).search(data, 0, LONGEST_HEADER)
    if found is None:
        if re.search(rb"[\r\n]end_header[ \t]*$", data[:LONGEST_HEADER]):
            return _parse_lines(data.decode("latin-1").splitlines(), len(data))
        raise UnreadableFile("truncated: the PLY header has no end")
    return _parse_lines(data[: found.end()].decode("latin-1").splitlines(), found.end())


def _parse_lines(lines: list[str], size: int) -> Header:
    """Parse the header's lines; `size` is its length in bytes."""
    byte_order: Literal["<", ">", "="] | None = None
    texture_name: str | None = None
    elements: list[tuple[str, int, list[Property]]] = []
    for line in lines[1:]:
        words = line.split()
        try:
            match words:
                case ["format", name, *_]:
                    byte_order = BYTE_ORDERS[name]
                case ["comment" | "obj_info", "TextureFile", *_]:
                    # The name may hold blanks.
                    texture_name = line.split("TextureFile", 1)[1].strip() or None
                case ["element", name, count]:
                    if int(count) < 0:
                        raise ValueError
                    elements.append((name, int(count), []))
                case ["property", "list", count_type, item_type, name]:
                    elements[-1][2].append(
                        Property(name, _scalar_type(item_type, byte_order), _scalar_type(count_type, byte_order))
                    )
                case ["property", item_type, name]:
                    elements[-1][2].append(Property(name, _scalar_type(item_type, byte_order)))
                case ["element" | "property" | "format", *_]:
                    raise ValueError
        except (ValueError, KeyError, IndexError):
            raise UnreadableFile(f"a line of the PLY header makes no sense: {line[:60]!r}") from None
    if byte_order is None:
        raise UnreadableFile("the PLY header names no format")
    return Header(byte_order == "=", tuple(Element(n, c, tuple(p)) for n, c, p in elements), texture_name, size)


def _scalar_type(name: str, byte_order: Literal["<", ">", "="] | None) -> np.dtype[np.generic]:
    if byte_order is None:
        raise ValueError("a property before the format")
    return np.dtype(SCALAR_TYPES[name]).newbyteorder(byte_order)
