"""Saving what the window shows."""

from __future__ import annotations

import os
from datetime import datetime
from pathlib import Path

import numpy as np
import numpy.typing as npt

from app.export import write_png


def save_screenshot(picture: npt.NDArray[np.uint8], now: datetime) -> Path:
    """Write uint8 (H, W, 4) to a new file that is named after the time, and return its path.

    It goes to the current folder, or to the user's pictures where that cannot be written to. Raises OutputError.
    """
    folder = Path.cwd()
    if not os.access(folder, os.W_OK):
        pictures = Path.home() / "Pictures"
        folder = pictures if pictures.is_dir() else Path.home()
    stem = f"surfelscope-{now:%Y%m%d-%H%M%S}"
    path, number = folder / f"{stem}.png", 1
    while path.exists():
        number += 1
        path = folder / f"{stem}-{number}.png"
    write_png(path, picture)
    return path
