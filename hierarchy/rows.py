"""What a hierarchy is made of once all has been fitted: rows of nodes and splats, and how far the leaves extend."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from hierarchy.boxes import WHOLE_DISC
from hierarchy.cones import sine_of
from hierarchy.hierarchy import NODE, SPLAT
from hierarchy.leaves import Leaves, Surfels
from hierarchy.model import Float32Array, Float64Array
from hierarchy.octree import Octree


@nb.njit(cache=True, nogil=True, parallel=True)
def _write_nodes(nodes, first_child, child_count, begin, end, axes, cosines, centres, sizes):  # type: ignore[no-untyped-def]
    for i in nb.prange(len(nodes)):
        node = nodes[i]
        node["x"], node["y"], node["z"] = centres[i, 0], centres[i, 1], centres[i, 2]
        node["radius"], node["sphere"] = sizes[i, 0], sizes[i, 2]
        node["axis_x"], node["axis_y"], node["axis_z"] = axes[i, 0], axes[i, 1], axes[i, 2]
        node["cone_cos"], node["cone_sin"] = cosines[i], sine_of(cosines[i])
        node["first_child"], node["child_count"] = first_child[i], child_count[i]
        node["leaf_begin"], node["leaf_end"] = begin[i], end[i]


def node_rows(
    octree: Octree, axes: Float32Array, cosines: Float32Array, centres: Float32Array, sizes: Float32Array
) -> np.ndarray:
    """Return NODE (M,), all but the footprints, which are measured on them.

    axes, cosines : normal cones, float32 (M, 3) and (M,), as `normal_cones` returns them
    centres, sizes : discs, float32 (M, 3) each, as `node_discs` returns them
    """
    nodes = np.empty(len(axes), NODE)
    first_child, child_count, begin, end = vars(octree).values()
    _write_nodes(nodes, first_child, child_count, begin, end, axes, cosines, centres, sizes)
    return nodes


@nb.njit(cache=True, nogil=True, parallel=True)
def _write_splats(splats, centres, normals, radii, thickness, boxes):  # type: ignore[no-untyped-def]
    for i in nb.prange(len(splats)):
        splat = splats[i]
        for k in range(3):
            splat["centre"][k], splat["normal"][k] = centres[i, k], normals[i, k]
        splat["radius"], splat["thickness"] = radii[i], thickness[i]
        for k in range(4):
            splat["box"][k] = boxes[i, k]


def splat_rows(
    centres: Float32Array, normals: Float32Array, sizes: Float32Array, boxes: Float32Array, leaves: Leaves
) -> np.ndarray:
    """Return SPLAT (M,), or (M + N,) where the N leaves are surfels.

    centres, normals, sizes, boxes : the discs of M nodes, as `node_discs` returns them
    """
    inner = len(centres)
    splats = np.empty(inner + (len(leaves) if isinstance(leaves, Surfels) else 0), SPLAT)
    _write_splats(splats[:inner], centres, normals, sizes[:, 0], sizes[:, 1], boxes)
    if isinstance(leaves, Surfels):
        # No kernel of its own, which would be loaded when a first cloud is opened, perhaps with little memory left.
        rows = splats[inner:]
        rows["centre"], rows["normal"], rows["radius"] = leaves.positions, leaves.normals, leaves.radii
        rows["thickness"], rows["box"] = 0.0, WHOLE_DISC
    return splats


@nb.njit(cache=True, nogil=True, parallel=True)
def _extents(positions, radii):  # type: ignore[no-untyped-def]
    farthest = x_most = y_most = z_most = widest = 0.0
    for i in nb.prange(len(positions)):
        x, y, z = np.float64(positions[i, 0]), np.float64(positions[i, 1]), np.float64(positions[i, 2])
        radius = np.float64(radii[i]) if len(radii) > 0 else 0.0
        farthest = max(farthest, math.sqrt(x * x + y * y + z * z) + radius)
        x_most, y_most, z_most = max(x_most, abs(x)), max(y_most, abs(y)), max(z_most, abs(z))
        widest = max(widest, radius)
    return farthest, x_most + widest, y_most + widest, z_most + widest


def extents_of(leaves: Leaves) -> tuple[float, Float64Array]:
    """Return the radius of the sphere and the half extents of the box around the origin that hold all leaves."""
    radii = leaves.radii if isinstance(leaves, Surfels) else np.empty(0, np.float32)
    radius, *half_extents = _extents(leaves.positions, radii)
    return radius, np.array(half_extents)
