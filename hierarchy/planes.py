"""The plane of every node's disc: the area-weighted mean normal and the mean place of the primitives below it.

Both are sums over leaves, added up from the bottom: every leaf is looked at once, and not once on every level.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from hierarchy.borrowing import BORROWING
from hierarchy.octree import WORTH_SHARING, generations

# Sums of a node: area times normal, area, and area times centre.
SUMS = 7
# Below this share of the summed areas the mean normal is noise (the sides of a thin sheet cancel).
MEAN_NORMAL_MIN = 0.3


@nb.njit(**BORROWING)
def _add_below(normals, centres, areas, octree, node, sums):  # type: ignore[no-untyped-def]
    """Write to a row of sums, float64 (M, SUMS), the sums over all leaves below a node, those of its children known."""
    first_child, child_count, begin, end = octree
    nx = ny = nz = total = x = y = z = 0.0
    first, last = first_child[node], first_child[node] + child_count[node]
    leaf = begin[node]
    for child in range(first, last + 1):
        # The leaves between two children hang on this node itself.
        for hangs in range(leaf, begin[child] if child < last else end[node]):
            area = areas[hangs]
            nx, ny, nz = nx + area * normals[hangs, 0], ny + area * normals[hangs, 1], nz + area * normals[hangs, 2]
            x, y, z = x + area * centres[hangs, 0], y + area * centres[hangs, 1], z + area * centres[hangs, 2]
            total += area
        if child < last:
            leaf = end[child]
            nx, ny, nz = nx + sums[child, 0], ny + sums[child, 1], nz + sums[child, 2]
            x, y, z = x + sums[child, 4], y + sums[child, 5], z + sums[child, 6]
            total += sums[child, 3]
    mine = sums[node]
    mine[0], mine[1], mine[2], mine[3], mine[4], mine[5], mine[6] = nx, ny, nz, total, x, y, z


@nb.njit(cache=True, nogil=True, parallel=True)
def write_plane_sums(normals, centres, areas, octree, sums):  # type: ignore[no-untyped-def]
    """Write every node's sums of area * normal, area and area * centre over its leaves to sums, float64 (M, SUMS).

    octree : first_child, child_count, leaf_begin and leaf_end
    """
    ends = generations(octree[0], octree[1])
    for k in range(len(ends) - 1):
        if ends[k] - ends[k + 1] < WORTH_SHARING:
            for node in range(ends[k + 1], ends[k]):
                _add_below(normals, centres, areas, octree, node, sums)
            continue
        for node in nb.prange(ends[k + 1], ends[k]):
            _add_below(normals, centres, areas, octree, node, sums)


@nb.njit(**BORROWING)
def mean_normal(sums, axes, node):  # type: ignore[no-untyped-def]
    """Return a node's mean normal, three floats: that of its row of sums, or the cone's axis where that vanishes."""
    x, y, z = sums[node, 0], sums[node, 1], sums[node, 2]
    norm = math.sqrt(x * x + y * y + z * z)
    if norm <= MEAN_NORMAL_MIN * sums[node, 3]:
        x, y, z = np.float64(axes[node, 0]), np.float64(axes[node, 1]), np.float64(axes[node, 2])
        norm = math.sqrt(x * x + y * y + z * z)
    return x / norm, y / norm, z / norm
