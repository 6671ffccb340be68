"""What can go wrong outside the core. Every message is one line, and ends the command with exit status 2.

What nobody thought of has a status of its own, so that nobody takes it for an answer about the file.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from hierarchy.plain_text import plain_line

EXIT_ERROR = 2
# EX_SOFTWARE of the BSDs.
EXIT_DEFECT = 70


class UsageError(Exception):
    """The command line cannot be understood, or asks for what cannot be."""


class OutputError(Exception):
    """A file cannot be written."""


class WindowError(Exception):
    """No window can be opened here."""


class GraphicsError(Exception):
    """OpenGL refuses: too little memory, a picture or a model larger than it can hold."""


def unforeseen(error: BaseException) -> str:
    """Return one line about an error that is a defect of the program."""
    said = plain_line(str(error))
    return f"this should not happen, please report it: {type(error).__name__}{f': {said}' if said else ''}"


@contextmanager
def graphics_errors() -> Iterator[None]:
    """Turn what the driver and the renderer refuse inside the block into a GraphicsError."""
    import moderngl

    from renderer.allocation import GpuError

    try:
        yield
    except (moderngl.Error, GpuError) as error:
        raise GraphicsError(f"OpenGL: {' '.join(str(error).split())}") from error
