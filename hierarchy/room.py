"""Room for what a traversal finds: arrays that each thread keeps from one selection to the next.

What a traversal can find at most is as large as the model. Arrays of that size, made anew for every frame, are pages
that the system has to hand out, to fill with zeros and to take back; so there is room for what was found before, and
when that does not do a traversal starts again with twice as much.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from hierarchy.model import Int32Array, UInt32Array

# Elements of each array at first.
FIRST = 8192

# Nodes looked at and where the queue ends; where what is on the silhouette ends and where the rest begins, of splats
# and of leaf triangles.
Ends: TypeAlias = tuple[int, int, int, int, int, int]


class Found(NamedTuple):
    """What a traversal found, in arrays of a room: for as long as nothing else is looked for with it.

    waiting : int32 (W, 2), nodes that are still to be looked at, and which planes their parents reach behind
    visited : how many were
    """

    silhouette_splats: UInt32Array
    inner_splats: UInt32Array
    silhouette_triangles: UInt32Array
    inner_triangles: UInt32Array
    waiting: Int32Array
    visited: int


class Room:
    """Arrays for one traversal at a time.

    splats : uint32 (N,), filled from both ends
    drawn : uint32 (N, 3), vertices of leaf triangles, filled from both ends
    queue : int32 (N, 2), nodes, and which planes their parents reach behind
    """

    def __init__(self) -> None:
        self._make(FIRST)

    def _make(self, size: int) -> None:
        self.splats: UInt32Array = np.empty(size, np.uint32)
        self.drawn: UInt32Array = np.empty((size, 3), np.uint32)
        self.queue: Int32Array = np.empty((size, 2), np.int32)

    def traverse(self, kernel: Callable[..., Ends], start: Int32Array) -> Found:
        """Call a kernel with what is in here, until there is room for what it finds; what it returns lies in here.

        kernel : called with splats, drawn and queue, and how many nodes wait in that; returns where what it found
            ends, and less than 0 in the first place where there was not enough room
        start : int32 (S, 2), the nodes that wait at first
        """
        while True:
            if len(start) <= len(self.queue):
                self.queue[: len(start)] = start
                ends = kernel((self.splats, self.drawn, self.queue), len(start))
                if ends[0] >= 0:
                    break
            self._make(2 * len(self.splats))
        head, tail, sil_splats, inner_splats, sil_triangles, inner_triangles = ends
        return Found(
            silhouette_splats=self.splats[:sil_splats],
            inner_splats=self.splats[inner_splats:],
            silhouette_triangles=self.drawn[:sil_triangles],
            inner_triangles=self.drawn[inner_triangles:],
            waiting=self.queue[head:tail],
            visited=head,
        )


class _Kept(threading.local):
    def __init__(self) -> None:
        self.rooms: list[Room] = []


_kept = _Kept()


def rooms(count: int) -> Sequence[Room]:
    """Return so many rooms, the same ones to a thread whenever it asks."""
    while len(_kept.rooms) < count:
        _kept.rooms.append(Room())
    return _kept.rooms[:count]
