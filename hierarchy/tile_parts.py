"""Some of the tiles of several nodes, and the tiles of several batches together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from hierarchy.model import Int32Array, UInt8Array
from hierarchy.normal_tiles import FittedTiles

Places = npt.NDArray[np.int64]


def chosen(tiles: FittedTiles, places: Places) -> FittedTiles:
    """Return the tiles of nodes places[0], places[1], ... of `tiles`, copied, in that order.

    places : int64 (K,), each below the number of nodes
    """
    sides = tiles.sides[places]
    # Texels lie apart by side: of each node which of those of its side it has.
    ranks = np.zeros(len(tiles.sides), np.int64)
    for side in tiles.normals:
        here = np.flatnonzero(tiles.sides == side)
        ranks[here] = np.arange(len(here))
    ranks = ranks[places]

    def of(texels: dict[int, UInt8Array]) -> dict[int, UInt8Array]:
        return {side: texels[side][ranks[sides == side]] for side in texels if (sides == side).any()}

    return FittedTiles(
        tiles.nodes[places], tiles.most[places], sides, tiles.spreads[places], of(tiles.normals), of(tiles.colors)
    )


def joined(batches: Sequence[FittedTiles]) -> FittedTiles:
    """Return the tiles of one or more batches, one batch behind the other."""

    def of(each: Sequence[dict[int, UInt8Array]]) -> dict[int, UInt8Array]:
        sides = sorted({side for texels in each for side in texels})
        return {side: np.concatenate([texels[side] for texels in each if side in texels]) for side in sides}

    return FittedTiles(
        np.concatenate([tiles.nodes for tiles in batches]),
        np.concatenate([tiles.most for tiles in batches]),
        np.concatenate([tiles.sides for tiles in batches]),
        np.concatenate([tiles.spreads for tiles in batches]),
        of([tiles.normals for tiles in batches]),
        of([tiles.colors for tiles in batches]),
    )


def bytes_of_each(tiles: FittedTiles) -> Int32Array:
    """Return how many bytes each tile takes in a file, int32 (K,); at most 98,320."""
    texel = 6 if tiles.colors else 2
    numbers = sum(array.itemsize for array in (tiles.nodes, tiles.most, tiles.sides)) + tiles.spreads.shape[1]
    sizes: Int32Array = (texel * tiles.sides**2 + numbers).astype(np.int32)
    return sizes
