"""How much the normals below a node vary, at the node's own size and at sizes down to 1/32 of it.

What a tile of w_s texels leaves out of the normals is what varies between two of its texels, and what a lookup beside
the right place gets wrong is what varies over that distance. Both follow from the spread of the normals in patches of
that size: the root mean square of their angle to the patch's mean normal. Patches are the nodes of the hierarchy, of
which every second level halves the size, and below them parts of leaf triangles, over which normals vary linearly.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from hierarchy.leaves import LeafShapes, Leaves, Triangles
from hierarchy.model import UInt16Array
from hierarchy.node_sums import node_sums

# Patches of 1, 1/2, 1/4 ... 1/32 of a node's radius: the spacings of the texels of 2 to 32 a side are among them.
SCALES = 6
LEVELS_PER_SCALE = 2
# Radians of a unit of the stored spreads; the largest spread there is, of normals all over the sphere, is sqrt(2).
UNIT = 1.5 / 65535.0


@nb.njit(cache=True, nogil=True, parallel=True)
def _triangle_sums(normals, indices, areas, sums):  # type: ignore[no-untyped-def]
    """Write area * mean normal, area, and area * mean square angle to it, of every triangle to sums, float64 (N, 5).

    Over a triangle with linearly varying values the mean square deviation is a twelfth of the sum of the corners'.
    """
    for leaf in nb.prange(len(indices)):
        a, b, c = indices[leaf, 0], indices[leaf, 1], indices[leaf, 2]
        area, square = np.float64(areas[leaf]), 0.0
        for k in range(3):
            na, nb_, nc = np.float64(normals[a, k]), np.float64(normals[b, k]), np.float64(normals[c, k])
            mean = (na + nb_ + nc) / 3.0
            sums[leaf, k] = area * mean
            square += (na - mean) ** 2 + (nb_ - mean) ** 2 + (nc - mean) ** 2
        sums[leaf, 3], sums[leaf, 4] = area, area * square / 12.0


@nb.njit(cache=True, nogil=True, parallel=True)
def _own_spreads(below):  # type: ignore[no-untyped-def]
    """Return the mean square angle of each node's normals to their mean."""
    squares = np.empty(len(below))
    for node in nb.prange(len(below)):
        x, y, z, area = below[node, 0], below[node, 1], below[node, 2], below[node, 3]
        # A mean of unit vectors at small angles s to it has a length of 1 - s^2 / 2.
        mean = math.sqrt(x * x + y * y + z * z) / area if area > 0.0 else 1.0
        squares[node] = max(2.0 * (1.0 - mean), 0.0)
    return squares


@nb.njit(cache=True, nogil=True, parallel=True)
def _one_level_below(first_child, child_count, areas, squares, hanging, share):  # type: ignore[no-untyped-def]
    """Return each node's mean by area over its children, and over the leaves that hang on it.

    share : of the mean square angle of a whole leaf that is left at this level
    """
    means = np.empty(len(areas))
    for node in nb.prange(len(areas)):
        total = share * hanging[node]
        for child in range(first_child[node], first_child[node] + child_count[node]):
            total += areas[child] * squares[child]
        means[node] = total / areas[node] if areas[node] > 0.0 else 0.0
    return means


def normal_spreads(nodes: np.ndarray, leaves: Leaves, shapes: LeafShapes) -> UInt16Array:
    """Measure the spread of the normals below every node.

    nodes : NODE (M,), of which only the topology is read
    Returns uint16 (M, SCALES), in units of UNIT radians: root mean square, by area, of the angle between the surface's
    normals and the mean normal of the patch that they lie in, for patches of 2^-k of the node's radius.
    """
    sums = np.zeros((len(shapes.areas), 5))
    if isinstance(leaves, Triangles):
        _triangle_sums(leaves.normals, leaves.indices, shapes.areas, sums)
    else:
        np.multiply(shapes.normals, shapes.areas[:, None], out=sums[:, :3])
        sums[:, 3] = shapes.areas
    first_child, child_count = nodes["first_child"], nodes["child_count"]
    below, hanging = node_sums(sums, nodes["leaf_begin"], nodes["leaf_end"], first_child, child_count)
    areas, squares, of_hanging = below[:, 3].copy(), _own_spreads(below), hanging[:, 4].copy()
    spreads = np.empty((len(nodes), SCALES), np.uint16)
    # Half the size has half the angle, so every level halves its square.
    share = 1.0
    for scale in range(SCALES):
        spreads[:, scale] = np.rint(np.sqrt(squares) / UNIT)
        for _ in range(LEVELS_PER_SCALE if scale + 1 < SCALES else 0):
            squares = _one_level_below(first_child, child_count, areas, squares, of_hanging, share)
            share *= 0.5
    return spreads
