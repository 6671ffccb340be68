"""The traversal that chooses the level of detail: its decisions node by node, compiled.

Based on: Holst and Schumann 2007, Algorithm 3; lod.py says where it departs from that.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from hierarchy.borrowing import BORROWING
from hierarchy.cones import EVERYTHING
from hierarchy.facing import BACK, FRONT, SILHOUETTE, classify_cone, classify_cone_printed, faces_away
from hierarchy.prefetch import prefetch
from hierarchy.visible_openings import beside_caps

# A silhouette surfel is fine enough where its footprint stays within this share of r_sil of its plane: then it sticks
# out by a fraction of r_sil only, however wide it is. At r_sil 2 and r_inner 16 the mean of four views of Igea takes
# 9,080, 7,970 and 6,910 primitives at 0.65, 0.8 and 1, and its outline is displaced by 0.24, 0.27 and 0.29 pixels.
RELIEF_OF_R_SIL = 0.75
# A footprint whose normals spread further than 30 degrees from their axis is a crease or a spike, for which no disc
# can stand: it is drawn as finely as the silhouette. Igea: 740 primitives more, mean error 0.43 instead of 0.50
# degrees; fandisk: its edges stay straight, mean error 0.14 instead of 0.36.
BENT_COSINE = math.cos(math.radians(30.0))
# By how much relief may displace what a splat shows, in pixels or as a share of r_sil, whichever is more: seen at an
# angle t, what lies a height h off the disc's plane is drawn h sin t away from its place, and planes that differ by h
# part by as much, which opens cracks. Where it is more, r_sil is the limit. At r_sil 2 and r_inner 24 Igea's mean
# error over four views is 0.47 instead of 0.59 degrees with 8,100 instead of 7,200 primitives, and no hole is left; at
# 1 pixel the primitives double. At r_sil 6 the bunny takes 7,500 primitives at 2 pixels and 4,800 at 3, and the IoU of
# its mask is 0.997 and 0.995.
PARALLAX, PARALLAX_OF_R_SIL = 2.0, 0.5
# Radius in pixels up to which a node may be drawn whose normals face all ways, on a surface that shows one side only:
# the two sides of a thin wall, of which its disc has one and may well have the hidden one.
BOTH_SIDES = 1.0
# In place of `Ends`.
FULL = -1, 0, 0, 0, 0, 0
# In place of planes that a sphere may reach behind.
NOT_SEEN = -1


@nb.njit(cache=True, nogil=True, inline="always")
def _crossed(planes, which, x, y, z, radius):  # type: ignore[no-untyped-def]
    """Return which of the planes a sphere, centre relative to the eye, may reach behind; NOT_SEEN: all is behind one.

    which : the planes to look at, a bit each; what is below a node that is before a plane is before it, too
    """
    for p in range(len(planes)):
        if which & (1 << p):
            distance = planes[p, 0] * x + planes[p, 1] * y + planes[p, 2] * z + planes[p, 3]
            if distance < -radius:
                return NOT_SEEN
            if distance >= radius:
                which &= ~(1 << p)
    return which


@nb.njit(cache=True, nogil=True, inline="always")
def _classify(node, x, y, z, facing, distance2, sphere, view):  # type: ignore[no-untyped-def]
    """Return on which side a node faces the eye by its own cone, and by its footprint's.

    x, y, z : from the eye to the node; where the view rays are parallel their direction, and the sphere has no size
    facing : dot product of the node's own cone's axis with x, y, z
    """
    _, axis, _, _, _, printed, sin_view, cos_view = view
    cone_sin, cone_cos = np.float64(node["cone_sin"]), np.float64(node["cone_cos"])
    if printed:
        along = node["axis_x"] * axis[0] + node["axis_y"] * axis[1] + node["axis_z"] * axis[2]
        side = classify_cone_printed(along, cone_sin, cone_cos, sin_view, cos_view)
        return side, side
    side = classify_cone(facing, distance2, sphere, cone_sin, cone_cos)
    facing = node["print_x"] * x + node["print_y"] * y + node["print_z"] * z
    print_sin, print_cos = np.float64(node["print_sin"]), np.float64(node["print_cos"])
    return side, classify_cone(facing, distance2, sphere, print_sin, print_cos)


@nb.njit(cache=True, nogil=True, inline="always")
def _largest_radius(node, pixels, facing, distance2, silhouette, limits, printed, one_sided):  # type: ignore[no-untyped-def]
    """Return the radius in pixels up to which a node's splat may be drawn.

    pixels : of a unit length at the node
    facing, distance2 : as in `classify_cone`
    limits : r_sil and r_inner
    """
    r_sil, r_inner = limits
    if printed:
        return r_sil if silhouette else r_inner
    bent = node["print_cos"] < BENT_COSINE
    relief = node["relief"] * pixels
    shows = (silhouette or bent) and relief > RELIEF_OF_R_SIL * r_sil
    parallax = max(PARALLAX, PARALLAX_OF_R_SIL * r_sil)
    displaces = relief * relief * (distance2 - facing * facing) > parallax * parallax * distance2
    limit = r_sil if shows or displaces else r_inner
    if one_sided and node["cone_cos"] == EVERYTHING:
        limit = min(limit, BOTH_SIDES)
    return limit


@nb.njit(**BORROWING)
def traverse(nodes, positions, indices, planes, eye4, view, limits, cull_back, openings, enough, arrays, tail):  # type: ignore[no-untyped-def]
    """Traverse breadth-first; what lies on the silhouette fills its array from the front, the rest from the back.

    Returns `Ends` of the arrays; FULL where one of them is (room.py).

    enough : end as soon as so many nodes wait, to be the start of others
    arrays : splats, drawn and queue of a room
    tail : how many nodes wait in the queue to begin with
    eye4 : the eye, homogeneous
    cull_back : leave out what faces away, but for bare leaves and what lies where the fronts of caps are seen
    openings : how many bare leaves come before each, and what `beside_caps` needs
    """
    splats, drawn, queue = arrays
    eye, axis, near, focal, parallel, printed, _, _ = view
    bare_before, caps, screen = openings
    any_bare, any_cap = len(bare_before) > 0, len(caps) > 0
    triangles = len(indices) > 0
    count = len(nodes)
    sil_splats, inner_splats = 0, len(splats)
    sil_triangles, inner_triangles = 0, len(drawn)
    head = 0
    while head < tail < head + enough:
        index, planes_left = queue[head]
        head += 1
        node = nodes[index]
        x, y, z = node["x"] - eye[0], node["y"] - eye[1], node["z"] - eye[2]
        sphere = np.float64(node["sphere"])
        if planes_left:
            planes_left = _crossed(planes, planes_left, x, y, z, sphere)
            if planes_left == NOT_SEEN:
                continue
        depth = x * axis[0] + y * axis[1] + z * axis[2]
        # The line of sight, how much it turns within the sphere, and by what lengths on screen are divided.
        sight_x, sight_y, sight_z, turns, divisor = x, y, z, sphere, depth
        if parallel:
            sight_x, sight_y, sight_z, turns, divisor = axis[0], axis[1], axis[2], np.float64(0.0), np.float64(1.0)
        distance2 = sight_x * sight_x + sight_y * sight_y + sight_z * sight_z
        facing = node["axis_x"] * sight_x + node["axis_y"] * sight_y + node["axis_z"] * sight_z
        side, print_side = _classify(node, sight_x, sight_y, sight_z, facing, distance2, turns, view)
        hides_backs = cull_back and (
            side == FRONT or not any_cap or beside_caps(caps, screen, x, y, z, divisor, sphere, turns)
        )
        one_sided = hides_backs and not (any_bare and bare_before[node["leaf_begin"]] < bare_before[node["leaf_end"]])
        if side == BACK and one_sided:
            continue
        silhouette = print_side == SILHOUETTE
        # Draw the node's splat where it is small enough; a node that reaches the near plane or the eye never is.
        if depth - sphere > near and distance2 > turns * turns:
            pixels = focal / divisor
            limit = _largest_radius(node, pixels, facing, distance2, silhouette, limits, printed, one_sided)
            if node["radius"] * pixels <= limit:
                if sil_splats == inner_splats:
                    return FULL
                if silhouette:
                    splats[sil_splats] = index
                    sil_splats += 1
                else:
                    inner_splats -= 1
                    splats[inner_splats] = index
                continue
        # Refine: queue the children, draw the leaves that hang on the node itself, between its children.
        first, last = node["first_child"], node["first_child"] + node["child_count"]
        if tail + last - first > len(queue):
            return FULL
        begin = node["leaf_begin"]
        for child in range(first, last + 1):
            end, behind = node["leaf_end"], node["leaf_end"]
            if child < last:
                end, behind = nodes[child]["leaf_begin"], nodes[child]["leaf_end"]
                # By the time that the child is looked at its own children have come from memory.
                prefetch(nodes, nodes[child]["first_child"])
                queue[tail, 0], queue[tail, 1] = child, planes_left
                tail += 1
            for leaf in range(begin, end):
                if triangles:
                    a, b, c = indices[leaf, 0], indices[leaf, 1], indices[leaf, 2]
                    bare = any_bare and bare_before[leaf] < bare_before[leaf + 1]
                    # None of a node that faces the eye does not.
                    if hides_backs and side != FRONT and not bare and faces_away(positions, a, b, c, eye4):
                        continue
                    if sil_triangles == inner_triangles:
                        return FULL
                    if silhouette:
                        slot = sil_triangles
                        sil_triangles += 1
                    else:
                        inner_triangles -= 1
                        slot = inner_triangles
                    drawn[slot, 0], drawn[slot, 1], drawn[slot, 2] = a, b, c
                    continue
                if sil_splats == inner_splats:
                    return FULL
                if silhouette:
                    splats[sil_splats] = count + leaf
                    sil_splats += 1
                else:
                    inner_splats -= 1
                    splats[inner_splats] = count + leaf
            begin = behind
    return head, tail, sil_splats, inner_splats, sil_triangles, inner_triangles
