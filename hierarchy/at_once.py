"""Pieces of work on several threads at once, this one among them: for kernels that release the interpreter lock.

Unlike parallel kernels, of which some threading layers of numba allow only one at a time, any number of these may run.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache
from typing import TypeVar

T = TypeVar("T")
R = TypeVar("R")


def at_once(work: Callable[[T], R], pieces: Iterable[T]) -> list[R]:
    """Return the results of the pieces, in their order; raises what one raised once all threads have stopped."""
    every = list(pieces)
    results: dict[int, R] = {}
    left = iter(range(len(every)))

    def take() -> None:
        # An iterator over a range hands each number to one thread.
        for k in left:
            results[k] = work(every[k])

    helpers = min(_cores(), len(every)) - 1
    others = [_pool().submit(take) for _ in range(helpers)]
    try:
        take()
    finally:
        wait(others)
    for each in others:
        each.result()
    return [results[k] for k in range(len(every))]


@cache
def _cores() -> int:
    """Return how many threads may run at once. Asking the system takes as long as selecting 300 nodes."""
    return os.cpu_count() or 1


@cache
def _pool() -> ThreadPoolExecutor:
    """Return the threads, which are started when first needed, and then wait."""
    return ThreadPoolExecutor(_cores(), thread_name_prefix="surfelscope-piece")
