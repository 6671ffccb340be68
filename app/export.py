"""Files that a picture can be written to."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import moderngl
import numpy as np
import numpy.typing as npt

from app.errors import OutputError
from hierarchy.atomic_file import replacing, sweep
from renderer.frame import Frame


def check_writable(path: Path) -> None:
    """Find out before the work whether a file can be written after it; raises OutputError."""
    folder = path.parent
    if path.is_dir():
        raise OutputError(f"{path}: is a folder")
    if not folder.is_dir():
        raise OutputError(f"{path}: there is no folder {folder}")
    target = _target(path)
    if target.exists() and not os.access(target, os.W_OK):
        raise OutputError(f"{path}: no permission to write")
    # A file is replaced by a complete one, which is first written beside it.
    if not _is_stream(target) and not os.access(target.parent, os.W_OK | os.X_OK):
        raise OutputError(f"{path}: no permission to write in the folder {target.parent}")


def is_picture(path: Path) -> bool:
    """Tell whether a file shall hold the picture; otherwise it holds the arrays."""
    return path.suffix.lower() == ".png"


def read_picture(framebuffer: moderngl.Framebuffer) -> npt.NDArray[np.uint8]:
    """Return what was drawn into a framebuffer, uint8 (H, W, 4), row 0 at the top."""
    width, height = framebuffer.size
    rows = np.frombuffer(framebuffer.read(components=4), np.uint8).reshape(height, width, 4)
    return np.ascontiguousarray(rows[::-1])


def write_png(path: Path, color: npt.NDArray[np.uint8]) -> None:
    """Write uint8 (H, W, 4) straight RGBA, row 0 at the top; raises OutputError, with `path` as it was before."""
    from PIL import Image

    with _written(path) as file:
        # A low level: the default takes four times as long for a file a few percent smaller.
        Image.fromarray(color, "RGBA").save(file, format="PNG", compress_level=2)


def write_arrays(path: Path, frame: Frame, scale: float) -> None:
    """Write normal, depth, coverage and color, as `Frame` describes them but depth in lengths of the file.

    scale : the file's length of a unit of model space
    Raises OutputError, with `path` as it was before.
    """
    # A power of two, by which only what leaves float32's range is rounded.
    depth = (frame.depth * np.float64(scale)).astype(np.float32)
    with _written(path) as file:
        np.savez(file, normal=frame.normal, depth=depth, coverage=frame.coverage, color=frame.color)


@contextmanager
def _written(path: Path) -> Iterator[BinaryIO]:
    """Give a file that takes the place of what `path` names, or leads to, when all has been written."""
    target = _target(path)
    try:
        if _is_stream(target):
            with target.open("wb") as file:
                yield file
        else:
            # What an earlier run that was killed has left.
            sweep(target.parent, target.name)
            with replacing(target) as file:
                yield file
    except OSError as error:
        raise OutputError(f"{path}: {error.strerror or error}") from error


def _target(path: Path) -> Path:
    return Path(os.path.realpath(path))


def _is_stream(target: Path) -> bool:
    """Tell whether something is a pipe or a device, which is written to and not replaced."""
    return target.exists() and not target.is_file()
