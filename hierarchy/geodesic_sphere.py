"""A geodesic sphere: the faces of an icosahedron cut into equal grids, without a vertex twice."""

from __future__ import annotations

import numpy as np

from hierarchy.model import Float64Array, Int32Array


def geodesic_sphere(frequency: int) -> tuple[Float64Array, Int32Array]:
    """Cut every edge of an icosahedron into `frequency` pieces.

    Returns unit positions float64 (10 frequency^2 + 2, 3) and faces int32 (20 frequency^2, 3), counter-clockwise
    seen from outside.
    """
    corners, faces = icosahedron()
    n = frequency
    # Number the vertices: 12 corners, n - 1 on each of the 30 edges (from the lower corner up), then the insides.
    ends = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    edges = np.unique(ends, axis=0)
    edge_of = {(int(a), int(b)): e for e, (a, b) in enumerate(edges)}
    i, j = _grid(n)
    inside = (i > 0) & (j > 0) & (i + j < n)

    positions = np.empty((10 * n * n + 2, 3))
    numbers = np.empty((20, n + 1, n + 1), np.int32)
    for f, (a, b, c) in enumerate(faces):
        # Grid place (i, j) is corner a + i / n (b - a) + j / n (c - a).
        number = numbers[f]
        number[0, 0], number[n, 0], number[0, n] = a, b, c
        step = np.arange(1, n)
        for (u, v), place in (((a, b), (step, 0)), ((a, c), (0, step)), ((b, c), (n - step, step))):
            first = 12 + edge_of[min(u, v), max(u, v)] * (n - 1)
            number[place] = first + (step - 1 if u < v else n - 1 - step)
        count = int(inside.sum())
        number[i[inside], j[inside]] = 12 + 30 * (n - 1) + f * count + np.arange(count)
        weights = np.stack([n - i - j, i, j], axis=1) / n
        positions[number[i, j]] = weights @ corners[[a, b, c]]
    positions /= np.linalg.norm(positions, axis=1, keepdims=True)

    up = i + j < n
    down = i + j < n - 1
    i_up, j_up, i_down, j_down = i[up], j[up], i[down], j[down]
    upward = [numbers[:, i_up, j_up], numbers[:, i_up + 1, j_up], numbers[:, i_up, j_up + 1]]
    downward = [numbers[:, i_down + 1, j_down], numbers[:, i_down + 1, j_down + 1], numbers[:, i_down, j_down + 1]]
    triangles = np.concatenate([np.stack(upward, -1).reshape(-1, 3), np.stack(downward, -1).reshape(-1, 3)])
    return positions, triangles


def icosahedron() -> tuple[Float64Array, Int32Array]:
    """Return the 12 unit corners, float64, and 20 faces, int32, of an icosahedron."""
    golden = (1.0 + 5.0**0.5) / 2.0
    corners = np.array([(0.0, s, t * golden) for s in (-1, 1) for t in (-1, 1)])
    corners = np.concatenate([corners, np.roll(corners, 1, axis=1), np.roll(corners, 2, axis=1)])
    # Edges have length 2 before normalising; a face is three corners that are two and two that far apart.
    near = np.abs(np.linalg.norm(corners[:, None] - corners[None], axis=2) - 2.0) < 1e-9
    faces = []
    for a in range(12):
        for b in range(a + 1, 12):
            for c in range(b + 1, 12):
                if near[a, b] and near[b, c] and near[c, a]:
                    outward = np.linalg.det(corners[[a, b, c]]) > 0.0
                    faces.append((a, b, c) if outward else (a, c, b))
    return corners / np.linalg.norm(corners[0]), np.array(faces, np.int32)


def _grid(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the places (i, j) with i + j <= n of a triangular grid."""
    i, j = np.divmod(np.arange((n + 1) * (n + 1)), n + 1)
    keep = i + j <= n
    return i[keep], j[keep]
