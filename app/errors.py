"""What can go wrong outside the core. Every message is one line, and ends the command with exit status 2."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

EXIT_ERROR = 2


class UsageError(Exception):
    """The command line cannot be understood, or asks for what cannot be."""


class OutputError(Exception):
    """A file cannot be written."""


class WindowError(Exception):
    """No window can be opened here."""


class GraphicsError(Exception):
    """OpenGL refuses: too little memory, a picture or a model larger than it can hold."""


@contextmanager
def graphics_errors() -> Iterator[None]:
    """Turn what the driver and the renderer refuse inside the block into a GraphicsError."""
    import moderngl

    from renderer.allocation import GpuError

    try:
        yield
    except (moderngl.Error, GpuError) as error:
        raise GraphicsError(f"OpenGL: {' '.join(str(error).split())}") from error
