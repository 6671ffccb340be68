"""Hand parts from one process to another as bytes: a line of JSON for each, then its arrays.

Never a pickle, which could make the receiver call anything. The receiver fixes the dtypes and takes only shapes that
agree with one another.
"""

from __future__ import annotations

import json
from typing import Any, BinaryIO

import numpy as np

from hierarchy.part import AnyArray, Part

# The arrays of a part in the order in which they are sent, and the dtype of each.
ARRAYS: dict[str, type[np.generic]] = {
    "positions": np.float64,
    "faces": np.int64,
    "normals": np.float64,
    "colors": np.uint8,
    "texture_coordinates": np.float64,
    "texture": np.uint8,
}

# A path may have 4,096 characters, each of which JSON may write as six.
LONGEST_LINE = 1 << 17


class BrokenStream(Exception):
    """The sender ended early, or sent what makes no sense."""


def send_message(stream: BinaryIO, message: dict[str, Any]) -> None:
    """Send a message: names and values that JSON knows, shorter than `LONGEST_LINE`."""
    stream.write(json.dumps(message).encode("ascii") + b"\n")
    stream.flush()


def receive_message(stream: BinaryIO) -> dict[str, Any]:
    """Receive a message. Raises BrokenStream."""
    line = stream.readline(LONGEST_LINE)
    try:
        message = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise BrokenStream from error
    if not isinstance(message, dict):
        raise BrokenStream
    return message


def send_part(stream: BinaryIO, part: Part) -> None:
    """Send {"part": shapes, ...} and the arrays."""
    arrays = {name: getattr(part, name) for name in ARRAYS}
    shapes = {name: list(array.shape) for name, array in arrays.items() if array is not None}
    color = None if part.material_color is None else [int(value) for value in part.material_color]
    send_message(
        stream,
        {
            "part": shapes,
            "texture_name": part.texture_name,
            "material_color": color,
            "bad_faces": int(part.bad_faces),
            "copies": part.copies,
        },
    )
    for name, dtype in ARRAYS.items():
        # An empty array has no bytes to look at.
        if name in shapes and arrays[name].size:
            stream.write(np.ascontiguousarray(arrays[name], dtype).data.cast("B"))
    stream.flush()


def receive_part(stream: BinaryIO, message: dict[str, Any], most_bytes: int) -> tuple[Part, int]:
    """Receive the arrays that `message` announced, of `most_bytes` at most; return the part and its bytes.

    Raises BrokenStream.
    """
    try:
        shapes = {name: tuple(int(length) for length in message["part"][name]) for name in message["part"]}
        color = message["material_color"]
        red, green, blue, alpha = (int(value) for value in color or (0, 0, 0, 0))
        bad_faces, texture_name = int(message["bad_faces"]), message["texture_name"]
        copies = int(message["copies"])
    except (LookupError, TypeError, ValueError, OverflowError) as error:
        raise BrokenStream from error
    _check_shapes(shapes)
    total = sum(int(np.prod(shape, dtype=object)) * np.dtype(ARRAYS[name]).itemsize for name, shape in shapes.items())
    if total > most_bytes:
        raise BrokenStream
    arrays: dict[str, Any] = {
        name: _receive_array(stream, shapes[name], dtype) for name, dtype in ARRAYS.items() if name in shapes
    }
    part = Part(**arrays, bad_faces=bad_faces, copies=copies)
    part.texture_name = None if texture_name is None else str(texture_name)
    part.material_color = None if color is None else (red, green, blue, alpha)
    return part, total


def _check_shapes(shapes: dict[str, tuple[int, ...]]) -> None:
    vertices = shapes.get("positions", (-1,))[0]
    expected = {
        "positions": (vertices, 3),
        "faces": (shapes.get("faces", (-1,))[0], 3),
        "normals": (vertices, 3),
        "colors": (vertices, 4),
        "texture_coordinates": (vertices, 2),
        "texture": (*shapes.get("texture", (-1, -1))[:2], 4),
    }
    for name, shape in shapes.items():
        if shape != expected.get(name) or min(shape) < 0:
            raise BrokenStream
    if "positions" not in shapes:
        raise BrokenStream


def _receive_array(stream: BinaryIO, shape: tuple[int, ...], dtype: type[np.generic]) -> AnyArray:
    array: AnyArray = np.empty(shape, dtype)
    if array.size == 0:
        return array
    # One buffered read may stop at what the pipe holds.
    view, place = array.data.cast("B"), 0
    while place < len(view):
        got = stream.readinto(view[place:])  # type: ignore[attr-defined]
        if not got:
            raise BrokenStream
        place += got
    return array
