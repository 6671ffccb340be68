"""Sums over the leaves below every node, added up from the bottom.

Not as differences of running sums over all leaves: in those a small node beside large primitives drowns.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from hierarchy.model import Float64Array
from hierarchy.octree import Octree


@nb.njit(cache=True, nogil=True)
def _node_sums(values, begin, end, first_child, child_count):  # type: ignore[no-untyped-def]
    columns = values.shape[1]
    below = np.zeros((len(begin), columns))
    for node in range(len(begin) - 1, -1, -1):
        first, last = first_child[node], first_child[node] + child_count[node]
        leaf = begin[node]
        for child in range(first, last + 1):
            # The leaves between two children hang on this node itself.
            for hangs in range(leaf, begin[child] if child < last else end[node]):
                for k in range(columns):
                    below[node, k] += values[hangs, k]
            if child < last:
                leaf = end[child]
                for k in range(columns):
                    below[node, k] += below[child, k]
    return below


def node_sums(values: Float64Array, octree: Octree) -> Float64Array:
    """Add up values (N, C) of leaves over all leaves below each node, (M, C).

    Relative to the sum of the absolute values below a node its sum is wrong by 2^-53 times their number at most.
    """
    return _node_sums(values, octree.leaf_begin, octree.leaf_end, octree.first_child, octree.child_count)  # type: ignore[no-any-return]
