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

from hierarchy.borrowing import BORROWING
from hierarchy.leaves import LeafShapes, Leaves, Triangles
from hierarchy.model import Float64Array, UInt16Array
from hierarchy.octree import WORTH_SHARING, Octree, generations

# Patches of 1, 1/2, 1/4 ... 1/32 of a node's radius: the spacings of the texels of 2 to 32 a side are among them.
SCALES = 6
LEVELS_PER_SCALE = 2
# Radians of a unit of the stored spreads; the largest spread there is, of normals all over the sphere, is sqrt(2).
UNIT = 1.5 / 65535.0


@nb.njit(**BORROWING)
def _add_leaf(normals, indices, areas, leaf, sums):  # type: ignore[no-untyped-def]
    """Add to sums, float64 (5,), a leaf's area * mean normal, its area, and area * mean square angle to that normal.

    Over a triangle with linearly varying values the mean square deviation is a twelfth of the sum of the corners'.
    """
    area, square = areas[leaf], 0.0
    for k in range(3):
        if len(indices) > 0:
            a, b, c = indices[leaf, 0], indices[leaf, 1], indices[leaf, 2]
            na, nb_, nc = np.float64(normals[a, k]), np.float64(normals[b, k]), np.float64(normals[c, k])
            mean = (na + nb_ + nc) / 3.0
            square += (na - mean) ** 2 + (nb_ - mean) ** 2 + (nc - mean) ** 2
        else:
            mean = np.float64(normals[leaf, k])
        sums[k] += area * mean
    sums[3] += area
    sums[4] += area * square / 12.0


@nb.njit(**BORROWING)
def _add_below(normals, indices, areas, octree, node, sums):  # type: ignore[no-untyped-def]
    """Write to a row of sums what `_add_leaf` adds over all leaves below a node, to the last column but of its own."""
    first_child, child_count, begin, end = octree
    mine = sums[node]
    for k in range(5):
        mine[k] = 0.0
    first, last = first_child[node], first_child[node] + child_count[node]
    leaf = begin[node]
    for child in range(first, last + 1):
        # The leaves between two children hang on this node itself.
        for hangs in range(leaf, begin[child] if child < last else end[node]):
            _add_leaf(normals, indices, areas, hangs, mine)
        if child < last:
            leaf = end[child]
    for child in range(first, last):
        for k in range(4):
            mine[k] += sums[child, k]


@nb.njit(cache=True, nogil=True, parallel=True)
def _own_spreads(normals, indices, areas, octree, sums, total, squares, hanging):  # type: ignore[no-untyped-def]
    """Write every node's area, that times its normals' mean square angle to their mean, and `_add_leaf`'s last sum.

    octree : first_child, child_count, leaf_begin and leaf_end
    sums : float64 (M, 5), to work in
    total, squares, hanging : float64 (M,), written to; the last is over the leaves that hang on the node
    """
    ends = generations(octree[0], octree[1])
    for k in range(len(ends) - 1):
        if ends[k] - ends[k + 1] < WORTH_SHARING:
            for node in range(ends[k + 1], ends[k]):
                _add_below(normals, indices, areas, octree, node, sums)
            continue
        for node in nb.prange(ends[k + 1], ends[k]):
            _add_below(normals, indices, areas, octree, node, sums)
    for node in nb.prange(len(sums)):
        x, y, z, area = sums[node, 0], sums[node, 1], sums[node, 2], sums[node, 3]
        # A mean of unit vectors at small angles s to it has a length of 1 - s^2 / 2.
        mean = math.sqrt(x * x + y * y + z * z) / area if area > 0.0 else 1.0
        squares[node] = area * max(2.0 * (1.0 - mean), 0.0)
        total[node], hanging[node] = area, sums[node, 4]


@nb.njit(cache=True, nogil=True, parallel=True)
def _one_level_below(first_child, child_count, squares, hanging, share, below):  # type: ignore[no-untyped-def]
    """Write each node's sum over its children, and over the leaves that hang on it, to below.

    share : of the mean square angle of a whole leaf that is left at this level
    """
    last = len(squares) - 1
    for node in nb.prange(len(squares)):
        first, count = first_child[node], child_count[node]
        # A cell has two halves at most (octree.py). Both are read, there or not: no branch that could not be foreseen.
        one, other = squares[min(first, last)], squares[min(first + 1, last)]
        below[node] = share * hanging[node] + (one if count > 0 else 0.0) + (other if count > 1 else 0.0)


@nb.njit(cache=True, nogil=True, parallel=True)
def _store(areas, squares, out):  # type: ignore[no-untyped-def]
    for node in nb.prange(len(areas)):
        out[node] = np.rint(math.sqrt(squares[node] / areas[node]) / UNIT) if areas[node] > 0.0 else 0.0


def normal_spreads(octree: Octree, leaves: Leaves, shapes: LeafShapes, sums: Float64Array) -> UInt16Array:
    """Measure the spread of the normals below every node.

    sums : float64 (M, 7 or more), to work in
    Returns uint16 (M, SCALES), in units of UNIT radians: root mean square, by area, of the angle between the surface's
    normals and the mean normal of the patch that they lie in, for patches of 2^-k of the node's radius.
    """
    first_child, child_count = octree.first_child, octree.child_count
    topology = first_child, child_count, octree.leaf_begin, octree.leaf_end
    normals = leaves.normals if isinstance(leaves, Triangles) else shapes.normals
    nodes = len(first_child)
    # All but one of the arrays of a number for each node lie in the same memory: the system clears what is made anew.
    room = sums.ravel()[: 7 * nodes].reshape(7, nodes)
    rows, areas, squares, below, hanging = room[:5].reshape(nodes, 5), room[5], room[6], room[0], np.empty(nodes)
    _own_spreads(normals, shapes.indices, shapes.areas, topology, rows, areas, squares, hanging)
    spreads = np.empty((nodes, SCALES), np.uint16)
    # Half the size has half the angle, so every level halves its square.
    share = 1.0
    for scale in range(SCALES):
        _store(areas, squares, spreads[:, scale])
        for _ in range(LEVELS_PER_SCALE if scale + 1 < SCALES else 0):
            _one_level_below(first_child, child_count, squares, hanging, share, below)
            squares, below = below, squares
            share *= 0.5
    return spreads
