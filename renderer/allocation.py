"""Making what stays on the GPU, all of it or nothing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol, TypeVar

import moderngl

# Several errors can be pending, one of each kind; a context that is lost reports its loss for ever.
_MOST_ERRORS = 8


class GpuError(Exception):
    """The GPU cannot hold what is asked of it. The message is one line."""


class Releasable(Protocol):
    """A texture, buffer or framebuffer."""

    def release(self) -> None:
        """Give it back."""


R = TypeVar("R", bound=Releasable)


class Held:
    """What has been made so far, to be given back together."""

    def __init__(self) -> None:
        self._made: list[Releasable] = []

    def add(self, made: R) -> R:
        """Note something that was made, and return it."""
        self._made.append(made)
        return made

    def release(self) -> None:
        """Give everything back, the last first."""
        while self._made:
            self._made.pop().release()


@contextmanager
def allocating(ctx: moderngl.Context, what: str) -> Iterator[Held]:
    """Watch over what is made inside the block; where that fails give back what it added to the Held.

    what : what it is made for, as the message names it
    Raises GpuError where OpenGL refuses something.
    """
    # moderngl reports few errors by itself, and a texture without memory is only drawn wrong.
    _read_errors(ctx)
    held = Held()
    try:
        yield held
        errors = _read_errors(ctx)
        if "GL_OUT_OF_MEMORY" in errors:
            raise GpuError(f"the graphics memory does not hold {what}")
        if errors:
            raise GpuError(f"the graphics card cannot make {what}: {errors[0]}")
    except moderngl.Error as error:
        held.release()
        # An attachment without memory makes an incomplete framebuffer before its error has been read.
        if "GL_OUT_OF_MEMORY" in _read_errors(ctx):
            raise GpuError(f"the graphics memory does not hold {what}") from error
        raise GpuError(f"the graphics card cannot make {what}: {error}") from error
    except BaseException:
        held.release()
        raise


def _read_errors(ctx: moderngl.Context) -> list[str]:
    """Return the pending errors, and forget them."""
    errors: list[str] = []
    while len(errors) < _MOST_ERRORS and (error := ctx.error) != "GL_NO_ERROR":
        errors.append(error)
    return errors
