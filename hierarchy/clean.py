"""Drop what cannot be drawn, and count it: values that are not finite, bad indices, faces without area, duplicates."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit, prange

from hierarchy.model import BoolArray, Float32Array, Float64Array, Int32Array
from hierarchy.part import Int64Array, UnreadableFile, indices_in_range
from hierarchy.unique_rows import unique_positions

# Beyond this a coordinate counts as not finite: float32 ends at 3.4e38, and a bounding box is twice as wide.
LARGEST_COORDINATE = 1e36

# The binary exponent of the shortest scale: what is smaller is drawn as if it were that large.
SMALLEST_EXPONENT = -1000

# A triangle has no area where its height is below this fraction of its longest side. Differences of float32
# coordinates are exact in doubles nearly always, so that this only has to cover the rounding of doubles.
SMALLEST_HEIGHT = 1e-12

# Half-edges, three a face, and points, of which a mesh has no more than corners, are numbered by int32.
MOST_FACES = (2**31 - 1) // 3
MOST_POINTS = 2**31 - 1


def counted(verb: str, count: int, noun: str, rest: str = "") -> str:
    """Return a sentence such as "dropped 3 faces with indices out of range"."""
    plural = "vertices" if noun == "vertex" else f"{noun}s"
    return f"{verb} {count} {noun if count == 1 else plural} {rest}".strip()


def usable_positions(positions: Float64Array) -> BoolArray:
    """Return for each of `positions` (N, 3) whether its coordinates are finite and fit into float32."""
    usable: BoolArray = np.all(np.abs(positions) <= LARGEST_COORDINATE, axis=1)
    return usable


def clean_faces(
    positions: Float64Array, faces: Int64Array, bad_faces: int, warnings: list[str]
) -> tuple[Float64Array, Int32Array, Int64Array]:
    """Keep the faces whose indices and positions can be used, and the vertices that they use.

    positions : float64 (V, 3); faces : int64 (T, 3), anything
    bad_faces : faces with indices out of range that the reader has dropped already
    warnings : gets a sentence for each kind of face dropped
    Returns the kept positions (U, 3), the faces int32 in terms of them, and the kept vertices' old indices (U,).
    Raises UnreadableFile where no face is left, or there are more than MOST_FACES.
    """
    if len(faces) > MOST_FACES:
        raise UnreadableFile(f"too large: {len(faces):,} faces, of which {MOST_FACES:,} can be counted")
    in_range = indices_in_range(faces, len(positions))
    bad_faces += int(len(faces) - in_range.sum())
    if not in_range.all():
        faces = faces[in_range]
    finite = usable_positions(positions)
    all_finite = bool(finite.all())
    not_finite = 0
    if not all_finite:
        whole: BoolArray = np.all(finite[faces], axis=1)
        not_finite = int(len(whole) - whole.sum())
        faces = faces[whole]
    if bad_faces:
        warnings.append(counted("dropped", bad_faces, "face", "with indices out of range"))
    if not all_finite:
        warnings.append(counted("dropped", int((~finite).sum()), "vertex", "whose positions are not finite"))
    if not_finite:
        warnings.append(counted("dropped", not_finite, "face", "at positions that are not finite"))
    if len(faces) == 0:
        raise UnreadableFile("nothing to draw: no face has usable indices and positions")
    used = np.zeros(len(positions), np.bool_)
    used[faces.ravel()] = True
    if used.all():
        return positions, faces.astype(np.int32), np.arange(len(positions))
    kept = np.flatnonzero(used)
    renumbered = np.cumsum(used, dtype=np.int32) - np.int32(1)
    return positions[kept], renumbered[faces], kept


def clean_points(positions: Float64Array, warnings: list[str]) -> tuple[Float64Array, float, Float32Array, Int64Array]:
    """Keep the points that can be used, one at each place.

    positions : float64 (N, 3), anything
    warnings : gets a sentence for each kind of point dropped
    Returns origin, scale and kept positions (K, 3) as `place` does, and their old indices (K,).
    Raises UnreadableFile where no point is left, or there are more than MOST_POINTS.
    """
    if len(positions) == 0:
        raise UnreadableFile("nothing to draw: it holds neither faces nor points")
    if len(positions) > MOST_POINTS:
        raise UnreadableFile(f"too large: {len(positions):,} points, of which {MOST_POINTS:,} can be counted")
    kept = np.flatnonzero(usable_positions(positions))
    if len(kept) < len(positions):
        warnings.append(counted("dropped", len(positions) - len(kept), "point", "whose positions are not finite"))
    if len(kept) == 0:
        raise UnreadableFile("nothing to draw: no point has a finite position")
    origin, scale, relative = place(positions[kept])
    _, first = unique_positions(relative)
    if len(first) < len(relative):
        warnings.append(counted("dropped", len(relative) - len(first), "duplicate point"))
    return origin, scale, relative[first], kept[first]


def place(positions: Float64Array) -> tuple[Float64Array, float, Float32Array]:
    """Move positions (N, 3) into model space.

    Returns the origin, the centre of the bounding box, float64 (3,); the scale, the power of two for which the box's
    largest half extent is in (1/2, 1] (1 where the box is a point); and the positions in model space, float32 (N, 3).
    """
    lowest, highest = positions.min(axis=0), positions.max(axis=0)
    origin = 0.5 * lowest + 0.5 * highest
    reach = float(np.maximum(highest - origin, origin - lowest).max())
    mantissa, exponent = math.frexp(reach)
    # Denormal lengths have too few digits to be scaled up, and no unit is as short.
    exponent = max(exponent - 1 if mantissa == 0.5 else exponent, SMALLEST_EXPONENT) if reach > 0.0 else 0
    scale = math.ldexp(1.0, exponent)
    relative = np.subtract(positions, origin)
    relative /= scale
    return origin, scale, np.ascontiguousarray(relative, np.float32)


def distinct_corners(faces: Int32Array) -> BoolArray:
    """Return for each of `faces` (T, 3) whether its three indices differ."""
    a, b, c = faces.T
    distinct: BoolArray = (a != b) & (b != c) & (c != a)
    return distinct


@njit(cache=True, nogil=True, parallel=True)
def has_area(positions: Float32Array, faces: Int32Array) -> npt.NDArray[np.bool_]:
    """Return for each of `faces` (T, 3) whether it is a triangle: distinct corners that are not on one line."""
    good = np.empty(len(faces), np.bool_)
    for t in prange(len(faces)):
        longest = 0.0
        u = np.empty(3)
        v = np.empty(3)
        for k in range(3):
            u[k] = np.float64(positions[faces[t, 1], k]) - np.float64(positions[faces[t, 0], k])
            v[k] = np.float64(positions[faces[t, 2], k]) - np.float64(positions[faces[t, 0], k])
        for d in (u, v, v - u):
            longest = max(longest, d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        x = u[1] * v[2] - u[2] * v[1]
        y = u[2] * v[0] - u[0] * v[2]
        z = u[0] * v[1] - u[1] * v[0]
        good[t] = math.sqrt(x * x + y * y + z * z) > SMALLEST_HEIGHT * longest
    return good
