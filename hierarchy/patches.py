"""Footprints of small subtrees: the leaves near any of their discs are gathered once and looked at for each in one go.

All but two nodes in a hundred lie in subtrees of a hundred leaves. Their discs lie over the same leaves, so that
looking for those from every node anew, down the tree, takes far longer than the arithmetic. Side by side in rows they
are compared with a disc many at a time, in single precision and without branches: what is subtracted is stored in it,
so that nothing but the difference is rounded. What is near a smaller subtree is gathered from what is near the larger
one.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from hierarchy.borrowing import BORROWING
from hierarchy.cones import EVERYTHING, sine_of, widened_cosine
from hierarchy.extremes import NEVER_NAN, larger
from hierarchy.joined_cones import join_farthest_first
from hierarchy.near_nodes import meets
from hierarchy.under_discs import BORDER, FAR_SIDE, FLAT, RIM, RIM_POINTS, write_rim

# Leaves that subtrees may have for which leaves are gathered: from the whole, from what the one before has, and so on.
SIZES = (384, 48)
# Leaves that can be gathered. No power of two, so that not all rows begin in the same lines of the cache.
ROOM = 2576
TOO_MANY = -1
# Leaves of a node that are looked at one by one, sooner than its children.
FEW = 16
# Where the rows of a patch begin: centres, extents and normals. They are in one array since what is computed from
# one array and written to another is vectorised.
X, Y, Z, EXTENT, NX, NY, NZ, AX, AY, AZ, BX, BY, BZ, CX, CY, CZ, END = (ROOM * row for row in range(17))
# Flags that are looked at together.
EIGHT = 8
# More than what single precision is off by, relative.
ROUNDING = 6e-7
# Nodes that can wait: each has at most two children, and paths are at most 74 nodes long (octree.py).
DEEPEST = 160


@nb.njit(cache=True, nogil=True)
def patch_room():  # type: ignore[no-untyped-def]
    """Return what patches are measured in: rows and leaves of each size, flags, places, normals to join, and a rim."""
    flags = np.empty(ROOM, np.uint8)
    return (
        np.empty((len(SIZES), END), np.float32),
        np.empty((len(SIZES), ROOM), np.int32),
        flags,
        flags.view(np.uint64),
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
def _flagged(flags, words, count, which):  # type: ignore[no-untyped-def]
    """Write which of the first `count` flags are 1 to `which`; return how many.

    words : uint64, the same memory as flags: most eights of leaves have none
    """
    for k in range(count, -(-count // EIGHT) * EIGHT):
        flags[k] = 0
    # Of unsigned numbers the compiler knows that they do not count from an array's end.
    found = np.uint64(0)
    for word in range(-(-count // EIGHT)):
        if words[word] != 0:
            first = np.uint64(word) * np.uint64(EIGHT)
            for k in range(EIGHT):
                which[found] = first + np.uint64(k)
                found += flags[first + np.uint64(k)]
    return np.int64(found)


@nb.njit(**BORROWING)
def _narrow(level, count, box, triangles, room):  # type: ignore[no-untyped-def]
    """Gather what may be under the discs in a box from what has been gathered at a level; return how many leaves."""
    rows, leaves, flags, words, which = room[0][level], room[1][level], room[2], room[3], room[4]
    _flag_in_box(rows, count, box, flags)
    found = _flagged(flags, words, count, which)
    some, some_leaves = room[0][level + 1], room[1][level + 1]
    for k in range(found):
        some_leaves[k] = leaves[which[k]]
    for row in range(0, END if triangles else AX, ROOM):
        for k in range(found):
            some[row + k] = rows[row + which[k]]
    return found


@nb.njit(**BORROWING)
def _is_under(dx, dy, dz, nx, ny, nz, radius2):  # type: ignore[no-untyped-def]
    """Tell in single precision whether a point is under a disc, as `point_is_under` does."""
    distance2, height = dx * dx + dy * dy + dz * dz, dx * nx + dy * ny + dz * nz
    height2 = height * height
    on_rim = (distance2 - height2 <= np.float32(RIM**2) * radius2) & (height2 <= np.float32(FLAT**2) * radius2)
    return (distance2 <= radius2) | on_rim


@nb.njit(**BORROWING, fastmath=NEVER_NAN)
def _flag_under(rows, leaves, count, triangles, open_, disc, begin, end, cap, flags):  # type: ignore[no-untyped-def]
    """Flag the leaves of a patch under a disc by 1, all others by 0; return the largest distance from its plane.

    Its own, [begin, end), are left out; unless `open_`, so are those whose normals are surely in the cap.
    triangles, open_ : bool, literal; disc, cap : centre, radius and normal; axis and cosine; float32
    """
    px, py, pz, radius, nx, ny, nz = disc
    ax, ay, az, cosine = cap
    far_side, wider = np.float32(FAR_SIDE - ROUNDING), np.float32(1.0 + ROUNDING)
    radius2, highest = radius * radius, np.float32(0.0)
    for k in range(count):
        dx, dy, dz = rows[X + k] - px, rows[Y + k] - py, rows[Z + k] - pz
        if triangles:
            under = _is_under(dx, dy, dz, nx, ny, nz, radius2)
            under |= _is_under(rows[AX + k] - px, rows[AY + k] - py, rows[AZ + k] - pz, nx, ny, nz, radius2)
            under |= _is_under(rows[BX + k] - px, rows[BY + k] - py, rows[BZ + k] - pz, nx, ny, nz, radius2)
            under |= _is_under(rows[CX + k] - px, rows[CY + k] - py, rows[CZ + k] - pz, nx, ny, nz, radius2)
        else:
            reach = (radius + rows[EXTENT + k]) * wider
            under = dx * dx + dy * dy + dz * dz <= reach * reach
        x, y, z = rows[NX + k], rows[NY + k], rows[NZ + k]
        under &= (x * nx + y * ny + z * nz >= far_side) & ((leaves[k] < begin) | (leaves[k] >= end))
        highest = larger(highest, abs(dx * nx + dy * ny + dz * nz) if under else np.float32(0.0))
        flags[k] = under & (open_ | (x * ax + y * ay + z * az < cosine))
    return highest


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
    _, _, flags, words, which, vectors, rim, _ = room
    rows, leaves = room[0][level], room[1][level]
    me = nodes[node]
    x, y, z = np.float64(me["axis_x"]), np.float64(me["axis_y"]), np.float64(me["axis_z"])
    norm = math.sqrt(x * x + y * y + z * z)
    cap[0], cap[1], cap[2], cap[3] = x / norm, y / norm, z / norm, me["cone_cos"]
    # Its own leaves are in the cone and the thickness.
    begin, end = me["leaf_begin"], me["leaf_end"]
    disc = (me["x"], me["y"], me["z"], me["radius"], normals[node, 0], normals[node, 1], normals[node, 2])
    # Neither is of unit length to the last bit: what is all but on the cap's rim is measured below.
    near_cap = (np.float32(cap[0]), np.float32(cap[1]), np.float32(cap[2]), np.float32(cap[3] + 1e-6))
    if len(indices) == 0:
        higher = _flag_under(rows, leaves, count, False, True, disc, begin, end, near_cap, flags)
    elif closed:
        higher = _flag_under(rows, leaves, count, True, False, disc, begin, end, near_cap, flags)
    else:
        higher = _flag_under(rows, leaves, count, True, True, disc, begin, end, near_cap, flags)
    radius = np.float64(me["radius"])
    relief = np.float64(thickness[node])
    if higher > relief:
        # Rounding may not lower it.
        relief = higher * (1.0 + ROUNDING) + radius * ROUNDING
    under = _flagged(flags, words, count, which)
    collected = 0
    for k in range(under):
        i = which[k]
        which[k] = leaves[i]
        x, y, z = np.float64(rows[NX + i]), np.float64(rows[NY + i]), np.float64(rows[NZ + i])
        # One over the length, of normals that are unit but for the rounding of float32.
        unit = 1.5 - 0.5 * (x * x + y * y + z * z)
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
        px, py, pz = np.float64(me["x"]), np.float64(me["y"]), np.float64(me["z"])
        nx, ny, nz = np.float64(normals[node, 0]), np.float64(normals[node, 1]), np.float64(normals[node, 2])
        write_rim(px, py, pz, radius, nx, ny, nz, rim)
        overhang = min(_overhang(centres, extents, which, under, rim, near), radius)
        if overhang > near:
            cap[3] = EVERYTHING
            relief = max(relief, overhang)
    return relief


@nb.njit(**BORROWING)
def write_footprint(node, cap, relief):  # type: ignore[no-untyped-def]
    """Write cone and relief of a footprint to its node; cap : axis and cosine, float64 (4,)."""
    cosine = np.float32(widened_cosine(cap[3]))
    node["print_x"], node["print_y"], node["print_z"] = cap[0], cap[1], cap[2]
    node["print_cos"], node["print_sin"] = cosine, sine_of(cosine)
    node["relief"] = relief


@nb.njit(**BORROWING)
def measure_patch(nodes, root, discs, shapes, boxes, closed, count, room, cap):  # type: ignore[no-untyped-def]
    """Measure the footprints of a small subtree, after `gather` has returned `count` for it.

    discs : normals and thicknesses of all discs; boxes : around the discs of each node and all below it
    cap : float64 (4,), to work in
    """
    stack, levels, counts = room[7]
    stack[0], levels[0], counts[0] = root, 0, count
    top = 1
    while top > 0:
        top -= 1
        node, level, count = stack[top], levels[top], counts[top]
        if level + 1 < len(SIZES) and nodes[node]["leaf_end"] - nodes[node]["leaf_begin"] <= SIZES[level + 1]:
            count = _narrow(level, count, boxes[node], len(shapes[1]) > 0, room)
            level += 1
        write_footprint(nodes[node], cap, _footprint(nodes, node, discs, shapes, closed, level, count, room, cap))
        for child in range(nodes[node]["first_child"], nodes[node]["first_child"] + nodes[node]["child_count"]):
            stack[top], levels[top], counts[top] = child, level, count
            top += 1
