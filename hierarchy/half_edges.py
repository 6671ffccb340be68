"""Which faces share an edge: numbered edges, twin half-edges, and whether a mesh is closed.

Half-edge 3 t + i runs from corner i of face t to corner (i + 1) % 3.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from hierarchy.model import Int32Array


def number_edges(faces: Int32Array, vertices: int) -> tuple[Int32Array, int]:
    """Number the undirected edges.

    faces : int32 (T, 3), indices in 0 .. vertices - 1, none repeated within a face
    Returns the edge of each half-edge, int32 (T, 3), and how many edges there are.
    """
    edges, count = _number_edges(np.ascontiguousarray(faces), vertices)
    return edges, int(count)


def twin_half_edges(faces: Int32Array, edges: Int32Array, edge_count: int) -> Int32Array:
    """Return for each half-edge the one that runs along the same edge in the opposite direction, int32 (T, 3).

    -1 where an edge has one face, more than two, or two that run along it in the same direction.
    """
    return np.asarray(_twins(np.ascontiguousarray(faces), edges, edge_count), np.int32)


def is_closed(faces: Int32Array, vertices: int) -> bool:
    """Tell whether every edge is shared by exactly two faces that run along it in opposite directions."""
    if len(faces) == 0:
        return False
    edges, count = number_edges(faces, vertices)
    return bool((twin_half_edges(faces, edges, count) >= 0).all())


@njit(cache=True, nogil=True, parallel=True)
def _number_edges(faces: Int32Array, vertices: int) -> tuple[Int32Array, int]:
    # Sort half-edges into buckets by their lower vertex.
    starts = np.zeros(vertices + 1, np.int64)
    for t in range(len(faces)):
        for i in range(3):
            starts[min(faces[t, i], faces[t, (i + 1) % 3]) + 1] += 1
    for v in range(vertices):
        starts[v + 1] += starts[v]
    cursor = starts[:-1].copy()
    upper = np.empty(3 * len(faces), np.int32)
    half = np.empty(3 * len(faces), np.int32)
    for t in range(len(faces)):
        for i in range(3):
            a, b = faces[t, i], faces[t, (i + 1) % 3]
            place = cursor[min(a, b)]
            cursor[min(a, b)] += 1
            upper[place] = max(a, b)
            half[place] = 3 * t + i

    # Sort each bucket by the upper vertex; runs of equal ones are edges.
    runs = np.zeros(vertices + 1, np.int64)
    for v in prange(vertices):
        lo, hi = starts[v], starts[v + 1]
        if hi - lo > 48:
            # numba's quicksort is quadratic in the bucket of a fan's middle.
            order = np.argsort(upper[lo:hi], kind="mergesort")
            upper[lo:hi] = upper[lo:hi][order]
            half[lo:hi] = half[lo:hi][order]
        else:
            for j in range(lo + 1, hi):
                u, h = upper[j], half[j]
                k = j
                while k > lo and upper[k - 1] > u:
                    upper[k], half[k] = upper[k - 1], half[k - 1]
                    k -= 1
                upper[k], half[k] = u, h
        count = 0
        for j in range(lo, hi):
            if j == lo or upper[j] != upper[j - 1]:
                count += 1
        runs[v + 1] = count
    for v in range(vertices):
        runs[v + 1] += runs[v]

    edges = np.empty(3 * len(faces), np.int32)
    for v in prange(vertices):
        edge = runs[v] - 1
        for j in range(starts[v], starts[v + 1]):
            if j == starts[v] or upper[j] != upper[j - 1]:
                edge += 1
            edges[half[j]] = edge
    return edges.reshape(len(faces), 3), runs[vertices]


@njit(cache=True, nogil=True)
def _twins(faces: Int32Array, edges: Int32Array, edge_count: int) -> Int32Array:
    # The first half-edge seen on each edge; -1: none yet, -2: the edge cannot have twins.
    first = np.full(edge_count, -1, np.int32)
    twins = np.full(edges.size, -1, np.int32)
    for h in range(edges.size):
        edge = edges[h // 3, h % 3]
        other = first[edge]
        if other == -1:
            first[edge] = h
        elif other >= 0:
            opposite = faces[h // 3, h % 3] == faces[other // 3, (other + 1) % 3]
            if twins[other] < 0 and opposite:
                twins[h], twins[other] = other, h
            else:
                if twins[other] >= 0:
                    twins[twins[other]] = -1
                twins[other] = -1
                first[edge] = -2
    return twins.reshape(edges.shape)
