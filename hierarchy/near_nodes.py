"""Which subtrees lie near a disc, as lists that every node hands down to its children.

What is near a child is near its parent, so that nobody has to search from the root. Near is what meets the box around
the discs of a node and of all below it: a child's disc may well stick out of its parent's. A list's entry is a node,
which stands for its whole subtree, or the complement ~node, which stands for the leaves that hang on the node itself.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from hierarchy.borrowing import BORROWING
from hierarchy.under_discs import REACH

# Entries up to which lists are taken apart into finer ones. A disc on a surface has a dozen neighbours of its own size.
LONG = 64
# Entries that a list can have: two more than the parent's where it is long, on a path of at most 74 nodes (octree.py).
LONGEST = LONG + 2 * 80
ROUNDING = 3e-7


@nb.njit(cache=True, nogil=True, inline="always")
def reaches(node, x, y, z, radius):  # type: ignore[no-untyped-def]
    """Tell whether a node's bounding sphere meets a sphere."""
    dx, dy, dz = node["x"] - x, node["y"] - y, node["z"] - z
    limit = radius + node["sphere"]
    return dx * dx + dy * dy + dz * dz <= limit * limit


@nb.njit(cache=True, nogil=True, parallel=True)
def note_hanging_leaves(nodes, hanging):  # type: ignore[no-untyped-def]
    """Write for every node whether leaves hang on it that are in none of its children to hanging, bool (M,)."""
    for node in nb.prange(len(nodes)):
        count = nodes[node]["leaf_end"] - nodes[node]["leaf_begin"]
        first = nodes[node]["first_child"]
        for child in range(first, first + nodes[node]["child_count"]):
            count -= nodes[child]["leaf_end"] - nodes[child]["leaf_begin"]
        hanging[node] = count > 0


@nb.njit(cache=True, nogil=True)
def write_boxes_of_discs(nodes, boxes):  # type: ignore[no-untyped-def]
    """Write boxes around what may be under every node's disc and all discs below it, float32 (M, 6): low, high."""
    for node in range(len(nodes) - 1, -1, -1):
        me = nodes[node]
        # Float32 rounds the ends by no more than that: model space is about one unit large.
        radius = REACH * np.float64(me["radius"]) + ROUNDING
        first = me["first_child"]
        for axis, middle in enumerate((me["x"], me["y"], me["z"])):
            low, high = np.float32(middle - radius), np.float32(middle + radius)
            for child in range(first, first + me["child_count"]):
                low, high = min(low, boxes[child, axis]), max(high, boxes[child, 3 + axis])
            boxes[node, axis], boxes[node, 3 + axis] = low, high


@nb.njit(**BORROWING)
def meets(box, x, y, z, radius):  # type: ignore[no-untyped-def]
    """Tell whether a sphere meets a box."""
    dx = max(box[0] - x, x - box[3], 0.0)
    dy = max(box[1] - y, y - box[4], 0.0)
    dz = max(box[2] - z, z - box[5], 0.0)
    return dx * dx + dy * dy + dz * dz <= radius * radius


@nb.njit(**BORROWING)
def _hanging_leaf_meets(nodes, node, shapes, box):  # type: ignore[no-untyped-def]
    """Tell whether the bounding sphere of a leaf that hangs on the node itself meets a box."""
    _, _, _, centres, extents = shapes
    inner = nodes[node]
    last = inner["first_child"] + inner["child_count"]
    begin = inner["leaf_begin"]
    for child in range(inner["first_child"], last + 1):
        end = nodes[child]["leaf_begin"] if child < last else inner["leaf_end"]
        for leaf in range(begin, end):
            x, y, z = np.float64(centres[leaf, 0]), np.float64(centres[leaf, 1]), np.float64(centres[leaf, 2])
            if meets(box, x, y, z, np.float64(extents[leaf])):
                return True
        if child < last:
            begin = nodes[child]["leaf_end"]
    return False


@nb.njit(**BORROWING)
def hand_down(nodes, families, shapes, parent, child, entries, count, near):  # type: ignore[no-untyped-def]
    """Write what is near a node's child to `near`, int32 (LONGEST,); return how many entries that is.

    families : what `note_hanging_leaves` and `write_boxes_of_discs` write
    shapes : positions, indices, normals, centres and extents of the leaves
    entries, count : what is near the parent
    """
    me = nodes[child]
    hanging, box = families[0], families[1][child]
    found = 0
    # Taken from the end of `near`, whose beginning gets what stays.
    stack = len(near)
    for position in range(-1, count):
        if position < 0:
            # The parent's own subtree, but for the child.
            first = nodes[parent]["first_child"]
            for sibling in range(first, first + nodes[parent]["child_count"]):
                if sibling != child:
                    stack -= 1
                    near[stack] = sibling
            if hanging[parent]:
                stack -= 1
                near[stack] = ~parent
        else:
            stack -= 1
            near[stack] = entries[position]
        while stack < len(near):
            entry = near[stack]
            stack += 1
            if entry < 0:
                if _hanging_leaf_meets(nodes, ~entry, shapes, box):
                    near[found] = entry
                    found += 1
                continue
            inner = nodes[entry]
            x, y, z = np.float64(inner["x"]), np.float64(inner["y"]), np.float64(inner["z"])
            if not meets(box, x, y, z, np.float64(inner["sphere"])):
                continue
            children = inner["child_count"]
            # What is left of the parent's list may have to be kept as it is.
            if inner["sphere"] > me["sphere"] and found + (len(near) - stack) + children + count - position <= LONG:
                for grandchild in range(inner["first_child"], inner["first_child"] + children):
                    stack -= 1
                    near[stack] = grandchild
                if hanging[entry]:
                    stack -= 1
                    near[stack] = ~entry
                continue
            near[found] = entry
            found += 1
    return found
