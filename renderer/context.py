"""An OpenGL context without a window, and what the renderer asks of any context."""

from __future__ import annotations

import sys
from typing import Any

import moderngl

# OpenGL 3.3 core is the baseline; macOS stops at 4.1.
REQUIRED_VERSION = 330
SOFTWARE_RENDERERS = ("llvmpipe", "softpipe", "swrast")


class ContextError(Exception):
    """No usable OpenGL. The message is one line."""


def create_headless_context() -> moderngl.Context:
    """Create an OpenGL context that needs no display.

    Raises ContextError where there is none of version 3.3.
    """
    settings: dict[str, Any] = {"backend": "egl"} if sys.platform.startswith("linux") else {}
    try:
        ctx = moderngl.create_context(standalone=True, require=REQUIRED_VERSION, **settings)
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        hint = "; on Debian: apt install libegl1 libgl1" if settings else ""
        raise ContextError(f"no OpenGL 3.3 without a window: {reason}{hint}") from error
    return ctx


def is_software(ctx: moderngl.Context) -> bool:
    """Tell whether the processor draws."""
    name = str(ctx.info["GL_RENDERER"]).lower()
    return any(renderer in name for renderer in SOFTWARE_RENDERERS)
