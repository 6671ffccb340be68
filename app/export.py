"""Files that a picture can be written to."""

from __future__ import annotations

import os
from pathlib import Path

import moderngl
import numpy as np
import numpy.typing as npt

from app.errors import OutputError
from renderer.frame import Frame


def check_writable(path: Path) -> None:
    """Find out before the work whether a file can be written after it; raises OutputError."""
    folder = path.parent
    if path.is_dir():
        raise OutputError(f"{path}: is a folder")
    if not folder.is_dir():
        raise OutputError(f"{path}: there is no folder {folder}")
    if not os.access(path if path.exists() else folder, os.W_OK):
        raise OutputError(f"{path}: no permission to write")


def is_picture(path: Path) -> bool:
    """Tell whether a file shall hold the picture; otherwise it holds the arrays."""
    return path.suffix.lower() == ".png"


def read_picture(framebuffer: moderngl.Framebuffer) -> npt.NDArray[np.uint8]:
    """Return what was drawn into a framebuffer, uint8 (H, W, 4), row 0 at the top."""
    width, height = framebuffer.size
    rows = np.frombuffer(framebuffer.read(components=4), np.uint8).reshape(height, width, 4)
    return np.ascontiguousarray(rows[::-1])


def write_png(path: Path, color: npt.NDArray[np.uint8]) -> None:
    """Write uint8 (H, W, 4) straight RGBA, row 0 at the top; raises OutputError."""
    from PIL import Image

    try:
        # A low level: the default takes four times as long for a file a few percent smaller.
        Image.fromarray(color, "RGBA").save(path, format="PNG", compress_level=2)
    except OSError as error:
        raise OutputError(f"{path}: {error.strerror or error}") from error


def write_arrays(path: Path, frame: Frame, scale: float) -> None:
    """Write normal, depth, coverage and color, as `Frame` describes them but depth in lengths of the file.

    scale : the file's length of a unit of model space
    Raises OutputError.
    """
    # A power of two, by which only what leaves float32's range is rounded.
    depth = (frame.depth * np.float64(scale)).astype(np.float32)
    try:
        with path.open("wb") as file:
            np.savez(file, normal=frame.normal, depth=depth, coverage=frame.coverage, color=frame.color)
    except OSError as error:
        raise OutputError(f"{path}: {error.strerror or error}") from error
