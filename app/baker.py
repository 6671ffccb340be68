"""Bakes normal tiles in the background: those that the last frame missed, largest first, a few at a time."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from hierarchy.model import Int32Array, UInt32Array

if TYPE_CHECKING:
    from hierarchy.normal_tiles import FittedTiles
    from hierarchy.tile_shelf import TileSource

# Tiles that a thread bakes at once: some 5 ms of work.
BLOCK = 256
NOTHING = np.empty(0, np.uint32), np.empty(0, np.int32)


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
        self._tiles: TileSource | None = None
        # Nodes, and as how many texels a side their tiles are baked.
        self._waiting: tuple[UInt32Array, Int32Array] = NOTHING
        self._in_hand: dict[int, tuple[TileSource, UInt32Array]] = {}
        # Of self._tiles, and nobody else's.
        self._baked: list[FittedTiles] = []
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
            return self.has_baked or in_hand or len(self._waiting[0]) > 0

    def want(self, tiles: TileSource, nodes: UInt32Array, most: Int32Array) -> None:
        """Bake the tiles of these nodes next, the first ones first; and no others.

        nodes, most : as in `TileSource.fitted`
        """
        with self._changed:
            if self._tiles is not tiles:
                self._drop()
            done = [nodes for owner, nodes in self._in_hand.values() if owner is tiles]
            # What has been baked since the last `take` is not known to whoever wants it.
            done += [baked.nodes for baked in self._baked]
            if done:
                free = ~np.isin(nodes, np.concatenate(done))
                nodes, most = nodes[free], most[free]
            self._tiles, self._waiting = tiles, (nodes, most)
            while len(nodes) > 0 and len(self._threads) < self._count:
                name = f"surfelscope-bake-{len(self._threads)}"
                thread = threading.Thread(target=self._run, args=(len(self._threads),), name=name, daemon=True)
                self._threads.append(thread)
                thread.start()
            self._changed.notify_all()

    def take(self, tiles: TileSource) -> list[FittedTiles]:
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
        self._waiting, self._baked = NOTHING, []

    def close(self) -> None:
        """Stop; whoever is baking finishes its block first."""
        with self._changed:
            self._closed = True
            self._waiting = NOTHING
            self._changed.notify_all()
        for thread in self._threads:
            thread.join()

    def _run(self, number: int) -> None:
        while (work := self._next(number)) is not None:
            tiles, nodes, most = work
            baked, error = None, None
            try:
                baked = tiles.fitted(nodes, most)
            except BaseException as problem:
                # Whatever it is: the thread that draws decides what to do about it.
                error = problem
            with self._changed:
                del self._in_hand[number]
                if tiles is not self._tiles:
                    continue
                if baked is not None:
                    self._baked.append(baked)
                else:
                    self._error, self._waiting = error, NOTHING
            self._wake()

    def _next(self, number: int) -> tuple[TileSource, UInt32Array, Int32Array] | None:
        """Wait for work and take some of it in hand; None: there will be none."""
        with self._changed:
            while not self._closed and len(self._waiting[0]) == 0:
                self._changed.wait()
            if self._closed:
                return None
            assert self._tiles is not None
            nodes, most = self._waiting
            self._waiting = nodes[BLOCK:], most[BLOCK:]
            self._in_hand[number] = self._tiles, nodes[:BLOCK]
            return self._tiles, nodes[:BLOCK], most[:BLOCK]
