"""Footprints of small subtrees: the leaves near any of their discs are gathered once and looked at for each in one go.

All but two nodes in a hundred lie in subtrees of a hundred leaves. Their discs lie over the same leaves, so that
looking for those from every node anew, down the tree, takes far longer than the arithmetic. Side by side in rows they
are compared with a disc many at a time, in single precision and without branches. What is near a smaller subtree is
gathered from what is near the larger one. What lies about a disc's rim is then measured in double precision.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from hierarchy.borrowing import BORROWING
from hierarchy.cones import EVERYTHING, widened_cosine
from hierarchy.joined_cones import join_farthest_first
from hierarchy.near_nodes import meets
from hierarchy.under_discs import BORDER, FAR_SIDE, REACH, RIM_POINTS, point_is_under, write_rim

# Leaves that subtrees may have for which leaves are gathered: from the whole, from what the one before has, and so on.
SIZES = (256, 32)
# Leaves that can be gathered. No power of two, so that not all rows begin in the same lines of the cache.
ROOM = 2064
TOO_MANY = -1
# Leaves of a node that are looked at one by one, sooner than its children.
FEW = 16
# Where the rows of a patch begin: centres, extents and normals. They are in one array since what is computed from
# one array and written to another is vectorised.
X, Y, Z, EXTENT, NX, NY, NZ, AX, AY, AZ, BX, BY, BZ, CX, CY, CZ, END = (ROOM * row for row in range(17))
# More than what single precision is off by, relative.
ROUNDING = 6e-7
# Nodes that can wait: each has at most two children, and paths are at most 74 nodes long (octree.py).
DEEPEST = 160


@nb.njit(cache=True, nogil=True)
def patch_room():  # type: ignore[no-untyped-def]
    """Return what patches are measured in: rows and leaves of each size, flags, places, normals to join, and a rim."""
    return (
        np.empty((len(SIZES), END), np.float32),
        np.empty((len(SIZES), ROOM), np.int32),
        np.empty(ROOM, np.int32),
        np.empty(2 * ROOM, np.int32),
        np.empty((ROOM, 3), np.float64),
        np.empty((RIM_POINTS, 3), np.float64),
        np.empty((3, DEEPEST), np.int32),
    )


@nb.njit(**BORROWING)
def gather(nodes, node, shapes, box, entries, count, stack, room):  # type: ignore[no-untyped-def]
    """Gather the leaves that may be under a disc of a subtree.

    box : around all of its discs; entries, count : what is near the subtree
    stack : int32, to work in; room : as `patch_room` returns it
    Returns how many leaves there are, or TOO_MANY.
    """
    positions, indices, normals, centres, extents = shapes
    rows, leaves = room[0][0], room[1][0]
    found = 0
    for k in range(count):
        stack[k] = entries[k]
    stack[count] = node
    top = count + 1
    while top > 0:
        top -= 1
        entry = stack[top]
        inner = nodes[entry if entry >= 0 else ~entry]
        begin, last = inner["leaf_begin"], inner["first_child"]
        if entry >= 0:
            x, y, z = np.float64(inner["x"]), np.float64(inner["y"]), np.float64(inner["z"])
            if not meets(box, x, y, z, np.float64(inner["sphere"])):
                continue
        if entry < 0 or inner["leaf_end"] - begin > FEW:
            last += inner["child_count"]
        for child in range(inner["first_child"], last + 1):
            end = nodes[child]["leaf_begin"] if child < last else inner["leaf_end"]
            for leaf in range(begin, end):
                x, y, z = np.float64(centres[leaf, 0]), np.float64(centres[leaf, 1]), np.float64(centres[leaf, 2])
                if meets(box, x, y, z, np.float64(extents[leaf])):
                    if found == ROOM:
                        return TOO_MANY
                    leaves[found] = leaf
                    found += 1
            if child < last:
                begin = nodes[child]["leaf_end"]
                if entry >= 0:
                    stack[top] = child
                    top += 1
    for k in range(found):
        leaf = leaves[k]
        rows[X + k], rows[Y + k], rows[Z + k] = centres[leaf, 0], centres[leaf, 1], centres[leaf, 2]
        rows[NX + k], rows[NY + k], rows[NZ + k] = normals[leaf, 0], normals[leaf, 1], normals[leaf, 2]
        rows[EXTENT + k] = extents[leaf]
    if len(indices) > 0:
        for k in range(found):
            a, b, c = indices[leaves[k], 0], indices[leaves[k], 1], indices[leaves[k], 2]
            rows[AX + k], rows[AY + k], rows[AZ + k] = positions[a, 0], positions[a, 1], positions[a, 2]
            rows[BX + k], rows[BY + k], rows[BZ + k] = positions[b, 0], positions[b, 1], positions[b, 2]
            rows[CX + k], rows[CY + k], rows[CZ + k] = positions[c, 0], positions[c, 1], positions[c, 2]
    return found


@nb.njit(**BORROWING)
def _flag_in_box(rows, count, box, flags):  # type: ignore[no-untyped-def]
    """Flag the leaves of a patch that may meet a box, by 1, all others by 0."""
    low_x, low_y, low_z, high_x, high_y, high_z = box[0], box[1], box[2], box[3], box[4], box[5]
    zero, wider = np.float32(0.0), np.float32(1.0 + ROUNDING)
    for k in range(count):
        x, y, z = rows[X + k], rows[Y + k], rows[Z + k]
        dx, dy = max(low_x - x, x - high_x, zero), max(low_y - y, y - high_y, zero)
        dz = max(low_z - z, z - high_z, zero)
        reach = rows[EXTENT + k] * wider
        flags[k] = dx * dx + dy * dy + dz * dz <= reach * reach


@nb.njit(**BORROWING)
def _narrow(level, count, box, triangles, room):  # type: ignore[no-untyped-def]
    """Gather what may be under the discs in a box from what has been gathered at a level; return how many leaves."""
    rows, leaves, flags, which = room[0][level], room[1][level], room[2], room[3]
    _flag_in_box(rows, count, box, flags)
    found = 0
    for k in range(count):
        which[found] = k
        found += flags[k]
    some, some_leaves = room[0][level + 1], room[1][level + 1]
    for k in range(found):
        some_leaves[k] = leaves[which[k]]
    for row in range(0, END if triangles else AX, ROOM):
        for k in range(found):
            some[row + k] = rows[row + which[k]]
    return found


@nb.njit(**BORROWING)
def _flag_under(rows, leaves, count, triangles, disc, begin, end, flags):  # type: ignore[no-untyped-def]
    """Flag the leaves of a patch under a disc by 2, those to be measured by 1, others and its own, [begin, end), by 0.

    triangles : bool, literal; disc : centre, radius and normal, float32
    """
    px, py, pz, radius, nx, ny, nz = disc
    far_side, wider = np.float32(FAR_SIDE - ROUNDING), np.float32(1.0 + ROUNDING)
    sure, reach = radius * np.float32(1.0 - ROUNDING), radius * np.float32(REACH)
    for k in range(count):
        dx, dy, dz = rows[X + k] - px, rows[Y + k] - py, rows[Z + k] - pz
        distance2 = dx * dx + dy * dy + dz * dz
        if triangles:
            ax, ay, az = rows[AX + k] - px, rows[AY + k] - py, rows[AZ + k] - pz
            bx, by, bz = rows[BX + k] - px, rows[BY + k] - py, rows[BZ + k] - pz
            cx, cy, cz = rows[CX + k] - px, rows[CY + k] - py, rows[CZ + k] - pz
            a2, b2, c2 = ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz, cx * cx + cy * cy + cz * cz
            distance2 = min(distance2, a2, b2, c2)
        else:
            sure = reach = (radius + rows[EXTENT + k]) * wider
        faces = rows[NX + k] * nx + rows[NY + k] * ny + rows[NZ + k] * nz >= far_side
        other = faces & ((leaves[k] < begin) | (leaves[k] >= end))
        flags[k] = ((distance2 <= sure * sure) & other) + ((distance2 <= reach * reach) & other)


@nb.njit(**BORROWING)
def _triangle_is_under(rows, k, px, py, pz, nx, ny, nz, radius2):  # type: ignore[no-untyped-def]
    """Tell whether the centre of a triangle of a patch, or one of its corners, is under a disc."""
    for row in (X, AX, BX, CX):
        dx, dy, dz = rows[row + k] - px, rows[row + ROOM + k] - py, rows[row + 2 * ROOM + k] - pz
        if point_is_under(dx, dy, dz, nx, ny, nz, radius2):
            return True
    return False


@nb.njit(**BORROWING)
def _overhang(centres, extents, leaves, count, rim, near):  # type: ignore[no-untyped-def]
    """Return how far a point of the rim is at most from some leaves, 0 where none is farther than `near`."""
    farthest = 0.0
    for k in range(RIM_POINTS):
        x, y, z = rim[k, 0], rim[k, 1], rim[k, 2]
        gap = math.inf
        for j in range(count):
            leaf = leaves[j]
            extent = np.float64(extents[leaf])
            distance2 = (centres[leaf, 0] - x) ** 2 + (centres[leaf, 1] - y) ** 2 + (centres[leaf, 2] - z) ** 2
            # The root is taken only where it matters.
            if distance2 < (gap + extent) ** 2:
                gap = math.sqrt(distance2) - extent
                if gap <= near:
                    break
        if gap > near:
            farthest = max(farthest, gap)
    return farthest


@nb.njit(**BORROWING)
def _footprint(nodes, node, discs, shapes, closed, level, count, room, cap):  # type: ignore[no-untyped-def]
    """Write the cone of a disc's footprint to cap, float64 (4,); return its relief.

    discs : normals and thicknesses of all discs
    level, count : where the leaves that may be under the disc have been gathered, and how many there are
    """
    normals, thickness = discs
    _, indices, _, centres, extents = shapes
    _, _, flags, which, vectors, rim, _ = room
    rows, leaves = room[0][level], room[1][level]
    me = nodes[node]
    # Its own leaves are in the cone and the thickness.
    begin, end = me["leaf_begin"], me["leaf_end"]
    disc = (me["x"], me["y"], me["z"], me["radius"], normals[node, 0], normals[node, 1], normals[node, 2])
    if len(indices) > 0:
        _flag_under(rows, leaves, count, True, disc, begin, end, flags)
    else:
        _flag_under(rows, leaves, count, False, disc, begin, end, flags)
    found = 0
    for k in range(count):
        which[found] = k
        found += flags[k] > 0
    px, py, pz, radius = np.float64(me["x"]), np.float64(me["y"]), np.float64(me["z"]), np.float64(me["radius"])
    nx, ny, nz = np.float64(normals[node, 0]), np.float64(normals[node, 1]), np.float64(normals[node, 2])
    x, y, z = np.float64(me["axis_x"]), np.float64(me["axis_y"]), np.float64(me["axis_z"])
    norm = math.sqrt(x * x + y * y + z * z)
    cap[0], cap[1], cap[2], cap[3] = x / norm, y / norm, z / norm, me["cone_cos"]
    relief = np.float64(thickness[node])
    collected = under = 0
    for k in range(found):
        i = which[k]
        if flags[i] == 1 and not _triangle_is_under(rows, i, px, py, pz, nx, ny, nz, radius * radius):
            continue
        which[under] = leaves[i]
        under += 1
        relief = max(relief, abs((rows[X + i] - px) * nx + (rows[Y + i] - py) * ny + (rows[Z + i] - pz) * nz))
        x, y, z = np.float64(rows[NX + i]), np.float64(rows[NY + i]), np.float64(rows[NZ + i])
        # Not of unit length to the last bit: what is all but on the cap's rim is measured.
        if cap[0] * x + cap[1] * y + cap[2] * z < cap[3] + 1e-6:
            unit = 1.0 / math.sqrt(x * x + y * y + z * z)
            x, y, z = unit * x, unit * y, unit * z
            vectors[collected, 0], vectors[collected, 1], vectors[collected, 2] = x, y, z
            collected += cap[0] * x + cap[1] * y + cap[2] * z < cap[3]
    join_farthest_first(cap, vectors[:collected])
    if not closed:
        # Its own leaves may be near the rim, too.
        for leaf in range(begin, end):
            which[under] = leaf
            under += 1
        near = BORDER * radius
        write_rim(px, py, pz, radius, nx, ny, nz, rim)
        overhang = min(_overhang(centres, extents, which, under, rim, near), radius)
        if overhang > near:
            cap[3] = EVERYTHING
            relief = max(relief, overhang)
    return relief


@nb.njit(**BORROWING)
def measure_patch(nodes, root, discs, shapes, boxes, closed, count, room, caps, reliefs):  # type: ignore[no-untyped-def]
    """Measure the footprints of a small subtree, after `gather` has returned `count` for it.

    discs : normals and thicknesses of all discs; boxes : around the discs of each node and all below it
    caps, reliefs : float64 (M, 4) and float32 (M,), written to
    """
    stack, levels, counts = room[6]
    stack[0], levels[0], counts[0] = root, 0, count
    top = 1
    while top > 0:
        top -= 1
        node, level, count = stack[top], levels[top], counts[top]
        if level + 1 < len(SIZES) and nodes[node]["leaf_end"] - nodes[node]["leaf_begin"] <= SIZES[level + 1]:
            count = _narrow(level, count, boxes[node], len(shapes[1]) > 0, room)
            level += 1
        reliefs[node] = _footprint(nodes, node, discs, shapes, closed, level, count, room, caps[node])
        caps[node, 3] = widened_cosine(caps[node, 3])
        for child in range(nodes[node]["first_child"], nodes[node]["first_child"] + nodes[node]["child_count"]):
            stack[top], levels[top], counts[top] = child, level, count
            top += 1
