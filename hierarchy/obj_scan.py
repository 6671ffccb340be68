"""Compiled scan of an OBJ file's lines: vertices, texture coordinates, normals and faces become flat arrays.

Based on: Wavefront Technologies, Object Files (.obj), Advanced Visualizer manual, appendix B1.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from hierarchy.model import Float64Array, UInt8Array
from hierarchy.part import Int64Array

OTHER, VERTEX, TEXTURE, NORMAL, FACE = 0, 1, 2, 3, 4

# No file has so many lines; a number that is longer stays here instead of overflowing.
LARGEST_INDEX = np.int64(1 << 40)

BLANK, TAB, RETURN, NEWLINE = 32, 9, 13, 10
SLASH, MINUS, PLUS, POINT = 47, 45, 43, 46
DIGIT_0, DIGIT_9 = 48, 57
LOWER_E, UPPER_E = 101, 69
LOWER_F, LOWER_N, LOWER_T, LOWER_V = 102, 110, 116, 118


@njit(cache=True, nogil=True)
def count_lines(text: UInt8Array) -> Int64Array:
    """Return how many lines of each kind (OTHER to FACE) there are, and in the last place how many face corners."""
    counts = np.zeros(6, np.int64)
    at = 0
    while at < len(text):
        kind, at = _line_kind(text, at)
        counts[kind] += 1
        if kind == FACE:
            at = _skip_blanks(text, at)
            while not _is_end(text, at):
                counts[5] += 1
                while not _is_end(text, at) and text[at] != BLANK and text[at] != TAB:
                    at += 1
                at = _skip_blanks(text, at)
        at = _next_line(text, at)
    return counts


@njit(cache=True, nogil=True)
def scan_lines(
    text: UInt8Array, counts: Int64Array
) -> tuple[Float64Array, Float64Array, Float64Array, Int64Array, Int64Array, Int64Array]:
    """Read the lines that `count_lines` counted.

    Returns vertices (V, 6): x y z, and r g b or NaN; texture coordinates (M, 2); normals (N, 3); for each face
    its number of corners and the byte where its line starts, (F, 2); and for each corner the vertex, texture
    coordinate and normal, (C, 3), from 0, with -1 for none; other indices that make no sense are kept below -1.
    """
    vertices = np.full((counts[VERTEX], 6), math.nan)
    coordinates = np.zeros((counts[TEXTURE], 2))
    normals = np.full((counts[NORMAL], 3), math.nan)
    faces = np.zeros((counts[FACE], 2), np.int64)
    corners = np.full((counts[5], 3), -1, np.int64)
    sizes = np.zeros(3, np.int64)
    face = corner = at = 0
    while at < len(text):
        start = at
        kind, at = _line_kind(text, at)
        if kind == VERTEX:
            _read_numbers(text, at, vertices[sizes[0]])
            sizes[0] += 1
        elif kind == TEXTURE:
            _read_numbers(text, at, coordinates[sizes[1]])
            sizes[1] += 1
        elif kind == NORMAL:
            _read_numbers(text, at, normals[sizes[2]])
            sizes[2] += 1
        elif kind == FACE:
            faces[face, 1] = start
            at = _skip_blanks(text, at)
            while not _is_end(text, at):
                at = _read_corner(text, at, sizes, corners[corner])
                corner += 1
                faces[face, 0] += 1
                at = _skip_blanks(text, at)
            face += 1
        at = _next_line(text, at)
    return vertices, coordinates, normals, faces[:, 0].copy(), faces[:, 1].copy(), corners


@njit(cache=True, nogil=True)
def _is_end(text: UInt8Array, at: int) -> bool:
    return at >= len(text) or text[at] == NEWLINE or text[at] == RETURN


@njit(cache=True, nogil=True)
def _skip_blanks(text: UInt8Array, at: int) -> int:
    while at < len(text) and (text[at] == BLANK or text[at] == TAB):
        at += 1
    return at


@njit(cache=True, nogil=True)
def _next_line(text: UInt8Array, at: int) -> int:
    while not _is_end(text, at):
        at += 1
    return at + 1


@njit(cache=True, nogil=True)
def _line_kind(text: UInt8Array, at: int) -> tuple[int, int]:
    """Return the kind of the line at `at` and the byte after its keyword."""
    at = _skip_blanks(text, at)
    end = at
    while not _is_end(text, end) and text[end] != BLANK and text[end] != TAB:
        end += 1
    if end - at == 1:
        if text[at] == LOWER_V:
            return VERTEX, end
        if text[at] == LOWER_F:
            return FACE, end
    elif end - at == 2 and text[at] == LOWER_V:
        if text[at + 1] == LOWER_T:
            return TEXTURE, end
        if text[at + 1] == LOWER_N:
            return NORMAL, end
    return OTHER, end


@njit(cache=True, nogil=True)
def _read_numbers(text: UInt8Array, at: int, row: Float64Array) -> None:
    """Fill `row` with the numbers of a line as far as there are any; a word that is no number leaves NaN."""
    for k in range(len(row)):
        at = _skip_blanks(text, at)
        if _is_end(text, at):
            return
        row[k], at = _read_number(text, at)


@njit(cache=True, nogil=True)
def _read_number(text: UInt8Array, at: int) -> tuple[float, int]:
    """Return the number at `at`, or NaN, and the byte after the word."""
    negative = text[at] == MINUS
    if negative or text[at] == PLUS:
        at += 1
    mantissa, digits, exponent = np.int64(0), 0, 0
    after_point = False
    good = False
    while at < len(text):
        c = text[at]
        if DIGIT_0 <= c <= DIGIT_9:
            good = True
            # 18 digits fit into 64 bits, and doubles hold fewer.
            if digits < 18:
                mantissa = mantissa * 10 + (c - DIGIT_0)
                digits += 1 if mantissa > 0 else 0
                exponent -= 1 if after_point else 0
            else:
                exponent += 0 if after_point else 1
        elif c == POINT and not after_point:
            after_point = True
        else:
            break
        at += 1
    if good and at < len(text) and (text[at] == LOWER_E or text[at] == UPPER_E):
        at += 1
        negative_power = at < len(text) and text[at] == MINUS
        if at < len(text) and (text[at] == MINUS or text[at] == PLUS):
            at += 1
        power = 0
        while at < len(text) and DIGIT_0 <= text[at] <= DIGIT_9:
            power = min(power * 10 + (text[at] - DIGIT_0), 9999)
            at += 1
        exponent += -power if negative_power else power
    while not _is_end(text, at) and text[at] != BLANK and text[at] != TAB:
        good = False
        at += 1
    # Powers of ten up to 22 are exact in doubles, so that most numbers are rounded once.
    value = float(mantissa)
    if exponent < -22:
        value = value / 1e22 * math.pow(10.0, max(exponent, -400) + 22.0)
    elif exponent < 0:
        value = value / math.pow(10.0, -exponent)
    elif mantissa != 0:
        value = value * math.pow(10.0, min(exponent, 400))
    if not good:
        value = math.nan
    return -value if negative else value, at


@njit(cache=True, nogil=True)
def _read_corner(text: UInt8Array, at: int, sizes: Int64Array, corner: Int64Array) -> int:
    """Read v, v/t, v//n or v/t/n; an index below 0 counts back from the last one so far. Return the byte after it."""
    column = 0
    while not _is_end(text, at) and text[at] != BLANK and text[at] != TAB:
        if text[at] == SLASH:
            column += 1
            at += 1
            continue
        negative = text[at] == MINUS
        if negative or text[at] == PLUS:
            at += 1
        index = np.int64(0)
        good = False
        while at < len(text) and DIGIT_0 <= text[at] <= DIGIT_9:
            index = min(index * 10 + (text[at] - DIGIT_0), LARGEST_INDEX)
            good = True
            at += 1
        bad_end = not _is_end(text, at) and text[at] != BLANK and text[at] != TAB and text[at] != SLASH
        if bad_end:
            at += 1
        if column < 3:
            if not good or bad_end or index == 0:
                corner[column] = -2
            elif negative:
                # One that leads before the first must not look like "none".
                corner[column] = sizes[column] - index if index <= sizes[column] else -2
            else:
                corner[column] = index - 1
    return at
