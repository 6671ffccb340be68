"""The nearest neighbours of every point."""

from __future__ import annotations

import numpy as np

from hierarchy.model import Float32Array, Int32Array, Progress, ignore_progress

# Points asked for at once: between two batches the work can be cancelled.
BATCH = 1 << 17


def nearest_neighbours(
    positions: Float32Array, count: int, progress: Progress = ignore_progress
) -> tuple[Float32Array, Int32Array]:
    """Return the distances, float32 (N, k), and indices, int32 (N, k), of the k nearest other points, nearest first.

    positions : float32 (N, 3), no two the same
    count : how many are wanted; k is smaller where there are not so many others
    progress : called with the stage "normals", from 0 to 0.5
    """
    from scipy.spatial import cKDTree

    k = min(count, len(positions) - 1)
    distances = np.zeros((len(positions), k), np.float32)
    indices = np.zeros((len(positions), k), np.int32)
    if k == 0:
        return distances, indices
    # Squared distances of models far below or above unit size would leave the range that the tree compares well.
    scale = max(float(np.abs(positions).max()), 1e-300)
    points = positions.astype(np.float64) / scale
    # Median splits and tight boxes cost more to build than they save in one pass over all points.
    tree = cKDTree(points, balanced_tree=False, compact_nodes=False)
    for start in range(0, len(points), BATCH):
        progress("normals", 0.5 * start / len(points))
        batch = slice(start, start + BATCH)
        # The point itself comes first, at distance 0.
        found_distances, found = tree.query(points[batch], k=k + 1, workers=-1)
        distances[batch] = found_distances[:, 1:] * scale
        indices[batch] = found[:, 1:]
    return distances, indices
