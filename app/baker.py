"""Bakes normal tiles in the background: those that the last frame missed, largest first, a few at a time."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from hierarchy.model import UInt32Array

if TYPE_CHECKING:
    from hierarchy.normal_tiles import TileBaker, TileStrips

# Tiles that a thread bakes at once, and no fewer than a strip has: some 5 ms of work.
BLOCK = 256


class Baker:
    """Threads that bake what is wanted now; what was wanted before and is not any more is forgotten.

    All methods are for the thread that draws.
    """

    def __init__(self, wake: Callable[[], None], threads: int | None = None) -> None:
        """wake : called from the background when there is something to take; threads : None: half of the cores."""
        self._wake = wake
        self._count = max(1, (os.cpu_count() or 1) // 2) if threads is None else threads
        self._changed = threading.Condition()
        self._threads: list[threading.Thread] = []
        self._tiles: TileBaker | None = None
        self._waiting: UInt32Array = np.empty(0, np.uint32)
        self._in_hand: dict[int, tuple[TileBaker, UInt32Array]] = {}
        # Of self._tiles, and nobody else's.
        self._baked: list[TileStrips] = []
        self._error: BaseException | None = None
        self._closed = False

    @property
    def has_baked(self) -> bool:
        """There is something to take."""
        return bool(self._baked) or self._error is not None

    @property
    def busy(self) -> bool:
        """Something is wanted and not yet taken."""
        with self._changed:
            in_hand = any(tiles is self._tiles for tiles, _ in self._in_hand.values())
            return self.has_baked or in_hand or len(self._waiting) > 0

    def want(self, tiles: TileBaker, nodes: UInt32Array) -> None:
        """Bake the tiles of these nodes next, uint32 (K,), the first ones first; and no others."""
        with self._changed:
            if self._tiles is not tiles:
                self._drop()
            in_hand = [nodes for owner, nodes in self._in_hand.values() if owner is tiles]
            if in_hand:
                nodes = nodes[~np.isin(nodes, np.concatenate(in_hand))]
            self._tiles, self._waiting = tiles, nodes
            while len(nodes) > 0 and len(self._threads) < self._count:
                name = f"surfelscope-bake-{len(self._threads)}"
                thread = threading.Thread(target=self._run, args=(len(self._threads),), name=name, daemon=True)
                self._threads.append(thread)
                thread.start()
            self._changed.notify_all()

    def take(self, tiles: TileBaker) -> list[TileStrips]:
        """Return what has been baked of `tiles` since the last call; raises what baking raised."""
        with self._changed:
            if tiles is not self._tiles:
                return []
            baked, self._baked = self._baked, []
            error, self._error = self._error, None
        if error is not None:
            raise error
        return baked

    def drop(self) -> None:
        """Want nothing any more; what has been baked is thrown away."""
        with self._changed:
            self._drop()

    def _drop(self) -> None:
        self._tiles, self._error = None, None
        self._waiting, self._baked = self._waiting[:0], []

    def close(self) -> None:
        """Stop; whoever is baking finishes its block first."""
        with self._changed:
            self._closed = True
            self._waiting = self._waiting[:0]
            self._changed.notify_all()
        for thread in self._threads:
            thread.join()

    def _run(self, number: int) -> None:
        while (work := self._next(number)) is not None:
            tiles, nodes = work
            strips, error = None, None
            try:
                strips = tiles.strips(nodes)
            except BaseException as problem:
                # Whatever it is: the thread that draws decides what to do about it.
                error = problem
            with self._changed:
                del self._in_hand[number]
                if tiles is not self._tiles:
                    continue
                if strips is not None:
                    self._baked.append(strips)
                else:
                    self._error, self._waiting = error, self._waiting[:0]
            self._wake()

    def _next(self, number: int) -> tuple[TileBaker, UInt32Array] | None:
        """Wait for work and take some of it in hand; None: there will be none."""
        with self._changed:
            while not self._closed and len(self._waiting) == 0:
                self._changed.wait()
            if self._closed:
                return None
            assert self._tiles is not None
            # Full strips, as a page of the GPU's is never shared by two blocks.
            block = self._tiles.tiles_of_strip * max(1, BLOCK // self._tiles.tiles_of_strip)
            self._in_hand[number] = self._tiles, self._waiting[:block]
            self._waiting = self._waiting[block:]
            return self._in_hand[number]
