"""Damage to files: of bits and bytes, of numbers in text and in binary, of lines, and of pieces that change places."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable

import numpy as np

# Numbers at which something overflows, changes its sign, or is no number any more.
NUMBERS = ("0", "-1", "1", "2", "255", "256", "65535", "65536", "2147483647", "2147483648", "-2147483648", "4294967295",
           "9223372036854775807", "9223372036854775808", "18446744073709551616", "-9223372036854775809", "1e300",
           "-1e300", "1e-300", "1e999", "nan", "inf", "-inf", "0x10", "1_000", "", "9" * 400, "1e", "--5", "0.1.2",
           "٣", "1e38", "3.5e38", "1e-45", "1000000", "99999")  # fmt: skip
INTEGERS = (0, 1, -1, 2, 127, 128, 255, 256, 32767, 32768, 65535, 65536, 2**31 - 1, 2**31, 2**32 - 1, 2**62, 2**63 - 1,
            2**63, 2**64 - 1, 1000, 1_000_000)  # fmt: skip
FLOATS = (np.nan, np.inf, -np.inf, 1e38, -3e38, 1e-45, 1e300, -1e300, 1e-310, 0.0, -0.0)
NUMBER = re.compile(rb"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
WORD = re.compile(rb"[A-Za-z_]+")

# What a piece is repeated at most; longer files are for hand-made cases.
MOST_COPIES = 50
LARGEST = 60_000

Damage = Callable[[np.random.Generator, bytearray, bytes], None]


def mutate(rng: np.random.Generator, data: bytes, donor: bytes, *, is_text: bool) -> bytes:
    """Return `data` with one to four kinds of damage; pieces come from `donor`, too."""
    damaged = bytearray(data)
    choices = BINARY + (3 * TEXT if is_text else HEADER)
    for _ in range(1 + min(int(rng.exponential(1.0)), 3)):
        choices[rng.integers(len(choices))](rng, damaged, donor)
        if not damaged:
            break
    return bytes(damaged[:LARGEST])


def place(rng: np.random.Generator, size: int) -> int:
    """Return an offset into `size` bytes; every second one is nearer to the start, where headers are."""
    if size <= 1:
        return 0
    if rng.random() < 0.5:
        return int(rng.integers(size))
    return min(int(size ** rng.random()), size - 1)


def piece(rng: np.random.Generator, size: int) -> tuple[int, int]:
    """Return where a piece of a file begins and ends."""
    start = place(rng, size)
    return start, min(size, start + 1 + int(size ** rng.random()))


def flip_bits(rng: np.random.Generator, data: bytearray, donor: bytes) -> None:
    for _ in range(1 + int(rng.integers(8))):
        data[place(rng, len(data))] ^= 1 << int(rng.integers(8))


def run_of_bytes(rng: np.random.Generator, data: bytearray, donor: bytes) -> None:
    start, end = piece(rng, len(data))
    what = rng.integers(4)
    if what == 0:
        data[start:end] = rng.integers(0, 256, end - start).astype(np.uint8).tobytes()
    else:
        data[start:end] = bytes([(0, 255, 32)[what - 1]]) * (end - start)


def cut_off(rng: np.random.Generator, data: bytearray, donor: bytes) -> None:
    del data[place(rng, len(data)) :]


def remove(rng: np.random.Generator, data: bytearray, donor: bytes) -> None:
    start, end = piece(rng, len(data))
    del data[start:end]


def repeat(rng: np.random.Generator, data: bytearray, donor: bytes) -> None:
    start, end = piece(rng, len(data))
    copies = 1 + int(MOST_COPIES ** rng.random())
    data[end:end] = (bytes(data[start:end]) * copies)[:LARGEST]


def swap(rng: np.random.Generator, data: bytearray, donor: bytes) -> None:
    (a, b), (c, d) = sorted([piece(rng, len(data)), piece(rng, len(data))])
    if b <= c:
        data[a:d] = data[c:d] + data[b:c] + data[a:b]


def borrow(rng: np.random.Generator, data: bytearray, donor: bytes) -> None:
    start, end = piece(rng, max(len(donor), 1))
    at = place(rng, len(data))
    over = at + (end - start if rng.random() < 0.5 else 0)
    data[at:over] = donor[start:end]


def write_number(rng: np.random.Generator, data: bytearray, donor: bytes) -> None:
    """Write an integer or a float of any width and byte order over what is there, mostly where one may stand."""
    order = "<>"[rng.integers(2)]
    if rng.random() < 0.3:
        form = "fd"[rng.integers(2)]
        value = FLOATS[rng.integers(len(FLOATS))]
        with np.errstate(over="ignore"):
            raw = np.array(value, np.float64).astype(order + form).tobytes()
    else:
        width = int(2 ** rng.integers(4))
        raw = (INTEGERS[rng.integers(len(INTEGERS))] % 2 ** (8 * width)).to_bytes(
            width, "big" if order == ">" else "little"
        )
    at = place(rng, len(data))
    if rng.random() < 0.7:
        at -= at % len(raw)
    data[at : at + len(raw)] = raw


def nudge_number(rng: np.random.Generator, data: bytearray, donor: bytes) -> None:
    """Add a little to an integer of 16 or 32 bits."""
    form = ("<H", "<I", ">H", ">I")[rng.integers(4)]
    size = struct.calcsize(form)
    at = place(rng, len(data))
    if at + size <= len(data):
        (value,) = struct.unpack_from(form, data, at)
        struct.pack_into(form, data, at, (value + int(rng.integers(-3, 4))) % 2 ** (8 * size))


def _replace_match(rng: np.random.Generator, data: bytearray, pattern: re.Pattern[bytes], by: bytes) -> None:
    found = pattern.search(data, place(rng, len(data))) or pattern.search(data)
    if found:
        data[found.start() : found.end()] = by


def edit_number(rng: np.random.Generator, data: bytearray, donor: bytes) -> None:
    _replace_match(rng, data, NUMBER, NUMBERS[rng.integers(len(NUMBERS))].encode())


def edit_word(rng: np.random.Generator, data: bytearray, donor: bytes) -> None:
    words = WORD.findall(data) + WORD.findall(donor)
    if words:
        _replace_match(rng, data, WORD, bytes(words[rng.integers(len(words))]))


def edit_lines(rng: np.random.Generator, data: bytearray, donor: bytes) -> None:
    lines = bytes(data).splitlines(keepends=True)
    if not lines:
        return
    a, b = place(rng, len(lines)), place(rng, len(lines))
    what = rng.integers(4)
    if what == 0:
        del lines[a]
    elif what == 1:
        lines.insert(b, lines[a])
    elif what == 2:
        lines[a], lines[b] = lines[b], lines[a]
    else:
        lines.insert(a, rng.integers(0, 256, 40).astype(np.uint8).tobytes() + b"\n")
    data[:] = b"".join(lines)


BINARY: tuple[Damage, ...] = (
    flip_bits,
    run_of_bytes,
    cut_off,
    remove,
    repeat,
    swap,
    borrow,
    write_number,
    nudge_number,
)
TEXT: tuple[Damage, ...] = (edit_number, edit_number, edit_word, edit_lines)
HEADER: tuple[Damage, ...] = (write_number, write_number, edit_number, edit_word)
