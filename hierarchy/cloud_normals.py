"""Normals of a point cloud that has none: planes through the neighbours, then one side for all.

Based on: Hoppe, DeRose, Duchamp, McDonald and Stuetzle, Surface Reconstruction from Unorganized Points, 1992: tangent
planes through the neighbours, and a minimum spanning tree over the neighbours, with edges of cost 1 - |n n'|, that
carries one side through the cloud. Departures: the neighbour graph is not enriched to be connected, every component
finds its own outer side; and the tree is never built, sets that know the relative side of their members (union-find
with parity) do instead.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit, prange

from hierarchy.model import Float32Array, Int32Array

# Costs lie in 0..1 and are sorted into so many buckets: finer than the noise of any normal.
COST_BUCKETS = 4096

# Directions in which each component's outermost point is asked which side is out: the 26 neighbours in a cube.
DIRECTIONS = np.array(
    [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) != (0, 0, 0)], np.float64
)
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)


def estimate_normals(positions: Float32Array, neighbours: Int32Array) -> Float32Array:
    """Return the unit normal of the plane that fits each point and its neighbours best, float32 (N, 3).

    positions : float32 (N, 3); neighbours : int32 (N, k)
    The side is arbitrary. Where the points lie on a line any normal across it is taken.
    """
    return np.asarray(_fit_planes(positions, neighbours), np.float32)


def orient_normals(positions: Float32Array, normals: Float32Array, neighbours: Int32Array) -> Float32Array:
    """Turn normals to one side, within each component of the neighbour graph the outer one, float32 (N, 3).

    positions, normals : float32 (N, 3); neighbours : int32 (N, k)
    The outer side of a component is the one on which its outermost points in 26 directions face outwards in the sum.
    """
    if len(normals) == 0:
        return normals
    roots, turned = _join_by_cost(normals, neighbours)
    _, component = np.unique(roots, return_inverse=True)
    oriented = np.where(turned[:, None], -normals, normals)
    inside_out = _inside_out(positions, oriented, component.astype(np.int32), int(component.max()) + 1, DIRECTIONS)
    return np.where(inside_out[component][:, None], -oriented, oriented).astype(np.float32)


@njit(cache=True, nogil=True, parallel=True)
def _fit_planes(positions: Float32Array, neighbours: Int32Array) -> Float32Array:
    normals = np.empty_like(positions)
    count = neighbours.shape[1]
    for i in prange(len(positions)):
        offsets = np.zeros((count + 1, 3))
        largest = 0.0
        for j in range(count):
            for axis in range(3):
                offset = np.float64(positions[neighbours[i, j], axis]) - np.float64(positions[i, axis])
                offsets[j + 1, axis] = offset
                largest = max(largest, abs(offset))
        # Scaled to unit size, so that no model is too small or too large to square.
        scale = 1.0 / largest if largest > 0.0 else 1.0
        mean = np.zeros(3)
        for j in range(count + 1):
            for axis in range(3):
                offsets[j, axis] *= scale
                mean[axis] += offsets[j, axis] / (count + 1)
        covariance = np.zeros((3, 3))
        for j in range(count + 1):
            for a in range(3):
                for b in range(3):
                    covariance[a, b] += (offsets[j, a] - mean[a]) * (offsets[j, b] - mean[b])
        _, vectors = np.linalg.eigh(covariance)
        for axis in range(3):
            # Eigenvalues ascend: the first is the direction in which the points spread least.
            normals[i, axis] = vectors[axis, 0]
    return normals


@njit(cache=True, nogil=True)
def _find(parent: Int32Array, odd: npt.NDArray[np.bool_], i: int) -> tuple[int, bool]:
    """Return the root of i's set and whether i is on the other side than the root; shortens the path."""
    root, side = i, False
    while parent[root] != root:
        side ^= odd[root]
        root = parent[root]
    found = side
    while parent[i] != root and i != root:
        above, step = parent[i], odd[i]
        parent[i], odd[i] = root, side
        side ^= step
        i = above
    return root, found


@njit(cache=True, nogil=True)
def _join_by_cost(normals: Float32Array, neighbours: Int32Array) -> tuple[Int32Array, npt.NDArray[np.bool_]]:
    """Join neighbours, cheapest edges first (Kruskal); return each point's root and whether it has to be turned."""
    n, k = neighbours.shape
    starts = np.zeros(COST_BUCKETS + 1, np.int64)
    buckets = np.empty((n, k), np.int16)
    for i in range(n):
        for j in range(k):
            other = neighbours[i, j]
            dot = 0.0
            for axis in range(3):
                dot += normals[i, axis] * normals[other, axis]
            cost = max(0.0, 1.0 - abs(dot))
            buckets[i, j] = min(int(cost * COST_BUCKETS), COST_BUCKETS - 1)
            starts[buckets[i, j] + 1] += 1
    for bucket in range(COST_BUCKETS):
        starts[bucket + 1] += starts[bucket]
    order = np.empty(n * k, np.int64)
    for i in range(n):
        for j in range(k):
            order[starts[buckets[i, j]]] = i * k + j
            starts[buckets[i, j]] += 1

    parent = np.arange(n).astype(np.int32)
    odd = np.zeros(n, np.bool_)
    for edge in order:
        i, other = edge // k, neighbours[edge // k, edge % k]
        root, side = _find(parent, odd, i)
        other_root, other_side = _find(parent, odd, other)
        if root != other_root:
            dot = 0.0
            for axis in range(3):
                dot += normals[i, axis] * normals[other, axis]
            parent[root] = other_root
            odd[root] = side ^ other_side ^ (dot < 0.0)
    roots = np.empty(n, np.int32)
    turned = np.empty(n, np.bool_)
    for i in range(n):
        roots[i], turned[i] = _find(parent, odd, i)
    return roots, turned


@njit(cache=True, nogil=True)
def _inside_out(
    positions: Float32Array, normals: Float32Array, component: Int32Array, components: int, directions: np.ndarray
) -> npt.NDArray[np.bool_]:
    """Return for each component whether its outermost points face inwards in the sum over `directions`."""
    farthest = np.full((components, len(directions)), -math.inf)
    facing = np.zeros((components, len(directions)))
    for i in range(len(positions)):
        for d in range(len(directions)):
            along, dot = 0.0, 0.0
            for axis in range(3):
                along += positions[i, axis] * directions[d, axis]
                dot += normals[i, axis] * directions[d, axis]
            if along > farthest[component[i], d]:
                farthest[component[i], d] = along
                facing[component[i], d] = dot
    result = np.empty(components, np.bool_)
    for c in range(components):
        total, upward = 0.0, 0.0
        for d in range(len(directions)):
            total += facing[c, d]
            upward += facing[c, d] * (directions[d, 2] + 1e-3 * directions[d, 1] + 1e-6 * directions[d, 0])
        # A flat piece has no outer side; it faces up, or towards +y, or +x.
        result[c] = total < -1e-3 if abs(total) > 1e-3 else upward < 0.0
    return result
