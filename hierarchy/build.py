"""From a model to its hierarchy: sort the leaves, shape the octree, fit cones and discs."""

from __future__ import annotations

import numpy as np

from hierarchy.cones import EVERYTHING, normal_cones
from hierarchy.discs import node_discs
from hierarchy.hierarchy import NODE, SPLAT, Hierarchy
from hierarchy.leaves import LeafShapes, Surfels, sort_surfels, sort_triangles
from hierarchy.model import Float32Array, Mesh, Model, Progress, ignore_progress
from hierarchy.octree import MIN_LEAVES, Octree, build_octree


def build_hierarchy(
    model: Model,
    *,
    points: bool = False,
    min_leaves: int = MIN_LEAVES,
    progress: Progress = ignore_progress,
) -> Hierarchy:
    """Build the surfel hierarchy of a model.

    points : a point hierarchy for a mesh: its leaves are surfels instead of triangles
    min_leaves : cells with fewer leaves get no node of their own
    progress : called from this thread; an exception that it raises ends the build
    """
    progress("Sorting", 0.0)
    if isinstance(model, Mesh) and not points:
        leaves, shapes, codes = sort_triangles(model)
    else:
        if isinstance(model, Mesh):
            from hierarchy.surfels import surfels_of_mesh

            cloud = surfels_of_mesh(model)
        else:
            cloud = model
        leaves, shapes, codes = sort_surfels(cloud)
    progress("Building the octree", 0.2)
    octree = build_octree(codes, min_leaves)
    progress("Fitting normal cones", 0.3)
    axes, cosines = normal_cones(shapes.normals, octree.leaf_begin, octree.leaf_end)
    progress("Fitting discs", 0.5)
    centres, normals, sizes = node_discs(shapes, octree.leaf_begin, octree.leaf_end, axes)
    progress("Assembling", 0.9)
    splats = _splats(centres, normals, sizes, leaves if isinstance(leaves, Surfels) else None)
    return Hierarchy(
        name=model.name,
        origin=model.origin,
        nodes=_nodes(octree, axes, cosines, centres, sizes),
        splats=splats,
        colors=None,
        leaves=leaves,
        closed=isinstance(model, Mesh) and model.closed,
        warnings=model.warnings,
    )


def _nodes(
    octree: Octree, axes: Float32Array, cosines: Float32Array, centres: Float32Array, sizes: Float32Array
) -> np.ndarray:
    nodes = np.empty(len(centres), NODE)
    for axis, name in enumerate("xyz"):
        nodes[name] = centres[:, axis]
        nodes[f"axis_{name}"] = axes[:, axis]
    nodes["cone_cos"] = cosines
    nodes["cone_sin"] = np.where(cosines == EVERYTHING, 0.0, np.sqrt(np.maximum(1.0 - cosines.astype(np.float64) ** 2, 0.0)))
    nodes["radius"], nodes["thickness"], nodes["sphere"] = sizes.T
    for name in ("first_child", "child_count", "leaf_begin", "leaf_end"):
        nodes[name] = getattr(octree, name)
    nodes["tile"] = np.arange(len(nodes))
    return nodes


def _splats(centres: Float32Array, normals: Float32Array, sizes: Float32Array, leaves: Surfels | None) -> np.ndarray:
    inner = len(centres)
    splats = np.zeros(inner + (0 if leaves is None else len(leaves)), SPLAT)
    splats["centre"][:inner], splats["normal"][:inner] = centres, normals
    splats["radius"][:inner], splats["thickness"][:inner] = sizes[:, 0], sizes[:, 1]
    if leaves is not None:
        splats["centre"][inner:], splats["normal"][inner:] = leaves.positions, leaves.normals
        splats["radius"][inner:] = leaves.radii
    return splats
