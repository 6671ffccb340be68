"""The tiles that a picture needs: those that were kept of one before, and the rest freshly baked.

A tile depends on its node and on how many texels it may have, nothing else. So whoever asks gets the same tiles,
whatever has been kept.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hierarchy.hierarchy import Hierarchy
from hierarchy.model import Int32Array, UInt32Array
from hierarchy.normal_tiles import FittedTiles, TileBaker
from hierarchy.tile_kernels import LAYER_SIZE
from hierarchy.tile_parts import Places, bytes_of_each, chosen, joined

# What is kept of one picture, and remembered for that: fifteen times what 1024 x 1024 pixels take in usual detail.
MOST_BYTES = 16_000_000


class TileSource(Protocol):
    """Where tiles come from."""

    def fitted(self, nodes: UInt32Array, most: Int32Array, *, at_once: bool = False) -> FittedTiles:
        """Return the tiles of nodes, as `TileBaker.fitted` does."""


@dataclass(frozen=True, eq=False)
class ShownTiles:
    """The tiles of one picture.

    texels : along one side at most (w_s)
    tiles : by ascending nodes, each once
    """

    texels: int
    tiles: FittedTiles


class TileShelf:
    """Hands out the tiles of a hierarchy, and remembers what it bakes until `worth_keeping` asks for it.

    found : tiles that need not be baked and have been handed out
    """

    def __init__(self, hierarchy: Hierarchy, texels: int, kept: ShownTiles | None = None) -> None:
        """texels : as in `TileBaker`, which says what is raised; kept : of the same hierarchy and size, None: none."""
        self.texels = texels
        self.found = 0
        self._baker = TileBaker(hierarchy, texels)
        self._kept = None if kept is None else kept.tiles
        self._baked: list[FittedTiles] | None = []
        self._bytes = 0

    def take(self, nodes: UInt32Array, most: Int32Array) -> FittedTiles | None:
        """Return the tiles of those nodes that have been kept, in the order of the nodes; None: none have.

        nodes, most : as in `TileBaker.fitted`
        """
        places = self._places(nodes, most)
        return self._take(places[places >= 0]) if (places >= 0).any() else None

    def fitted(self, nodes: UInt32Array, most: Int32Array, *, at_once: bool = False) -> FittedTiles:
        """Return the tiles of nodes, in their order, as `TileBaker.fitted` does. Other threads may do so meanwhile."""
        places = self._places(nodes, most)
        known = places >= 0
        if not known.any():
            return self._bake(nodes, most, at_once)
        found = self._take(places[known])
        if known.all():
            return found
        baked = self._bake(nodes[~known], most[~known], at_once)
        behind = np.concatenate([np.flatnonzero(known), np.flatnonzero(~known)])
        return chosen(joined([found, baked]), np.argsort(behind))

    def _bake(self, nodes: UInt32Array, most: Int32Array, at_once: bool) -> FittedTiles:
        tiles = self._baker.fitted(nodes, most, at_once=at_once)
        baked = self._baked
        if baked is not None and self._bytes < MOST_BYTES:
            baked.append(tiles)
            self._bytes += tiles.nbytes
        return tiles

    def _take(self, places: Places) -> FittedTiles:
        assert self._kept is not None
        tiles = chosen(self._kept, places)
        self.found += tiles.count
        return tiles

    def _places(self, nodes: UInt32Array, most: Int32Array) -> Places:
        """Return where among the kept tiles those of nodes are, int64 (K,); -1: there is none of as many texels."""
        kept = self._kept
        if kept is None or len(kept.nodes) == 0:
            return np.full(len(nodes), -1, np.int64)
        places = np.minimum(np.searchsorted(kept.nodes, nodes), len(kept.nodes) - 1)
        same = (kept.nodes[places] == nodes) & (kept.most[places] == most)
        return np.where(same, places, -1)

    @property
    def remembers(self) -> bool:
        """`worth_keeping` has not been called."""
        return self._baked is not None

    def worth_keeping(self, nodes: UInt32Array, most: Int32Array, most_bytes: int = MOST_BYTES) -> ShownTiles | None:
        """Return the tiles of a picture as far as they have been handed out; None: they have been kept, or no memory.

        What has been baked is let go of: this is for the one picture that others are expected to be like.

        nodes, most : uint32 and int32 (K,), as in `TileBaker.fitted`, each node once
        most_bytes : where tiles take more than that in a file those of the largest nodes are returned
        """
        baked, self._baked = self._baked, None
        with suppress(MemoryError):
            return self._worth_keeping(baked, nodes, most, most_bytes) if baked else None
        return None

    def _worth_keeping(
        self, baked: list[FittedTiles], nodes: UInt32Array, most: Int32Array, most_bytes: int
    ) -> ShownTiles | None:
        kept = [] if self._kept is None else [self._kept]
        tiles, kept_count = joined([*kept, *baked]), sum(len(each.nodes) for each in kept)
        # Of tiles that were baked twice the first ones are found.
        keys, places = np.unique(_keys(tiles.nodes, tiles.most), return_index=True)
        places = places[np.isin(keys, _keys(nodes, most))]
        # The largest nodes are the first ones, breadth first.
        places = places[np.cumsum(bytes_of_each(tiles)[places]) <= most_bytes]
        return ShownTiles(self.texels, chosen(tiles, places)) if (places >= kept_count).any() else None


def _keys(nodes: UInt32Array, most: Int32Array) -> Places:
    """Return a number for every node and number of texels, by ascending nodes."""
    return nodes.astype(np.int64) * (LAYER_SIZE + 1) + most
