"""From a model to its hierarchy: sort the leaves, shape the octree, fit cones and discs."""

from __future__ import annotations

import numpy as np

from hierarchy.boxes import WHOLE_DISC
from hierarchy.colors import splat_colors
from hierarchy.cones import EVERYTHING, normal_cones
from hierarchy.discs import node_discs
from hierarchy.footprints import disc_footprints
from hierarchy.hierarchy import NODE, SPLAT, Hierarchy
from hierarchy.leaves import LeafShapes, Leaves, Surfels, sort_surfels, sort_triangles
from hierarchy.model import Float32Array, Float64Array, Mesh, Model, Progress, ignore_progress
from hierarchy.octree import MIN_LEAVES, Octree, build_octree
from hierarchy.openings import Openings, find_openings
from hierarchy.spreads import normal_spreads


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
    leaves: Leaves
    if isinstance(model, Mesh) and not points:
        leaves, shapes, steps = sort_triangles(model)
    else:
        if isinstance(model, Mesh):
            from hierarchy.surfels import surfels_of_mesh

            cloud = surfels_of_mesh(model)
        else:
            cloud = model
        leaves, shapes, steps = sort_surfels(cloud)
    progress("Building the octree", 0.2)
    closed = isinstance(model, Mesh) and model.closed
    octree = build_octree(steps, min_leaves)
    nodes = _nodes(octree)
    progress("Fitting normal cones", 0.25)
    axes, cosines = normal_cones(shapes.normals, octree.leaf_begin, octree.leaf_end)
    _set_cone(nodes, "axis", "cone", axes, cosines)
    progress("Fitting discs", 0.4)
    centres, normals, sizes, boxes = node_discs(shapes, octree, axes)
    for axis, name in enumerate("xyz"):
        nodes[name] = centres[:, axis]
    nodes["radius"], nodes["sphere"] = sizes[:, 0], sizes[:, 2]
    progress("Measuring footprints", 0.6)
    axes, cosines, nodes["relief"] = disc_footprints(nodes, normals, sizes[:, 1], shapes, closed=closed)
    _set_cone(nodes, "print", "print", axes, cosines)
    progress("Looking for openings", 0.9)
    openings = _openings(model, leaves, shapes)
    progress("Assembling", 0.95)
    radius, half_extents = _extents(leaves)
    return Hierarchy(
        name=model.name,
        origin=model.origin,
        nodes=nodes,
        splats=_splats(centres, normals, sizes, boxes, leaves),
        spreads=normal_spreads(octree, leaves, shapes),
        colors=splat_colors(octree, shapes, leaves),
        leaves=leaves,
        closed=closed,
        radius=radius,
        half_extents=half_extents,
        warnings=model.warnings,
        openings=openings,
        scale=model.scale,
    )


def _openings(model: Model, leaves: Leaves, shapes: LeafShapes) -> Openings | None:
    """Find where the backs of a mesh that is not closed can be seen; nothing is known of a point cloud's."""
    if not isinstance(model, Mesh) or model.closed:
        return None
    if isinstance(leaves, Surfels):
        return find_openings(model.positions, model.faces, shapes.centres, shapes.normals, leaves_are_faces=False)
    return find_openings(leaves.positions, leaves.indices, shapes.centres, shapes.normals, leaves_are_faces=True)


def _extents(leaves: Leaves) -> tuple[float, Float64Array]:
    """Return the radius of the sphere and the half extents of the box around the origin that hold all leaves."""
    distances = np.sqrt(np.einsum("ij,ij->i", leaves.positions, leaves.positions, dtype=np.float64))
    half_extents = np.abs(leaves.positions).max(axis=0).astype(np.float64)
    if isinstance(leaves, Surfels):
        return float((distances + leaves.radii).max()), half_extents + float(leaves.radii.max())
    return float(distances.max()), half_extents


def _nodes(octree: Octree) -> np.ndarray:
    nodes = np.zeros(len(octree.first_child), NODE)
    for name in ("first_child", "child_count", "leaf_begin", "leaf_end"):
        nodes[name] = getattr(octree, name)
    return nodes


def _set_cone(nodes: np.ndarray, axis: str, angle: str, axes: Float32Array, cosines: Float32Array) -> None:
    for column, name in enumerate("xyz"):
        nodes[f"{axis}_{name}"] = axes[:, column]
    nodes[f"{angle}_cos"] = cosines
    sines = np.sqrt(np.maximum(1.0 - cosines.astype(np.float64) ** 2, 0.0))
    nodes[f"{angle}_sin"] = np.where(cosines == EVERYTHING, 0.0, sines)


def _splats(
    centres: Float32Array, normals: Float32Array, sizes: Float32Array, boxes: Float32Array, leaves: Leaves
) -> np.ndarray:
    inner = len(centres)
    splats = np.zeros(inner + (len(leaves) if isinstance(leaves, Surfels) else 0), SPLAT)
    splats["centre"][:inner], splats["normal"][:inner] = centres, normals
    splats["radius"][:inner], splats["thickness"][:inner] = sizes[:, 0], sizes[:, 1]
    splats["box"][:inner] = boxes
    if isinstance(leaves, Surfels):
        splats["centre"][inner:], splats["normal"][inner:] = leaves.positions, leaves.normals
        splats["radius"][inner:] = leaves.radii
        splats["box"][inner:] = WHOLE_DISC
    return splats
