"""The footprint of every disc: what surface there is under all of it, not only the primitives below its node.

A disc is a circle around a patch and overhangs it. Whether it can stick out beyond the silhouette depends on the
surface under the overhang, too: a flat patch beside a crease has a narrow normal cone, yet its disc reaches over the
edge. So a disc is taken for silhouette by the cone of its footprint, and needs refining only if the footprint
leaves the disc's plane by more than the eye can see (`relief`). On Igea this test with half the splats follows the
outline three times as closely as the cone of the node alone.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from hierarchy.cones import bounding_cap, widened_cosine
from hierarchy.leaves import LeafShapes
from hierarchy.model import Float32Array

# Primitives that face the other way by more than 120 degrees are the far side of a thin sheet, not of a crease.
FAR_SIDE = -0.5


@nb.njit(cache=True, nogil=True, inline="always")
def _nearest2(shapes, leaf, x, y, z):  # type: ignore[no-untyped-def]
    """Return the squared distance of a point from the nearest of a leaf's centre and corners (surfel: its rim)."""
    positions, indices, radii, _, centres = shapes
    dx, dy, dz = centres[leaf, 0] - x, centres[leaf, 1] - y, centres[leaf, 2] - z
    best = dx * dx + dy * dy + dz * dz
    if len(indices) == 0:
        return max(math.sqrt(best) - radii[leaf], 0.0) ** 2
    for k in range(3):
        v = indices[leaf, k]
        dx, dy, dz = positions[v, 0] - x, positions[v, 1] - y, positions[v, 2] - z
        best = min(best, dx * dx + dy * dy + dz * dz)
    return best


@nb.njit(cache=True, nogil=True)
def _append(vectors, count, x, y, z):  # type: ignore[no-untyped-def]
    """Append a normalised vector, growing the buffer; return the buffer."""
    if count == len(vectors):
        grown = np.empty((2 * count, 3), np.float64)
        grown[:count] = vectors
        vectors = grown
    norm = math.sqrt(x * x + y * y + z * z)
    vectors[count, 0], vectors[count, 1], vectors[count, 2] = x / norm, y / norm, z / norm
    return vectors


@nb.njit(cache=True, nogil=True)
def _footprint(nodes, node, normal, thickness, shapes, cap):  # type: ignore[no-untyped-def]
    """Write the cone of a disc's footprint to cap, float64 (4,); return its relief."""
    normals, centres = shapes[3], shapes[4]
    me = nodes[node]
    px, py, pz = np.float64(me["x"]), np.float64(me["y"]), np.float64(me["z"])
    radius = np.float64(me["radius"])
    nx, ny, nz = np.float64(normal[0]), np.float64(normal[1]), np.float64(normal[2])
    relief = np.float64(thickness)
    vectors = np.empty((3 * (me["leaf_end"] - me["leaf_begin"]) + 32, 3), np.float64)
    count = 0
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
                x, y, z = np.float64(normals[leaf, 0]), np.float64(normals[leaf, 1]), np.float64(normals[leaf, 2])
                if not me["leaf_begin"] <= leaf < me["leaf_end"]:
                    if x * nx + y * ny + z * nz < FAR_SIDE or _nearest2(shapes, leaf, px, py, pz) > radius * radius:
                        continue
                    dx, dy, dz = centres[leaf, 0] - px, centres[leaf, 1] - py, centres[leaf, 2] - pz
                    relief = max(relief, abs(dx * nx + dy * ny + dz * nz))
                vectors = _append(vectors, count, x, y, z)
                count += 1
            if child < last:
                begin = nodes[child]["leaf_end"]
                stack[top] = child
                top += 1
    bounding_cap(vectors[:count], cap)
    return relief


@nb.njit(cache=True, nogil=True, parallel=True)
def _footprints(nodes, disc_normals, thickness, shapes):  # type: ignore[no-untyped-def]
    count = len(nodes)
    axes = np.empty((count, 3), np.float32)
    cosines = np.empty(count, np.float32)
    reliefs = np.empty(count, np.float32)
    for node in nb.prange(count):
        cap = np.empty(4, np.float64)
        reliefs[node] = _footprint(nodes, node, disc_normals[node], thickness[node], shapes, cap)
        for axis in range(3):
            axes[node, axis] = cap[axis]
        cosines[node] = widened_cosine(cap[3])
    return axes, cosines, reliefs


def disc_footprints(
    nodes: np.ndarray, disc_normals: Float32Array, thickness: Float32Array, shapes: LeafShapes
) -> tuple[Float32Array, Float32Array, Float32Array]:
    """Measure the footprint of every node's disc.

    nodes : NODE (M,), with topology, discs and spheres filled in
    disc_normals : float32 (M, 3), unit
    thickness : float32 (M,), largest distance of the primitives below a node from its disc's plane
    Returns the cones' axes float32 (M, 3) and cosines float32 (M,) as in `normal_cones`, and the reliefs
    float32 (M,): the largest distance of the footprint's primitives from the disc's plane.
    """
    s = shapes
    arrays = (s.positions, s.indices, s.radii, s.normals, s.centres)
    return _footprints(nodes, disc_normals, np.ascontiguousarray(thickness), arrays)  # type: ignore[no-any-return]
