"""Files that a picture can be written to."""

from __future__ import annotations

import os
from pathlib import Path

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


def write_frame(path: Path, frame: Frame) -> None:
    """Write a drawn frame as a picture (.png) or as its arrays (.npz); raises OutputError."""
    if path.suffix.lower() == ".png":
        write_png(path, frame.color)
    else:
        write_arrays(path, frame)


def write_png(path: Path, color: npt.NDArray[np.uint8]) -> None:
    """Write uint8 (H, W, 4) straight RGBA, row 0 at the top; raises OutputError."""
    from PIL import Image

    try:
        # A low level: the default takes four times as long for a file a few percent smaller.
        Image.fromarray(color, "RGBA").save(path, format="PNG", compress_level=2)
    except OSError as error:
        raise OutputError(f"{path}: {error.strerror or error}") from error


def write_arrays(path: Path, frame: Frame) -> None:
    """Write normal, depth, coverage and color, as `Frame` describes them; raises OutputError."""
    try:
        with path.open("wb") as file:
            np.savez(file, normal=frame.normal, depth=frame.depth, coverage=frame.coverage, color=frame.color)
    except OSError as error:
        raise OutputError(f"{path}: {error.strerror or error}") from error
