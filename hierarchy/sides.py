"""Which side of a surface is out: by the volume it encloses, and by its normals."""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from hierarchy.area_vector import area_vector
from hierarchy.model import BoolArray, Float32Array, Int32Array


@njit(cache=True, nogil=True, parallel=True)
def signed_volume(positions: Float32Array, faces: Int32Array) -> float:
    """Return six times the volume inside closed `faces` (T, 3), negative where they are inside out.

    The sum of the tetrahedra between the faces and the first vertex, in doubles, which hold it up to coordinates
    of 1e100.
    """
    volume = 0.0
    ox, oy, oz = np.float64(positions[0, 0]), np.float64(positions[0, 1]), np.float64(positions[0, 2])
    for t in prange(len(faces)):
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        ax, ay, az = positions[a, 0] - ox, positions[a, 1] - oy, positions[a, 2] - oz
        bx, by, bz = positions[b, 0] - ox, positions[b, 1] - oy, positions[b, 2] - oz
        cx, cy, cz = positions[c, 0] - ox, positions[c, 1] - oy, positions[c, 2] - oz
        volume += ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    return volume


@njit(cache=True, nogil=True, parallel=True)
def most_area_disagrees(positions: Float32Array, faces: Int32Array, normals: Float32Array, ignored: BoolArray) -> bool:
    """Tell whether most of the area faces away from the sum of its corners' normals.

    positions, normals : float32 (V, 3); faces : int32 (T, 3)
    ignored : (V,), whose normals say nothing
    """
    agreeing, disagreeing = 0.0, 0.0
    for t in prange(len(faces)):
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        if ignored[a] or ignored[b] or ignored[c]:
            continue
        x, y, z = area_vector(positions, a, b, c)
        area = math.sqrt(x * x + y * y + z * z)
        dot = x * (normals[a, 0] + normals[b, 0] + normals[c, 0])
        dot += y * (normals[a, 1] + normals[b, 1] + normals[c, 1])
        dot += z * (normals[a, 2] + normals[b, 2] + normals[c, 2])
        if dot > 0.0:
            agreeing += area
        elif dot < 0.0:
            disagreeing += area
    return disagreeing > agreeing
