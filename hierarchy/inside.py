"""Tell whether an eye is inside a closed mesh, where it sees nothing but backs."""

from __future__ import annotations

import numba as nb
import numpy as np

from hierarchy.hierarchy import Hierarchy
from hierarchy.leaves import Triangles
from hierarchy.view import View
from hierarchy.winding import FRAME, signed_crossing

# Nodes that wait: a path of the tree has 72 nodes at most, each with a few brothers.
STACK = 4096


def eye_is_inside(hierarchy: Hierarchy, view: View) -> bool:
    """Tell whether the eye is inside a closed mesh: whether the winding number around it is not 0.

    A ray from the eye is followed through the hierarchy, some 100 nodes; False for what is open, for point hierarchies,
    whose surfels have no crossings, and for parallel view rays, which come from outside.
    """
    leaves = hierarchy.leaves
    if not hierarchy.closed or view.is_parallel or not isinstance(leaves, Triangles):
        return False
    if (np.abs(view.eye) > hierarchy.half_extents).any():
        return False
    return bool(_winding_number(hierarchy.nodes, leaves.positions, leaves.indices, view.eye, FRAME) != 0)


@nb.njit(cache=True, nogil=True, inline="always")
def _turned(frame, x, y, z):  # type: ignore[no-untyped-def]
    return (
        frame[0, 0] * x + frame[0, 1] * y + frame[0, 2] * z,
        frame[1, 0] * x + frame[1, 1] * y + frame[1, 2] * z,
        frame[2, 0] * x + frame[2, 1] * y + frame[2, 2] * z,
    )


@nb.njit(cache=True, nogil=True)
def _winding_number(nodes, positions, indices, eye, frame):  # type: ignore[no-untyped-def]
    number = 0
    stack = np.empty(STACK, np.int32)
    stack[0] = 0
    top = 1
    while top > 0:
        top -= 1
        node = nodes[stack[top]]
        x, y, z = _turned(frame, node["x"] - eye[0], node["y"] - eye[1], node["z"] - eye[2])
        sphere = np.float64(node["sphere"])
        # The ray runs along z. Slightly wider than the sphere, whose radius is rounded.
        if x * x + y * y > 1.0001 * sphere * sphere or z < -1.0001 * sphere:
            continue
        first, last = node["first_child"], node["first_child"] + node["child_count"]
        begin = node["leaf_begin"]
        for child in range(first, last + 1):
            # The leaves between two children hang on this node itself.
            end = nodes[child]["leaf_begin"] if child < last else node["leaf_end"]
            for leaf in range(begin, end):
                a, b, c = indices[leaf, 0], indices[leaf, 1], indices[leaf, 2]
                ax, ay, az = _turned(
                    frame, positions[a, 0] - eye[0], positions[a, 1] - eye[1], positions[a, 2] - eye[2]
                )
                bx, by, bz = _turned(
                    frame, positions[b, 0] - eye[0], positions[b, 1] - eye[1], positions[b, 2] - eye[2]
                )
                cx, cy, cz = _turned(
                    frame, positions[c, 0] - eye[0], positions[c, 1] - eye[1], positions[c, 2] - eye[2]
                )
                sign, depth = signed_crossing(ax, ay, az, bx, by, bz, cx, cy, cz)
                if depth > 0.0:
                    number += sign
            if child < last:
                begin = nodes[child]["leaf_end"]
                stack[top] = child
                top += 1
    return number
