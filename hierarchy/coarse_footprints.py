"""The footprint of a disc that has too much under it to look at it all: bounded work, and bounds as an answer.

The hierarchy is looked at level by level until MOST_NODES are waiting. What is still waiting then is not looked into:
a subtree adds its whole normal cone, and is as far from the disc's plane as its bounding sphere reaches. So the cone
holds all normals of the footprint and the relief is at least as large as it is: the disc may be refined too early, but
not too late.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from hierarchy.cones import EVERYTHING
from hierarchy.under_discs import BORDER, FAR_SIDE, approach_rim, within

# A disc with surface all over it meets about half of these: a tenth of its radius each.
MOST_NODES = 192
# Radians by which a cone is widened when it is joined with another: far above rounding, far below what matters.
SLACK = 1e-7


@nb.njit(cache=True, nogil=True, inline="always")
def _angle_between(ax, ay, az, bx, by, bz):  # type: ignore[no-untyped-def]
    """Return cosine and sine of the angle between unit vectors, the sine with all its digits."""
    x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return ax * bx + ay * by + az * bz, math.sqrt(x * x + y * y + z * z)


@nb.njit(cache=True, nogil=True)
def join_cone(cap, x, y, z, cosine, sine):  # type: ignore[no-untyped-def]
    """Widen a cap, float64 (4,), axis and cosine of its half-angle, to hold another cone; EVERYTHING from 90 degrees.

    x, y, z : the cone's axis, of any length but 0; cosine, sine : of its half-angle
    """
    if cap[3] == EVERYTHING:
        return
    if cosine == EVERYTHING:
        cap[3] = EVERYTHING
        return
    norm = math.sqrt(x * x + y * y + z * z)
    x, y, z = x / norm, y / norm, z / norm
    c, s = _angle_between(cap[0], cap[1], cap[2], x, y, z)
    # The cosine of the farthest angle in the cone; the same cone again lies inside.
    if c * cosine - s * sine >= cap[3] - 1e-12:
        return
    between, mine = math.atan2(s, c), math.acos(min(cap[3], 1.0))
    other = math.atan2(sine, cosine)
    half = 0.5 * (mine + between + other)
    if other >= between + mine:
        cap[0], cap[1], cap[2] = x, y, z
        half = other
    elif s > 0.0:
        # Turn the axis towards the other.
        turn = half - mine
        a, b = math.sin(between - turn) / s, math.sin(turn) / s
        cap[0], cap[1], cap[2] = a * cap[0] + b * x, a * cap[1] + b * y, a * cap[2] + b * z
    half += SLACK
    cap[3] = math.cos(half) if half < 0.5 * math.pi else EVERYTHING


@nb.njit(cache=True, nogil=True, inline="always")
def _faces_away(inner, nx, ny, nz):  # type: ignore[no-untyped-def]
    """Tell whether all normals below a node face the other way than a disc."""
    if inner["cone_cos"] == EVERYTHING:
        return False
    x, y, z = np.float64(inner["axis_x"]), np.float64(inner["axis_y"]), np.float64(inner["axis_z"])
    c, s = _angle_between(x, y, z, nx, ny, nz)
    # The nearest angle in the cone is positive and has a cosine below FAR_SIDE.
    nearest = c * inner["cone_cos"] + s * inner["cone_sin"]
    return c < 0.0 and nearest < FAR_SIDE - 1e-6


@nb.njit(cache=True, nogil=True)
def _add_leaves(begin, end, me, normal, shapes, rim, gaps, relief, cap):  # type: ignore[no-untyped-def]
    """Add those of some leaves that lie in the footprint; return its relief."""
    positions, indices, normals, centres, extents = shapes
    px, py, pz = np.float64(me["x"]), np.float64(me["y"]), np.float64(me["z"])
    for leaf in range(begin, end):
        if me["leaf_begin"] <= leaf < me["leaf_end"]:
            continue
        x, y, z = np.float64(normals[leaf, 0]), np.float64(normals[leaf, 1]), np.float64(normals[leaf, 2])
        if x * normal[0] + y * normal[1] + z * normal[2] < FAR_SIDE:
            continue
        if within(positions, indices, centres, extents, leaf, px, py, pz, np.float64(me["radius"])):
            dx, dy, dz = centres[leaf, 0] - px, centres[leaf, 1] - py, centres[leaf, 2] - pz
            relief = max(relief, abs(dx * normal[0] + dy * normal[1] + dz * normal[2]))
            join_cone(cap, x, y, z, 1.0, 0.0)
            approach_rim(centres, extents, leaf, rim, gaps)
    return relief


@nb.njit(cache=True, nogil=True)
def coarse_footprint(nodes, node, normal, thickness, shapes, rim, closed, cap):  # type: ignore[no-untyped-def]
    """Write a cone that holds that of a disc's footprint to cap, float64 (4,); return a relief not below its own.

    nodes : NODE (M,), with discs, spheres and normal cones; node : whose disc
    normal, thickness : the disc's; rim : float64 (RIM_POINTS, 3), points on its rim
    shapes : positions, indices, normals, centres and extents of the leaves; closed : the rim needs no look
    """
    _, _, _, centres, extents = shapes
    me = nodes[node]
    px, py, pz = np.float64(me["x"]), np.float64(me["y"]), np.float64(me["z"])
    nx, ny, nz = np.float64(normal[0]), np.float64(normal[1]), np.float64(normal[2])
    radius = np.float64(me["radius"])
    cap[0], cap[1], cap[2], cap[3] = me["axis_x"], me["axis_y"], me["axis_z"], me["cone_cos"]
    cap[:3] /= math.sqrt(cap[0] * cap[0] + cap[1] * cap[1] + cap[2] * cap[2])
    relief = np.float64(thickness)
    # Rims that come near enough to some surface need no more looking at.
    gaps = np.full(len(rim), 0.0 if closed else radius)
    near = BORDER * radius
    if not closed:
        for leaf in range(me["leaf_begin"], me["leaf_end"]):
            approach_rim(centres, extents, leaf, rim, gaps)
            if gaps.max() <= near:
                break
    queue = np.empty(MOST_NODES, np.int32)
    queue[0] = 0
    head, tail = 0, 1
    while head < tail:
        inner = nodes[queue[head]]
        head += 1
        dx, dy, dz = inner["x"] - px, inner["y"] - py, inner["z"] - pz
        sphere = np.float64(inner["sphere"])
        if dx * dx + dy * dy + dz * dz > (radius + sphere) ** 2 or _faces_away(inner, nx, ny, nz):
            continue
        if me["leaf_begin"] <= inner["leaf_begin"] and inner["leaf_end"] <= me["leaf_end"]:
            continue
        first, last = inner["first_child"], inner["first_child"] + inner["child_count"]
        if tail + inner["child_count"] <= MOST_NODES:
            begin = inner["leaf_begin"]
            for child in range(first, last + 1):
                end = nodes[child]["leaf_begin"] if child < last else inner["leaf_end"]
                relief = _add_leaves(begin, end, me, normal, shapes, rim, gaps, relief, cap)
                if child < last:
                    begin = nodes[child]["leaf_end"]
                    queue[tail] = child
                    tail += 1
            continue
        relief = max(relief, abs(dx * nx + dy * ny + dz * nz) + sphere)
        join_cone(
            cap, np.float64(inner["axis_x"]), np.float64(inner["axis_y"]), np.float64(inner["axis_z"]),
            np.float64(inner["cone_cos"]), np.float64(inner["cone_sin"]),
        )  # fmt: skip
        for k in range(len(rim)):
            x, y, z = rim[k, 0] - inner["x"], rim[k, 1] - inner["y"], rim[k, 2] - inner["z"]
            # There is surface in the sphere, and none is farther from its centre than its radius.
            gaps[k] = min(gaps[k], math.sqrt(x * x + y * y + z * z) + sphere)
    overhang = gaps.max()
    if overhang > near:
        cap[3] = EVERYTHING
        relief = max(relief, overhang)
    return relief
