"""The octree's shape: nodes in breadth-first order over leaves in Morton order.

A node covers the contiguous range [leaf_begin, leaf_end) of leaves and has the contiguous children
[first_child, first_child + child_count). Cells with one child are collapsed. A cell with fewer than `MIN_LEAVES`
leaves becomes no node of its own: its leaves hang directly on the parent, in the gaps that the children leave in
the parent's range. So a node costs memory only where it stands for several primitives.

An octree's cell is halved along x, then y, then z, and each half is a node. Radii then shrink by about 1.4 from level
to level instead of 2, so that a cut stays closer under its limit: on Igea at r_inner 16 the inside takes 3,700 splats
instead of 5,000.

Whatever the leaves are like, no path is longer than `most_levels`: all work that a node does on its leaves adds up to
at most so many visits of every leaf, and a traversal's stack can be of fixed size.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba as nb
import numpy as np

from hierarchy.model import Int32Array, UInt16Array
from hierarchy.morton import SAME_PLACE

# Igea has 121,000 nodes with at least 4 leaves each, 169,000 with 3 and 269,000 with 2; below 4 the tiles' memory grows
# faster than the cut shrinks.
MIN_LEAVES = 4


@dataclass(frozen=True, eq=False)
class Octree:
    """first_child, child_count, leaf_begin, leaf_end : int32 (M,), breadth-first, root first."""

    first_child: Int32Array
    child_count: Int32Array
    leaf_begin: Int32Array
    leaf_end: Int32Array


# Surfaces halve their leaves at nearly every level. Clusters in clusters need not: after SPARE_LEVELS more than
# LEVELS_PER_HALVING for each time that the leaves are halved, cells are halved by number instead of by place.
SPARE_LEVELS = 24
LEVELS_PER_HALVING = 1.5


def most_levels(leaves: int) -> int:
    """Return how many nodes there are at most on a path from the root down."""
    return int(SPARE_LEVELS + LEVELS_PER_HALVING * math.log2(max(leaves, 1))) + 2


# No place between two leaves: all are at one place, or where they are divided has yet to be found.
ONE_PLACE, UNKNOWN = -1, -2


@nb.njit(cache=True, nogil=True)
def _divisions(steps, before, behind, stack):  # type: ignore[no-untyped-def]
    """Find where cells are divided: for every step where the cells before and behind it are, int32 (N,) each.

    A cell is divided where its leaves take the step of the highest bit: that is the root of the Cartesian tree of its
    steps (Vuillemin 1980), which a stack builds in one go. The first step is none: behind it is where the whole is.
    before, behind : written to; stack : int32 (N,), to work in
    """
    # The steps on the way to the last one, each from that behind the one under it.
    before[0], behind[0] = ONE_PLACE, ONE_PLACE
    stack[0], top = 0, 1
    for i in range(1, len(steps)):
        before[i], behind[i] = ONE_PLACE, ONE_PLACE
        if steps[i] == SAME_PLACE:
            continue
        last = ONE_PLACE
        while top > 1 and steps[stack[top - 1]] > steps[i]:
            top -= 1
            last = stack[top]
        before[i] = last
        behind[stack[top - 1]] = i
        stack[top] = i
        top += 1


@nb.njit(cache=True, nogil=True)
def _division(steps, low, high):  # type: ignore[no-untyped-def]
    """Return where in (low, high) the leaves take the step of the highest bit, or ONE_PLACE."""
    highest, place = np.uint16(SAME_PLACE), ONE_PLACE
    for i in range(low + 1, high):
        if steps[i] < highest:
            highest, place = steps[i], i
    return place


@nb.njit(cache=True, nogil=True)
def _build(steps, min_leaves, divisions, octree):  # type: ignore[no-untyped-def]
    """Write first_child, child_count, begin and end of every node, and where it is divided, to int32 (N + 1,) each.

    divisions : int32 (N,) three times, to work in
    Returns how many nodes there are.
    """
    count = len(steps)
    before, behind, stack = divisions
    _divisions(steps, before, behind, stack)
    first_child, child_count, begin, end, divided_at = octree
    begin[0], end[0], divided_at[0] = 0, count, behind[0]
    nodes = 1
    node = 0
    level, level_end = 0, 1
    while node < nodes:
        if node == level_end:
            level, level_end = level + 1, nodes
        low, high, middle = begin[node], end[node], divided_at[node]
        first_child[node] = nodes
        left = right = ONE_PLACE
        if level > SPARE_LEVELS + LEVELS_PER_HALVING * math.log2(count / (high - low)):
            middle, left, right = ONE_PLACE, UNKNOWN, UNKNOWN
        elif middle == UNKNOWN:
            middle = _division(steps, low, high)
            left = right = ONE_PLACE if middle == ONE_PLACE else UNKNOWN
        elif middle != ONE_PLACE:
            left, right = before[middle], behind[middle]
        if middle == ONE_PLACE:
            # No geometry left to split by, or too deep for it: split by number.
            middle = (low + high) >> 1 if high - low >= 2 * min_leaves else low
        if middle - low >= min_leaves:
            begin[nodes], end[nodes], divided_at[nodes] = low, middle, left
            nodes += 1
        if high - middle >= min_leaves and middle > low:
            begin[nodes], end[nodes], divided_at[nodes] = middle, high, right
            nodes += 1
        child_count[node] = nodes - first_child[node]
        node += 1
    return nodes


def build_octree(steps: UInt16Array, min_leaves: int = MIN_LEAVES) -> Octree:
    """Build the octree over leaves in Morton order.

    steps : uint16 (N,), N >= 1, the step to each leaf from the one before it, as in `morton_order`
    min_leaves : a cell with fewer leaves gets no node of its own, >= 2
    Raises ValueError where there are no leaves.
    """
    if len(steps) == 0:
        raise ValueError("an octree needs at least one leaf")
    count = len(steps)
    # A chain of nodes can shed fewer than min_leaves leaves at every step: at worst one.
    octree = tuple(np.empty(count + 1, np.int32) for _ in range(5))
    nodes = _build(steps, max(2, min_leaves), tuple(np.empty(count, np.int32) for _ in range(3)), octree)
    return Octree(*(array[:nodes].copy() for array in octree[:4]))


# Nodes from which on it is worth waking threads, which on a busy machine takes as long as some thousand nodes do.
WORTH_SHARING = 4096


@nb.njit(cache=True, nogil=True)
def generations(first_child, child_count):  # type: ignore[no-untyped-def]
    """Divide nodes, parents before children, into runs in which no node is another's child: what threads may share.

    Returns the ends of the runs, the last one's first, and 0, int32: in that order children come before parents.
    """
    ends = [np.int32(len(first_child))]
    for node in range(len(first_child) - 1, -1, -1):
        if child_count[node] > 0 and first_child[node] < ends[-1]:
            ends.append(np.int32(node + 1))
    ends.append(np.int32(0))
    return np.array(ends)
