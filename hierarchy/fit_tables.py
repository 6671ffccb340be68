"""What fitting tiles by coarser ones takes that is the same for every tile: weights, and inverses of normal equations.

Least squares over the disc. What the fit leaves open at the corners, where no texel of the disc is, is made smooth
instead of small (Botsch et al. 2004, "Phong Splatting", take the pseudo-inverse).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hierarchy.model import Float32Array, Int32Array, Int64Array
from hierarchy.tile_sizes import sides_of

# Weight of the differences of neighbouring texels in the fit.
SMOOTHNESS = 1e-3


@dataclass(frozen=True, eq=False)
class FitTables:
    """What fitting tiles of each size by coarser ones takes, computed once.

    sides : texels along one side, ascending; int32 (S,)
    lows, shares : texel x of a tile of sides[i] lies between the texels low and low + 1 of one of sides[j], by the
        share; int32 and float32 (S, S, largest)
    firsts : the first texel that counts of row or column y of a tile of sides[i], int32 (S, largest); as many at its
        end do not count either
    inverses, begins : of the normal equations, row by row behind each other, float32, and where each begins, int64
        (S, S)
    """

    sides: Int32Array
    lows: Int32Array
    shares: Float32Array
    firsts: Int32Array
    inverses: Float32Array
    begins: Int64Array


def fit_tables(texels: int) -> FitTables:
    """Compute the tables for tiles of at most `texels` texels a side."""
    sides = sides_of(texels)
    count = len(sides)
    lows, shares = np.zeros((count, count, texels), np.int32), np.zeros((count, count, texels), np.float32)
    firsts, begins = np.zeros((count, texels), np.int32), np.zeros((count, count), np.int64)
    inverses: list[Float32Array] = []
    end = 0
    for i, fine in enumerate(sides):
        firsts[i, :fine] = _first_texels(fine)
        at = np.linspace(-1.0, 1.0, fine)
        inside = at[:, None] ** 2 + at[None, :] ** 2 <= _reach2(fine)
        for j, coarse in enumerate(sides[:i]):
            place = np.arange(fine) * ((coarse - 1) / (fine - 1))
            low = np.minimum(place.astype(np.int32), coarse - 2)
            lows[i, j, :fine], shares[i, j, :fine] = low, place - low
            line = np.zeros((fine, coarse))
            line[np.arange(fine), low], line[np.arange(fine), low + 1] = 1.0 - (place - low), place - low
            inner = np.kron(line, line)[inside.ravel()]
            step = np.diff(np.eye(coarse), axis=0)
            rough = np.concatenate([np.kron(step, np.eye(coarse)), np.kron(np.eye(coarse), step)])
            inverse = np.linalg.inv(inner.T @ inner + SMOOTHNESS * rough.T @ rough)
            begins[i, j] = end
            inverses.append(inverse.astype(np.float32).ravel())
            end += inverse.size
    flat = np.concatenate(inverses) if inverses else np.empty(0, np.float32)
    return FitTables(np.array(sides, np.int32), lows, shares, firsts, flat, begins)


def _reach2(texels: int) -> float:
    """Return the square of the distance, in radii, up to which texels count: those that the disc's rim lies between."""
    return float((1.0 + 2.0 / max(texels - 1, 1)) ** 2)


def _first_texels(texels: int) -> Int32Array:
    """Return the first of the texels of each row that count, int32 (texels,)."""
    half = 0.5 * (texels - 1)
    wide = np.sqrt(np.maximum((half + 1.0) ** 2 - (np.arange(texels) - half) ** 2, 0.0))
    firsts: Int32Array = np.maximum(np.ceil(half - wide), 0.0).astype(np.int32)
    return firsts
