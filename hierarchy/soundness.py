"""Whether a hierarchy is one that the kernels can run on: they check no bounds, so this does.

What holds of every hierarchy that was built is checked as far as an index, the length of a loop or the depth of a stack
follows from it. That floats are finite is left to whoever reads them.
"""

from __future__ import annotations

import math

import numpy as np

from hierarchy.hierarchy import Hierarchy
from hierarchy.leaves import Leaves, Triangles
from hierarchy.spreads import SCALES

# Kernels that go down first have a stack of 128 nodes: enough for binary trees of so many levels.
MOST_LEVELS = 127
MOST_CHILDREN = 2


def fault_of_hierarchy(hierarchy: Hierarchy) -> str:
    """Say in a few words why kernels must not run on a hierarchy; "": they may."""
    nodes, leaves, openings = hierarchy.nodes, hierarchy.leaves, hierarchy.openings
    splats = len(nodes) + (0 if isinstance(leaves, Triangles) else len(leaves))
    numbers = (hierarchy.radius, hierarchy.scale, *hierarchy.origin, *hierarchy.half_extents)
    if not all(map(math.isfinite, numbers)) or hierarchy.scale <= 0.0:
        return "its size is no number"
    if hierarchy.spreads.shape != (len(nodes), SCALES) or hierarchy.splats.shape != (splats,):
        return "not one splat and one row of spreads a node"
    if hierarchy.colors is not None and hierarchy.colors.shape != (splats, 4):
        return "not one colour a splat"
    if openings is not None and (
        openings.caps.shape[1:] != (3, 3) or openings.bare_before.shape not in ((0,), (len(leaves) + 1,))
    ):
        return "its openings are none"
    return _fault_of_leaves(leaves) or _fault_of_tree(nodes, len(leaves))


def _fault_of_leaves(leaves: Leaves) -> str:
    count = len(leaves.positions)
    if leaves.positions.shape != (count, 3) or leaves.normals.shape != (count, 3):
        return "not one normal a position"
    if leaves.colors is not None and leaves.colors.shape != (count, 4):
        return "not one colour a position"
    if not isinstance(leaves, Triangles):
        return "" if leaves.radii.shape == (count,) else "not one radius a surfel"
    indices = leaves.indices
    if indices.shape[1:] != (3,):
        return "leaves that are no triangles"
    # As unsigned numbers, negative ones are too large as well.
    return "" if indices.view(np.uint32).max(initial=0) < count else "corners that are no vertices"


def _fault_of_tree(nodes: np.ndarray, leaf_count: int) -> str:
    """Check that the nodes are a tree in breadth-first order over all leaves."""
    if len(nodes) == 0 or leaf_count == 0:
        return "nothing in it"
    first, count = nodes["first_child"].astype(np.int64), nodes["child_count"].astype(np.int64)
    begin, end = np.ascontiguousarray(nodes["leaf_begin"]), np.ascontiguousarray(nodes["leaf_end"])
    if count.min() < 0 or count.max() > MOST_CHILDREN:
        return "nodes with too many children"
    # The children of all nodes, one after the other, are all nodes but the root, each behind its parent.
    after = np.cumsum(count) + 1
    if after[-1] != len(nodes) or (first != after - count).any() or (first <= np.arange(len(nodes))).any():
        return "nodes that are no tree"
    if _levels(after) > MOST_LEVELS:
        return "too many levels"
    if begin[0] != 0 or end[0] != leaf_count or (begin >= end).any():
        return "nodes without leaves"
    parents = np.flatnonzero(count)
    firsts = first[parents]
    lasts = firsts + count[parents] - 1
    if (begin[firsts] < begin[parents]).any() or (end[lasts] > end[parents]).any():
        return "nodes with leaves of others"
    if ((end[firsts] > begin[lasts]) & (firsts < lasts)).any():
        return "nodes that share leaves"
    return ""


def _levels(after: np.ndarray) -> int:
    """Return how many levels a tree has whose nodes' children end before `after` (M,)."""
    levels, end = 1, 1
    while end < len(after) and levels <= MOST_LEVELS:
        end = int(after[end - 1])
        levels += 1
    return levels
