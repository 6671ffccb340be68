"""The pages of an E57 file: 1,020 bytes of content and their checksum each.

Based on: ASTM E2807-11, "Standard Specification for 3D Imaging Data Exchange", 2011, sections 6 and 7. What the format
calls physical counts the checksums, what it calls logical does not.
"""

from __future__ import annotations

import os
import struct
from typing import BinaryIO

import numba
import numpy as np

from hierarchy.model import UInt8Array, UInt32Array
from hierarchy.part import AnyArray, UnreadableFile

PAGE, CONTENT = 1024, 1020
HEADER = struct.Struct("<8sIIQQQQ")

# Starting threads costs as much as this many pages, and a small file may have thousands of scans of one page each.
MANY = 256

# Castagnoli's polynomial, lowest bit first.
POLYNOMIAL = 0x82F63B78


class PagedFile:
    """The content of an open E57 file, which is checked page by page as it is read.

    Raises UnreadableFile where it is none, and OSError.
    """

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self.size = os.fstat(stream.fileno()).st_size
        header = stream.read(HEADER.size)
        if len(header) < HEADER.size:
            raise UnreadableFile("truncated: the file ends in its header")
        signature, major, _, _, self._xml_start, self._xml_length, page = HEADER.unpack(header)
        if signature != b"ASTM-E57" or major != 1 or page != PAGE:
            raise UnreadableFile("not an E57 file of version 1")

    def description(self) -> str:
        """Return the XML that describes the file. Raises UnreadableFile."""
        try:
            return self.read(self._xml_start, self._xml_length).tobytes().decode("utf-8")
        except UnicodeDecodeError:
            raise UnreadableFile("damaged: its description is no text") from None

    def read(self, start: int, length: int) -> UInt8Array:
        """Return uint8 (length,): content from a physical offset on.

        Raises UnreadableFile where the file ends before or a checksum does not agree.
        """
        first, skip = divmod(start, PAGE)
        pages = -(-(skip + length) // CONTENT)
        if start < 0 or length < 0 or skip >= CONTENT:
            raise UnreadableFile("damaged: it refers to a place that is none")
        if (first + pages) * PAGE > self.size:
            raise UnreadableFile("truncated: the file ends before its content does")
        self._stream.seek(first * PAGE)
        data = np.frombuffer(self._stream.read(pages * PAGE), np.uint8)
        if len(data) < pages * PAGE:
            raise UnreadableFile("truncated: the file became shorter while it was read")
        data = data.reshape(-1, PAGE)
        stored = data[:, CONTENT:].copy().view(">u4")[:, 0]
        wrong = np.flatnonzero(page_checksums(data) != stored)
        if len(wrong):
            raise UnreadableFile(f"damaged: page {first + int(wrong[0])} does not agree with its checksum")
        return data[:, :CONTENT].ravel()[skip : skip + length]


def logical(physical: int) -> int:
    """Return the offset in content of an offset in the file."""
    return physical // PAGE * CONTENT + physical % PAGE


def _checksum_table() -> UInt32Array:
    """Return for each byte what it does to the checksum, uint32 (256,)."""
    table = np.arange(256, dtype=np.uint32)
    for _ in range(8):
        table = np.where(table & 1, (table >> 1) ^ np.uint32(POLYNOMIAL), table >> 1).astype(np.uint32)
    return table


CHECKSUM_TABLE = _checksum_table()


@numba.njit(cache=True, nogil=True)
def _page_checksum(page: AnyArray, table: AnyArray) -> np.uint32:
    checksum = np.uint32(0xFFFFFFFF)
    for byte in page[:CONTENT]:
        checksum = table[(checksum ^ byte) & np.uint32(0xFF)] ^ (checksum >> np.uint32(8))
    return checksum ^ np.uint32(0xFFFFFFFF)


def page_checksums(pages: AnyArray) -> UInt32Array:
    """Return the CRC-32C of the content of each of `pages`, uint8 (P, 1024): uint32 (P,)."""
    checksums: UInt32Array = (_few_checksums if len(pages) < MANY else _many_checksums)(pages, CHECKSUM_TABLE)
    return checksums


@numba.njit(cache=True, nogil=True)
def _few_checksums(pages: AnyArray, table: AnyArray) -> AnyArray:
    checksums = np.empty(len(pages), np.uint32)
    for i in range(len(pages)):
        checksums[i] = _page_checksum(pages[i], table)
    return checksums


@numba.njit(cache=True, nogil=True, parallel=True)
def _many_checksums(pages: AnyArray, table: AnyArray) -> AnyArray:
    checksums = np.empty(len(pages), np.uint32)
    for i in numba.prange(len(pages)):
        checksums[i] = _page_checksum(pages[i], table)
    return checksums
