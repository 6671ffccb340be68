"""Where a tile lies in the tiles' array textures, in one int32: the CPU's side of shaders/include/tile_place.glsl.

From the lowest bit: x and y of the first texel, 10 bits each; the layer, 8 bits; 3 bits for the texels along one side,
0: w_s, else the power of two. Below 0 there is no tile.
"""

from __future__ import annotations

import numpy as np

from hierarchy.model import Int32Array

NO_TILE = -1
# Of LAYER_SIZE^2 texels each: a million tiles of 16 x 16.
MOST_LAYERS = 256


def place_of(layer: int | Int32Array, row: int | Int32Array, column: Int32Array, side: int) -> Int32Array:
    """Return the places of tiles, int32 (K,).

    layer, row, column : of the first texel
    side : texels along one side, a power of two below w_s, at most 128; 0: w_s
    """
    power = side.bit_length() - 1 if side else 0
    place: Int32Array = np.asarray(power << 28 | np.int32(1) * layer << 20 | row << 10 | column, np.int32)
    return place


def layer_of(places: Int32Array) -> Int32Array:
    """Return the layers of places that are not below 0, int32 (K,)."""
    return places >> 20 & 255


def sides_at(places: Int32Array, texels: int) -> Int32Array:
    """Return the texels along one side of tiles at places that are not below 0, int32 (K,); texels : w_s."""
    powers = places >> 28 & 7
    sides: Int32Array = np.where(powers == 0, texels, 1 << powers).astype(np.int32)
    return sides


def row_of(places: Int32Array) -> Int32Array:
    """Return the rows of the first texels of places that are not below 0, int32 (K,)."""
    return places >> 10 & 1023
