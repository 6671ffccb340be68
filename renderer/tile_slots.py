"""Which tiles lie on the GPU where it has fewer places than there are tiles: those that were drawn last."""

from __future__ import annotations

import numpy as np

from hierarchy.model import Int32Array


class TileSlots:
    """Gives places to the tiles of one frame after the other, least recently drawn tiles making room.

    count : number of tiles
    capacity : number of places, at least 1
    """

    def __init__(self, count: int, capacity: int) -> None:
        self.capacity = capacity
        self._slot_of_tile = np.full(count, -1, np.int32)
        self._tile_in_slot = np.full(capacity, -1, np.int32)
        self._drawn = np.zeros(capacity, np.int64)
        self._frame = 0

    def place(self, tiles: Int32Array) -> tuple[Int32Array, Int32Array, Int32Array]:
        """Find places for the tiles of a frame.

        tiles : int32 (K,), each at most once; -1: none

        Returns the places, int32 (K,), -1 where there is none, and of the tiles that have to be brought there now,
        int32 (N,) and (N,), the tiles and their places. Where the frame has more tiles than there are places, those
        of the first nodes, which are the largest, get them.
        """
        self._frame += 1
        wanted = tiles[tiles >= 0]
        if len(wanted) > self.capacity:
            wanted = np.partition(wanted, self.capacity - 1)[: self.capacity]
        slots = self._slot_of_tile[wanted]
        self._drawn[slots[slots >= 0]] = self._frame
        missing = np.sort(wanted[slots < 0])
        free = np.empty(0, np.int32)
        if len(missing):
            # Of this frame are at most as many as there are places, so that none of them is among the oldest.
            free = np.argpartition(self._drawn, len(missing) - 1)[: len(missing)].astype(np.int32)
            evicted = self._tile_in_slot[free]
            self._slot_of_tile[evicted[evicted >= 0]] = -1
            self._tile_in_slot[free], self._slot_of_tile[missing] = missing, free
            self._drawn[free] = self._frame
        # A tile that is still here from an earlier frame does not count: the picture shall not depend on the past.
        drawn = np.zeros(len(self._slot_of_tile) + 1, bool)
        drawn[wanted] = True
        return np.where(drawn[tiles], self._slot_of_tile[tiles], np.int32(-1)), missing, free
