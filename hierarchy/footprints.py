"""The footprint of every disc: what surface there is under all of it, not only the primitives below its node.

A disc is a circle around a patch and overhangs it. Whether it can stick out beyond the silhouette depends on the
surface under the overhang, too: a flat patch beside a crease has a narrow normal cone, yet its disc reaches over the
edge. So a disc is taken for silhouette by the cone of its footprint, and needs refining only if the footprint
leaves the disc's plane by more than the eye can see (`relief`). Where the surface has borders, a disc that overhangs
one has no surface below its rim at all: that distance counts as relief, too, and a border is silhouette from
everywhere. On Igea, at some 12,500 primitives, the outline grows by 0.17 pixels with this test and by 0.42 with the
cone of the node alone.

A disc's neighbours come from its parent's (near_nodes.py), and a subtree is looked into only where it can widen the
cone or raise the relief. Where very many primitives lie under one disc, as in a fan of a million triangles, whole
subtrees are taken for what bounds them. So cone and relief may be larger than they need be. Not smaller, but for one
thing: a subtree that is taken so may come near a rim that only its parts beyond the disc, or facing away, are near to.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from hierarchy.borrowing import BORROWING
from hierarchy.cones import EVERYTHING
from hierarchy.joined_cones import angle_between, cap_holds, join_cone, join_farthest_first
from hierarchy.leaves import LeafShapes
from hierarchy.model import Float32Array
from hierarchy.near_nodes import LONGEST, hand_down, note_hanging_leaves, reaches, write_boxes_of_discs
from hierarchy.patches import DEEPEST, FEW, SIZES, TOO_MANY, gather, measure_patch, patch_room, write_footprint
from hierarchy.under_discs import BORDER, FAR_SIDE, REACH, RIM_POINTS, approach_rim, leaf_is_under, write_rim

# Nodes and leaves that are not the node's own and are looked at for its footprint before subtrees are taken for what
# bounds them. Most nodes take a tenth of that, but discs that are coarse beside their triangles take more: a surface of
# 4 M triangles drawn with 8,300 primitives at 1600 needs 13,300 at 400, and is built no faster.
MOST_VISITS = 1600
# The same of subtrees of so few leaves with so many around that those cannot be gathered (patches.py): where primitives
# lie on one another all subtrees are like that, and what bounds the others is good enough.
MOST_VISITS_CROWDED, CROWDED = 100, 64
# The same of those that are the node's own, of which on an open surface some may be near the disc's rim.
MOST_OWN_VISITS = 1600
# Subtrees whose spheres are this much smaller than the disc are taken for what bounds them, too: that is 0.4% of the
# primitives of that surface, and at 0.25 it is half as many again.
FINE = 0.05
# Leaves that are looked at in one go.
AT_ONCE = 64
# Subtrees that threads work through; what is above them is done first.
SUBTREES = 256


@nb.njit(cache=True, nogil=True, inline="always")
def _faces_away(inner, nx, ny, nz):  # type: ignore[no-untyped-def]
    """Tell whether all normals below a node face the other way than a disc."""
    if inner["cone_cos"] == EVERYTHING:
        return False
    x, y, z = np.float64(inner["axis_x"]), np.float64(inner["axis_y"]), np.float64(inner["axis_z"])
    c, s = angle_between(x, y, z, nx, ny, nz)
    # The nearest angle in the cone is positive and has a cosine below FAR_SIDE.
    nearest = c * inner["cone_cos"] + s * inner["cone_sin"]
    return c < 0.0 and nearest < FAR_SIDE - 1e-6


@nb.njit(cache=True, nogil=True, inline="always")
def _highest(inner, normal, thickness, disc):  # type: ignore[no-untyped-def]
    """Return how far anything below a node can be from a disc's plane: its sphere's, or its own slab's farthest end.

    normal, thickness : of the node's disc
    """
    px, py, pz, nx, ny, nz = disc
    height = abs((inner["x"] - px) * nx + (inner["y"] - py) * ny + (inner["z"] - pz) * nz)
    x, y, z = np.float64(normal[0]), np.float64(normal[1]), np.float64(normal[2])
    _, sine = angle_between(x, y, z, nx, ny, nz)
    # A little more than the normals are off unit length.
    slab = (inner["radius"] * sine + thickness) * (1.0 + 1e-6)
    return height + min(np.float64(inner["sphere"]), slab)


@nb.njit(**BORROWING)
def _can_approach(inner, rim, gaps, near):  # type: ignore[no-untyped-def]
    """Tell whether anything below a node can be nearer to a point of the rim that is not near enough to a surface."""
    for k in range(len(rim)):
        if gaps[k] > near:
            x, y, z = rim[k, 0] - inner["x"], rim[k, 1] - inner["y"], rim[k, 2] - inner["z"]
            limit = gaps[k] + inner["sphere"]
            if x * x + y * y + z * z < limit * limit:
                return True
    return False


@nb.njit(**BORROWING)
def _take_coarsely(inner, highest, rim, gaps, closed, cap):  # type: ignore[no-untyped-def]
    """Add what bounds a subtree to a footprint; return its relief."""
    x, y, z = np.float64(inner["axis_x"]), np.float64(inner["axis_y"]), np.float64(inner["axis_z"])
    join_cone(cap, x, y, z, np.float64(inner["cone_cos"]), np.float64(inner["cone_sin"]))
    for k in range(0 if closed else len(rim)):
        x, y, z = rim[k, 0] - inner["x"], rim[k, 1] - inner["y"], rim[k, 2] - inner["z"]
        # There is surface in the sphere, and none is farther from its centre than its radius.
        gaps[k] = min(gaps[k], math.sqrt(x * x + y * y + z * z) + inner["sphere"])
    return highest


@nb.njit(**BORROWING)
def _look_at_leaves(  # type: ignore[no-untyped-def]
    begin, end, positions, indices, normals, centres, extents, closed, disc, radius, relief, cap, vectors, collected,
    which, rim, gaps,
):  # fmt: skip
    """Add those of the leaves [begin, end) that are under a disc to its footprint.

    disc, radius : centre, normal and radius of the disc; relief, cap : of the footprint so far
    collected : how many rows of the work's vectors are normals beyond the cap
    Returns relief and `collected`.
    """
    px, py, pz, nx, ny, nz = disc
    for some in range(begin, end, AT_ONCE):
        # What is not under the disc, or changes nothing, is passed over without branches: none could be foreseen.
        near = 0
        for leaf in range(some, min(some + AT_ONCE, end)):
            dx, dy, dz = centres[leaf, 0] - px, centres[leaf, 1] - py, centres[leaf, 2] - pz
            reach = REACH * radius + extents[leaf]
            which[near] = leaf
            near += dx * dx + dy * dy + dz * dz <= reach * reach
        found = 0
        for k in range(near):
            leaf = which[k]
            dx, dy, dz = centres[leaf, 0] - px, centres[leaf, 1] - py, centres[leaf, 2] - pz
            x, y, z = np.float64(normals[leaf, 0]), np.float64(normals[leaf, 1]), np.float64(normals[leaf, 2])
            # Not of unit length to the last bit: what is all but on the cap's rim is measured below.
            beyond = cap[0] * x + cap[1] * y + cap[2] * z < cap[3] + 1e-6
            higher = abs(dx * nx + dy * ny + dz * nz) > relief
            which[found] = leaf
            found += (x * nx + y * ny + z * nz >= FAR_SIDE) & (beyond | higher | (not closed))
        for k in range(found):
            leaf = which[k]
            if not leaf_is_under(positions, indices, centres, extents, leaf, disc, radius):
                continue
            dx, dy, dz = centres[leaf, 0] - px, centres[leaf, 1] - py, centres[leaf, 2] - pz
            relief = max(relief, abs(dx * nx + dy * ny + dz * nz))
            x, y, z = np.float64(normals[leaf, 0]), np.float64(normals[leaf, 1]), np.float64(normals[leaf, 2])
            norm = math.sqrt(x * x + y * y + z * z)
            x, y, z = x / norm, y / norm, z / norm
            if cap[0] * x + cap[1] * y + cap[2] * z < cap[3]:
                if collected == len(vectors):
                    join_farthest_first(cap, vectors)
                    collected = 0
                vectors[collected, 0], vectors[collected, 1], vectors[collected, 2] = x, y, z
                collected += 1
            if not closed:
                approach_rim(centres, extents, leaf, rim, gaps)
    return relief, collected


@nb.njit(**BORROWING)
def _footprint(nodes, node, discs, shapes, closed, entries, count, most_visits, work, cap):  # type: ignore[no-untyped-def]
    """Write the cone of a disc's footprint to cap, float64 (4,); return its relief.

    discs : normals and thicknesses of all discs
    entries, count : what is near the disc
    most_visits : MOST_VISITS or MOST_VISITS_CROWDED
    work : arrays to work in, as `_room` returns them
    """
    disc_normals, thickness = discs
    positions, indices, normals, centres, extents = shapes
    stack, vectors, which, rim, gaps = work
    me = nodes[node]
    px, py, pz = np.float64(me["x"]), np.float64(me["y"]), np.float64(me["z"])
    radius = np.float64(me["radius"])
    nx, ny, nz = np.float64(disc_normals[node, 0]), np.float64(disc_normals[node, 1]), np.float64(disc_normals[node, 2])
    disc = (px, py, pz, nx, ny, nz)
    relief = np.float64(thickness[node])
    x, y, z = np.float64(me["axis_x"]), np.float64(me["axis_y"]), np.float64(me["axis_z"])
    norm = math.sqrt(x * x + y * y + z * z)
    cap[0], cap[1], cap[2], cap[3] = x / norm, y / norm, z / norm, me["cone_cos"]
    near = BORDER * radius
    if not closed:
        write_rim(px, py, pz, radius, nx, ny, nz, rim)
        gaps[:] = radius
    visits = own_visits = collected = 0
    for k in range(count):
        stack[k] = entries[k]
    top = count
    if not closed:
        # Its own leaves are in the cone and the thickness, but they may be near the rim.
        stack[top] = node
        top += 1
    while top > 0:
        top -= 1
        entry = stack[top]
        inner = nodes[entry if entry >= 0 else ~entry]
        begin, end = inner["leaf_begin"], inner["leaf_end"]
        own = me["leaf_begin"] <= begin and end <= me["leaf_end"]
        first, last = inner["first_child"], inner["first_child"] + inner["child_count"]
        if entry >= 0:
            visits += not own
            if not own and not reaches(inner, px, py, pz, REACH * radius):
                continue
            approaches = not closed and _can_approach(inner, rim, gaps, near)
            if own and (not approaches or own_visits > MOST_OWN_VISITS):
                continue
            own_visits += own
            coarse = visits > most_visits or (not approaches and inner["sphere"] <= FINE * radius)
            if not own and (coarse or end - begin > FEW):
                if _faces_away(inner, nx, ny, nz):
                    continue
                highest = _highest(inner, disc_normals[entry], thickness[entry], disc)
                if not approaches and highest <= relief:
                    x, y, z = np.float64(inner["axis_x"]), np.float64(inner["axis_y"]), np.float64(inner["axis_z"])
                    norm = math.sqrt(x * x + y * y + z * z)
                    x, y, z = x / norm, y / norm, z / norm
                    if cap_holds(cap, x, y, z, np.float64(inner["cone_cos"]), np.float64(inner["cone_sin"])):
                        continue
                if coarse:
                    relief = max(relief, _take_coarsely(inner, highest, rim, gaps, closed, cap))
                    continue
            elif not own:
                # So few leaves are looked at sooner than what bounds them.
                last = first
        for child in range(first, last + 1):
            end = nodes[child]["leaf_begin"] if child < last else inner["leaf_end"]
            if own:
                own_visits += end - begin
                for leaf in range(begin, end):
                    approach_rim(centres, extents, leaf, rim, gaps)
            else:
                visits += end - begin
                relief, collected = _look_at_leaves(
                    begin, end, positions, indices, normals, centres, extents, closed, disc, radius, relief, cap,
                    vectors, collected, which, rim, gaps,
                )  # fmt: skip
            if child < last:
                begin = nodes[child]["leaf_end"]
                if entry >= 0:
                    stack[top] = child
                    top += 1
    join_farthest_first(cap, vectors[:collected])
    if not closed:
        overhang = 0.0
        for k in range(len(gaps)):
            overhang = max(overhang, gaps[k])
        if overhang > near:
            cap[3] = EVERYTHING
            relief = max(relief, np.float64(overhang))
    return relief


@nb.njit(cache=True, nogil=True)
def _room():  # type: ignore[no-untyped-def]
    """Return what a footprint is measured in: a stack, normals to join, leaves to look at, a rim and its gaps."""
    return (
        np.empty(LONGEST + DEEPEST, np.int32),
        np.empty((MOST_VISITS, 3), np.float64),
        np.empty(AT_ONCE, np.int32),
        np.empty((RIM_POINTS, 3), np.float64),
        np.empty(RIM_POINTS, np.float64),
    )


@nb.njit(cache=True, nogil=True)
def _measure_below(nodes, families, root, near_root, discs, shapes, closed, most):  # type: ignore[no-untyped-def]
    """Measure the footprints of a node and of all below it, down to what has at most `most` leaves, which is left out.

    families : what `hand_down` needs to know of all nodes; near_root : int32, what is near the root's disc
    Returns the nodes that are left out, each with what is near it.
    """
    work, room, cap = _room(), patch_room(), np.empty(4)
    # Lists of the nodes on the stack, one after the other.
    pool = np.empty((DEEPEST, LONGEST), np.int32)
    counts = np.empty(DEEPEST, np.int32)
    stack = np.empty(DEEPEST, np.int32)
    # Leaves that they may have for what is around them to be gathered.
    sizes = np.empty(DEEPEST, np.int32)
    left_out = [(np.int32(0), np.empty(0, np.int32)) for _ in range(0)]
    stack[0], sizes[0] = root, SIZES[0]
    pool[0, : len(near_root)] = near_root
    counts[0] = len(near_root)
    top = 1
    entries = np.empty(LONGEST, np.int32)
    while top > 0:
        top -= 1
        node, count = stack[top], counts[top]
        entries[:count] = pool[top, :count]
        me = nodes[node]
        if me["leaf_end"] - me["leaf_begin"] <= most:
            left_out.append((node, entries[:count].copy()))
            continue
        leaves = me["leaf_end"] - me["leaf_begin"]
        size = sizes[top]
        if leaves <= size:
            gathered = gather(nodes, node, shapes, families[1][node], entries, count, work[0], room)
            if gathered != TOO_MANY:
                measure_patch(nodes, node, discs, shapes, families[1], closed, gathered, room, cap)
                continue
            # Much smaller subtrees may have fewer leaves around.
            size = leaves // 4
        visits = MOST_VISITS_CROWDED if leaves <= CROWDED else MOST_VISITS
        relief = _footprint(nodes, node, discs, shapes, closed, entries, count, visits, work, cap)
        write_footprint(me, cap, relief)
        for child in range(me["first_child"], me["first_child"] + me["child_count"]):
            counts[top] = hand_down(nodes, families, shapes, node, child, entries, count, pool[top])
            stack[top], sizes[top] = child, size
            top += 1
    return left_out


@nb.njit(cache=True, nogil=True, parallel=True)
def _measure(nodes, discs, shapes, closed, families):  # type: ignore[no-untyped-def]
    note_hanging_leaves(nodes, families[0])
    write_boxes_of_discs(nodes, families[1])
    nothing = np.empty(0, np.int32)
    most = nodes[0]["leaf_end"] // SUBTREES
    subtrees = _measure_below(nodes, families, 0, nothing, discs, shapes, closed, most)
    for k in nb.prange(len(subtrees)):
        root, near_root = subtrees[k]
        _measure_below(nodes, families, root, near_root, discs, shapes, closed, 0)


def measure_footprints(
    nodes: np.ndarray, disc_normals: Float32Array, thickness: Float32Array, shapes: LeafShapes, *, closed: bool
) -> None:
    """Measure the footprint of every node's disc and write it to the node: cone and relief.

    nodes : NODE (M,), with topology, normal cones, discs and spheres filled in
    disc_normals : float32 (M, 3), unit
    thickness : float32 (M,), largest distance of the primitives below a node from its disc's plane
    closed : the surface has no borders to look for

    The cone is as in `normal_cones`. The relief is the largest distance of the footprint's primitives from the disc's
    plane, or of the disc's rim from any surface.
    """
    s = shapes
    arrays = (s.positions, s.indices, s.normals, s.centres, s.extents)
    families = np.empty(len(nodes), np.bool_), np.empty((len(nodes), 6), np.float32)
    _measure(nodes, (disc_normals, np.ascontiguousarray(thickness)), arrays, closed, families)
