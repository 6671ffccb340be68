"""An OpenGL context that refuses what it is asked for at a chosen moment."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import moderngl

MAKES = (
    "texture",
    "texture_array",
    "depth_texture",
    "buffer",
    "renderbuffer",
    "framebuffer",
    "vertex_array",
    "program",
)


class FaultyContext:
    """Passes everything on to a real context but for one request to make something.

    fails_at : which request is refused, counted from 0; None: none
    by_error : refuse as drivers do that are out of memory, by an error to be asked for, where the object is made all
        the same; otherwise by moderngl's exception
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self._real = ctx
        self._pending = False
        self.fails_at: int | None = None
        self.by_error = False
        self.requests = 0

    def arm(self, fails_at: int | None, *, by_error: bool) -> None:
        self.fails_at, self.by_error, self.requests, self._pending = fails_at, by_error, 0, False

    @property
    def error(self) -> str:
        pending, self._pending = self._pending, False
        return "GL_OUT_OF_MEMORY" if pending else self._real.error

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._real, name)
        return self._watched(value) if name in MAKES else value

    def __setattr__(self, name: str, value: object) -> None:
        if name.startswith("_") or name in ("fails_at", "by_error", "requests"):
            super().__setattr__(name, value)
        else:
            setattr(self._real, name, value)

    def _watched(self, make: Callable[..., Any]) -> Callable[..., Any]:
        def made(*args: Any, **kwargs: Any) -> Any:
            request, self.requests = self.requests, self.requests + 1
            if request == self.fails_at:
                if not self.by_error:
                    raise moderngl.Error("refused")
                self._pending = True
            return make(*args, **kwargs)

        return made
