"""The values of options: from what was typed to what it means, or to one line that says what it is not."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from pathlib import Path

TEXELS = (2, 4, 8, 16, 32)
OUTPUT_SUFFIXES = (".png", ".npz")

# The largest side of a picture that every OpenGL 3.3 driver in use accepts.
MAX_RESOLUTION = 16384

# The displacement of the outline that an error goal allows where only its degrees are given.
DEFAULT_MAX_PIXELS = 0.5

Vector = tuple[float, float, float]


def numbers(text: str, count: int, kind: Callable[[str], float], what: str) -> tuple[float, ...]:
    try:
        values = tuple(kind(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) != count or not all(math.isfinite(value) for value in values):
        raise argparse.ArgumentTypeError(f"{text!r} is not {what}")
    return values


def radius(text: str) -> float:
    (value,) = numbers(text, 1, float, "a number of pixels")
    if value < 0.0:
        raise argparse.ArgumentTypeError(f"{text!r} is less than 0 pixels")
    return value


def max_error(text: str) -> tuple[float, float]:
    with_pixels = text if "," in text else f"{text},{DEFAULT_MAX_PIXELS}"
    try:
        degrees, pixels = numbers(with_pixels, 2, float, "")
    except argparse.ArgumentTypeError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of degrees DEG, or DEG,PX with pixels") from None
    if degrees <= 0.0 or pixels <= 0.0:
        raise argparse.ArgumentTypeError(f"{text!r} is no error greater than 0")
    return degrees, pixels


def fps(text: str) -> float:
    (value,) = numbers(text, 1, float, "a number of frames a second")
    if not 1.0 <= value <= 1000.0:
        raise argparse.ArgumentTypeError(f"{text!r} does not lie between 1 and 1000 frames a second")
    return value


def texels(text: str) -> int:
    (value,) = numbers(text, 1, int, "a whole number")
    if value not in TEXELS:
        raise argparse.ArgumentTypeError(f"{text!r} is none of {', '.join(map(str, TEXELS))}")
    return int(value)


def whole(least: int, most: int) -> Callable[[str], int]:
    def parse(text: str) -> int:
        (value,) = numbers(text, 1, int, "a whole number")
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f"{text!r} does not lie between {least} and {most}")
        return int(value)

    return parse


def vector(text: str) -> Vector:
    x, y, z = numbers(text, 3, float, "three numbers X,Y,Z")
    return x, y, z


def direction(text: str) -> Vector:
    direction = vector(text)
    if not any(direction):
        raise argparse.ArgumentTypeError("0,0,0 is no direction")
    return direction


def view_angle(text: str) -> float:
    (value,) = numbers(text, 1, float, "an angle in degrees")
    if not 0.0 < value < 180.0:
        raise argparse.ArgumentTypeError(f"{text!r} does not lie between 0 and 180 degrees")
    return value


def resolution(text: str) -> tuple[int, int]:
    width, height = numbers(text, 2, int, "a width and a height W,H")
    if not (1 <= width <= MAX_RESOLUTION and 1 <= height <= MAX_RESOLUTION):
        raise argparse.ArgumentTypeError(f"{text!r} does not lie between 1,1 and {MAX_RESOLUTION},{MAX_RESOLUTION}")
    return int(width), int(height)


def output(text: str) -> Path:
    path = Path(text)
    if path.suffix.lower() not in OUTPUT_SUFFIXES:
        raise argparse.ArgumentTypeError(f"{text!r} ends neither in .png nor in .npz")
    return path
