"""The footprint of every disc: what surface there is under all of it, not only the primitives below its node.

A disc is a circle around a patch and overhangs it. Whether it can stick out beyond the silhouette depends on the
surface under the overhang, too: a flat patch beside a crease has a narrow normal cone, yet its disc reaches over the
edge. So a disc is taken for silhouette by the cone of its footprint, and needs refining only if the footprint
leaves the disc's plane by more than the eye can see (`relief`). Where the surface has borders, a disc that overhangs
one has no surface below its rim at all: that distance counts as relief, too, and a border is silhouette from
everywhere. On Igea, at some 12,500 primitives, the outline grows by 0.17 pixels with this test and by 0.42 with the
cone of the node alone.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from hierarchy.cones import EVERYTHING, bounding_cap, widened_cosine
from hierarchy.frames import tangents
from hierarchy.leaves import LeafShapes
from hierarchy.model import Float32Array

# Primitives that face the other way by more than 120 degrees are the far side of a thin sheet, not of a crease.
FAR_SIDE = -0.5
# Points of the rim that are looked at for borders: one each 45 degrees misses a corner of 8% of the radius.
RIM_POINTS = 8
# A rim farther from all surface than this share of the radius overhangs a border.
BORDER = 0.15


@nb.njit(cache=True, nogil=True, inline="always")
def _within(positions, indices, centres, extents, leaf, x, y, z, radius):  # type: ignore[no-untyped-def]
    """Tell whether a leaf's centre or one of its corners (surfel: its rim) is within a radius of a point."""
    dx, dy, dz = np.float64(centres[leaf, 0]) - x, np.float64(centres[leaf, 1]) - y, np.float64(centres[leaf, 2]) - z
    distance2 = dx * dx + dy * dy + dz * dz
    if distance2 <= radius * radius:
        return True
    if distance2 > (radius + extents[leaf]) ** 2:
        return False
    if len(indices) == 0:
        return True
    for k in range(3):
        v = indices[leaf, k]
        dx, dy, dz = positions[v, 0] - x, positions[v, 1] - y, positions[v, 2] - z
        if dx * dx + dy * dy + dz * dz <= radius * radius:
            return True
    return False


@nb.njit(cache=True, nogil=True)
def _grown(vectors):  # type: ignore[no-untyped-def]
    """Return a buffer twice as long that begins with the old one."""
    grown = np.empty((2 * len(vectors), 3), np.float64)
    grown[: len(vectors)] = vectors
    return grown


@nb.njit(cache=True, nogil=True)
def _rim(x, y, z, radius, nx, ny, nz):  # type: ignore[no-untyped-def]
    """Return points on a disc's rim, float64 (RIM_POINTS, 3)."""
    ux, uy, uz, vx, vy, vz = tangents(nx, ny, nz)
    rim = np.empty((RIM_POINTS, 3), np.float64)
    for k in range(RIM_POINTS):
        angle = 2.0 * math.pi / RIM_POINTS * k
        c, s = radius * math.cos(angle), radius * math.sin(angle)
        rim[k, 0], rim[k, 1], rim[k, 2] = x + c * ux + s * vx, y + c * uy + s * vy, z + c * uz + s * vz
    return rim


@nb.njit(cache=True, nogil=True)
def _approach_rim(centres, extents, leaf, rim, gaps):  # type: ignore[no-untyped-def]
    """Shorten the squared distances of the rim's points from the surface by what a leaf's bounding sphere reaches."""
    x, y, z = np.float64(centres[leaf, 0]), np.float64(centres[leaf, 1]), np.float64(centres[leaf, 2])
    extent = np.float64(extents[leaf])
    for k in range(len(rim)):
        distance2 = (rim[k, 0] - x) ** 2 + (rim[k, 1] - y) ** 2 + (rim[k, 2] - z) ** 2
        # The root is taken only where it matters.
        if distance2 < (gaps[k] + extent) ** 2:
            gaps[k] = max(math.sqrt(distance2) - extent, 0.0)


@nb.njit(cache=True, nogil=True)
def _footprint(nodes, node, normal, thickness, shapes, closed, cap):  # type: ignore[no-untyped-def]
    """Write the cone of a disc's footprint to cap, float64 (4,); return its relief."""
    positions, indices, normals, centres, extents = shapes
    me = nodes[node]
    px, py, pz = np.float64(me["x"]), np.float64(me["y"]), np.float64(me["z"])
    radius = np.float64(me["radius"])
    nx, ny, nz = np.float64(normal[0]), np.float64(normal[1]), np.float64(normal[2])
    relief = np.float64(thickness)
    vectors = np.empty((3 * (me["leaf_end"] - me["leaf_begin"]) + 32, 3), np.float64)
    count = 0
    rim = _rim(px, py, pz, radius, nx, ny, nz)
    gaps = np.full(RIM_POINTS, 0.0 if closed else radius)
    # A binary tree over 63-bit codes and 31-bit counts is at most 94 levels deep.
    stack = np.empty(128, np.int32)
    stack[0] = 0
    top = 1
    while top > 0:
        top -= 1
        inner = nodes[stack[top]]
        dx, dy, dz = inner["x"] - px, inner["y"] - py, inner["z"] - pz
        limit = radius + inner["sphere"]
        if dx * dx + dy * dy + dz * dz > limit * limit:
            continue
        last = inner["first_child"] + inner["child_count"]
        begin = inner["leaf_begin"]
        for child in range(inner["first_child"], last + 1):
            end = nodes[child]["leaf_begin"] if child < last else inner["leaf_end"]
            for leaf in range(begin, end):
                mine = me["leaf_begin"] <= leaf < me["leaf_end"]
                if not mine and not _within(positions, indices, centres, extents, leaf, px, py, pz, radius):
                    continue
                x, y, z = np.float64(normals[leaf, 0]), np.float64(normals[leaf, 1]), np.float64(normals[leaf, 2])
                if not mine:
                    if x * nx + y * ny + z * nz < FAR_SIDE:
                        continue
                    dx, dy, dz = centres[leaf, 0] - px, centres[leaf, 1] - py, centres[leaf, 2] - pz
                    relief = max(relief, abs(dx * nx + dy * ny + dz * nz))
                if not closed:
                    _approach_rim(centres, extents, leaf, rim, gaps)
                if count == len(vectors):
                    vectors = _grown(vectors)
                norm = math.sqrt(x * x + y * y + z * z)
                vectors[count, 0], vectors[count, 1], vectors[count, 2] = x / norm, y / norm, z / norm
                count += 1
            if child < last:
                begin = nodes[child]["leaf_end"]
                stack[top] = child
                top += 1
    bounding_cap(vectors[:count], cap)
    overhang = gaps.max()
    if overhang > BORDER * radius:
        cap[3] = EVERYTHING
        relief = max(relief, overhang)
    return relief


@nb.njit(cache=True, nogil=True, parallel=True)
def _footprints(nodes, disc_normals, thickness, shapes, closed):  # type: ignore[no-untyped-def]
    count = len(nodes)
    axes = np.empty((count, 3), np.float32)
    cosines = np.empty(count, np.float32)
    reliefs = np.empty(count, np.float32)
    for node in nb.prange(count):
        cap = np.empty(4, np.float64)
        reliefs[node] = _footprint(nodes, node, disc_normals[node], thickness[node], shapes, closed, cap)
        for axis in range(3):
            axes[node, axis] = cap[axis]
        cosines[node] = widened_cosine(cap[3])
    return axes, cosines, reliefs


def disc_footprints(
    nodes: np.ndarray, disc_normals: Float32Array, thickness: Float32Array, shapes: LeafShapes, *, closed: bool
) -> tuple[Float32Array, Float32Array, Float32Array]:
    """Measure the footprint of every node's disc.

    nodes : NODE (M,), with topology, discs and spheres filled in
    disc_normals : float32 (M, 3), unit
    thickness : float32 (M,), largest distance of the primitives below a node from its disc's plane
    closed : the surface has no borders to look for
    Returns the cones' axes float32 (M, 3) and cosines float32 (M,) as in `normal_cones`, and the reliefs
    float32 (M,): the largest distance of the footprint's primitives from the disc's plane, or of the disc's rim from
    any surface.
    """
    s = shapes
    arrays = (s.positions, s.indices, s.normals, s.centres, s.extents)
    return _footprints(nodes, disc_normals, np.ascontiguousarray(thickness), arrays, closed)  # type: ignore[no-any-return]
