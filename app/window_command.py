"""`surfelscope`: the window, or the same view in a file where there is no display."""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from pathlib import Path

from app.options import Options
from app.render_command import render_instead_of_window

DEFAULT_SIZE = (1280, 800)


def run_window(options: Options) -> None:
    """Show the model in a window.

    Raises WindowError where there is a display but no window, GraphicsError where OpenGL fails for good, and what
    `render` raises where there is no display.
    """
    if not _may_have_display():
        _render(options, "there is no display")
        return
    from app.errors import WindowError
    from app.glfw_window import start_glfw

    try:
        start_glfw()
    except WindowError as error:
        _render(options, str(error))
        return
    from app.window import open_window

    if not open_window(options):
        # The interpreter would wait for the parallel kernel that still runs.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(0)


def _may_have_display() -> bool:
    """Tell whether it is worth looking for a display: without these variables there is none on Linux."""
    return not sys.platform.startswith("linux") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _render(options: Options, reason: str) -> None:
    stem = "meteoroid" if options.model is None else options.model.name
    resolution = options.resolution or DEFAULT_SIZE
    render_instead_of_window(replace(options, resolution=resolution), reason, Path(f"surfelscope-{stem}.png"))
