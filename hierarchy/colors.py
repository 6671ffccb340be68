"""The colour of every splat: the area-weighted mean of the base primitives below it."""

from __future__ import annotations

import numpy as np

from hierarchy.leaves import LeafShapes, Leaves, Triangles
from hierarchy.model import UInt8Array
from hierarchy.octree import Octree


def splat_colors(octree: Octree, shapes: LeafShapes, leaves: Leaves) -> UInt8Array | None:
    """Return the colours of all nodes and, in a point hierarchy, of the leaf surfels behind them.

    Returns uint8 (M, 4) or (M + N, 4), or None where the model has no colours.
    """
    if leaves.colors is None:
        return None
    if isinstance(leaves, Triangles):
        leaf_colors = leaves.colors[leaves.indices].mean(axis=1, dtype=np.float32)
    else:
        leaf_colors = leaves.colors.astype(np.float32)
    # Sums over contiguous ranges are differences of one running sum; float64 holds 2^53 grey levels exactly enough.
    largest = float(shapes.areas.max())
    # Where no primitive has an area all count alike.
    weights = np.maximum(shapes.areas.astype(np.float64), 1e-12 * largest) if largest > 0.0 else np.ones(len(leaves))
    running = np.zeros((len(leaf_colors) + 1, 5))
    np.cumsum(leaf_colors * weights[:, None], axis=0, out=running[1:, :4])
    np.cumsum(weights, out=running[1:, 4])
    sums = running[octree.leaf_end] - running[octree.leaf_begin]
    inner = np.clip(np.rint(sums[:, :4] / sums[:, 4:]), 0, 255).astype(np.uint8)
    return inner if isinstance(leaves, Triangles) else np.concatenate([inner, leaves.colors])
