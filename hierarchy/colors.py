"""The colour of every splat: the area-weighted mean of the base primitives below it."""

from __future__ import annotations

import numpy as np

from hierarchy.leaves import LeafShapes, Leaves, Triangles
from hierarchy.model import UInt8Array
from hierarchy.node_sums import node_sums
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
    largest = float(shapes.areas.max())
    # Where no primitive has an area all count alike.
    weights = np.maximum(shapes.areas, 1e-12 * largest) if largest > 0.0 else np.ones(len(leaves))
    weighted = np.empty((len(weights), 5))
    np.multiply(leaf_colors, weights[:, None], out=weighted[:, :4])
    weighted[:, 4] = weights
    sums = node_sums(weighted, octree)
    inner = np.clip(np.rint(sums[:, :4] / sums[:, 4:]), 0, 255).astype(np.uint8)
    return inner if isinstance(leaves, Triangles) else np.concatenate([inner, leaves.colors])
