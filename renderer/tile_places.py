"""Where a tile lies in the tiles' array textures, in one int32: the CPU's side of shaders/include/tile_place.glsl.

From the lowest bit: x of the first texel, 5 bits, y, 12 bits; the layer, 11 bits; 3 bits for the texels along one side,
0: w_s, else the power of two. Below 0 there is no tile.
"""

from __future__ import annotations

import numpy as np

from hierarchy.model import Int32Array

NO_TILE = -1
# Layers are as wide as the largest tile, so that the rows of a tile lie side by side in memory: in layers of
# 1024 x 1024 they were 4096 bytes apart, all of them in the same few places of a cache, and the attribute pass of a
# software renderer took 1.06 times as long.
LAYER_WIDTH = 32
LAYER_HEIGHT = 4096
# A million tiles of 16 x 16; a graphics card may have fewer layers, llvmpipe has 512.
MOST_LAYERS = 2048
# Of what lies above the place of x.
_ROW, _LAYER, _POWER = 5, 17, 28


def place_of(layer: int | Int32Array, row: int | Int32Array, column: Int32Array, side: int) -> Int32Array:
    """Return the places of tiles, int32 (K,).

    layer, row, column : of the first texel
    side : texels along one side, a power of two below w_s, at most 128; 0: w_s
    """
    power = side.bit_length() - 1 if side else 0
    place: Int32Array = np.asarray(power << _POWER | np.int32(1) * layer << _LAYER | row << _ROW | column, np.int32)
    return place


def layer_of(places: Int32Array) -> Int32Array:
    """Return the layers of places that are not below 0, int32 (K,)."""
    return places >> _LAYER & MOST_LAYERS - 1


def sides_at(places: Int32Array, texels: int) -> Int32Array:
    """Return the texels along one side of tiles at places that are not below 0, int32 (K,); texels : w_s."""
    powers = places >> _POWER & 7
    sides: Int32Array = np.where(powers == 0, texels, 1 << powers).astype(np.int32)
    return sides


def row_of(places: Int32Array) -> Int32Array:
    """Return the rows of the first texels of places that are not below 0, int32 (K,)."""
    return places >> _ROW & LAYER_HEIGHT - 1
