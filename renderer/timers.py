"""How long each stage of a frame takes on the GPU, or on the processor where that draws."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import moderngl

from renderer.context import is_software


class StageTimers:
    """Times stages by name: timer queries on a GPU, wall time between finishes on a software renderer.

    A software renderer answers timer queries before its threads have drawn anything. On a GPU a query is read only
    when the next frame asks, so that nothing waits.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._software = is_software(ctx)
        self._queries: dict[str, moderngl.Query] = {}
        self._milliseconds: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time what is drawn inside the block."""
        if self._software:
            start = time.perf_counter()
            yield
            self._ctx.finish()
            self._milliseconds[name] = 1e3 * (time.perf_counter() - start)
            return
        if name not in self._queries:
            self._queries[name] = self._ctx.query(time=True)
        with self._queries[name]:
            yield

    @property
    def milliseconds(self) -> dict[str, float]:
        """The last time of every stage."""
        for name, query in self._queries.items():
            self._milliseconds[name] = query.elapsed * 1e-6
        return dict(self._milliseconds)
