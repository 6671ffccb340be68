"""Whether a hierarchy is one that the kernels can run on: they check no bounds, so this does.

What holds of every hierarchy that was built is checked as far as an index, the length of a loop or the depth of a stack
follows from it. That floats are finite is left to whoever reads them.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from hierarchy.at_once import at_once
from hierarchy.hierarchy import Hierarchy
from hierarchy.leaves import Leaves, Triangles
from hierarchy.spreads import SCALES

# Kernels that go down first have a stack of 128 nodes: enough for binary trees of so many levels.
MOST_LEVELS = 127
MOST_CHILDREN = 2
# Nodes that a thread looks at, and corners: a few milliseconds of work.
PIECE, CORNERS = 1 << 19, 1 << 23

SOUND, CHILDREN, NO_TREE, LEAFLESS, OTHERS, SHARED = range(6)
FAULTS = (
    "",
    "nodes with too many children",
    "nodes that are no tree",
    "nodes without leaves",
    "nodes with leaves of others",
    "nodes that share leaves",
)


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
    corners = indices.view(np.uint32).reshape(-1)
    begins = range(0, len(corners), CORNERS)
    largest = at_once(lambda begin: corners[begin : begin + CORNERS].max(initial=0), begins)
    return "" if max(largest, default=0) < count else "corners that are no vertices"


def _fault_of_tree(nodes: np.ndarray, leaf_count: int) -> str:
    """Check that the nodes are a tree in breadth-first order over all leaves."""
    if len(nodes) == 0 or leaf_count == 0:
        return "nothing in it"
    if nodes[0]["leaf_begin"] != 0 or nodes[0]["leaf_end"] != leaf_count:
        return FAULTS[LEAFLESS]
    begins = range(0, len(nodes), PIECE)
    for fault in at_once(lambda begin: _fault_of_nodes(nodes, begin, min(begin + PIECE, len(nodes))), begins):
        if fault:
            return FAULTS[fault]
    return "" if _levels(nodes) <= MOST_LEVELS else "too many levels"


@nb.njit(cache=True, nogil=True)
def _fault_of_nodes(nodes, begin, end):  # type: ignore[no-untyped-def]
    """Return which of `FAULTS` the nodes begin .. end - 1 have first, each seen with its children and the next node."""
    total = len(nodes)
    for i in range(begin, end):
        node = nodes[i]
        first, count = np.int64(node["first_child"]), np.int64(node["child_count"])
        if not 0 <= count <= MOST_CHILDREN:
            return CHILDREN
        # The children of all nodes, one after the other, are all nodes but the root, each behind its parent.
        after = np.int64(nodes[i + 1]["first_child"]) if i + 1 < total else total
        if first + count != after or first <= i or after > total or (i == 0 and first != 1):
            return NO_TREE
        if node["leaf_begin"] >= node["leaf_end"]:
            return LEAFLESS
        if count > 0:
            eldest, youngest = nodes[first], nodes[after - 1]
            if eldest["leaf_begin"] < node["leaf_begin"] or youngest["leaf_end"] > node["leaf_end"]:
                return OTHERS
            if count > 1 and eldest["leaf_end"] > youngest["leaf_begin"]:
                return SHARED
    return SOUND


def _levels(nodes: np.ndarray) -> int:
    """Return how many levels a tree has, none beyond those that are too many."""
    levels, end = 1, 1
    while end < len(nodes) and levels <= MOST_LEVELS:
        last = nodes[end - 1]
        end = int(last["first_child"]) + int(last["child_count"])
        levels += 1
    return levels
