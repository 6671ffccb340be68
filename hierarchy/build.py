"""From a model to its hierarchy: sort the leaves, shape the octree, fit cones and discs."""

from __future__ import annotations

import numpy as np

from hierarchy.colors import splat_colors
from hierarchy.cones import normal_cones
from hierarchy.discs import node_discs
from hierarchy.footprints import measure_footprints
from hierarchy.hierarchy import Hierarchy
from hierarchy.leaves import LeafShapes, Leaves, Surfels, leaf_order, leaves_in_order
from hierarchy.model import Mesh, Model, Progress, ignore_progress
from hierarchy.octree import MIN_LEAVES, build_octree
from hierarchy.openings import Openings, find_openings
from hierarchy.planes import SUMS
from hierarchy.rows import extents_of, node_rows, splat_rows
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
    base = model
    if isinstance(model, Mesh) and points:
        from hierarchy.surfels import surfels_of_mesh

        base = surfels_of_mesh(model)
    order, steps = leaf_order(base)
    progress("Building the octree", 0.15)
    closed = isinstance(model, Mesh) and model.closed
    octree = build_octree(steps, min_leaves)
    leaves, shapes = leaves_in_order(base, order)
    del order, steps
    progress("Fitting normal cones", 0.25)
    axes, cosines = normal_cones(shapes.normals, octree.leaf_begin, octree.leaf_end)
    progress("Fitting discs", 0.4)
    # What is made anew has to be cleared by the system before: so sums have one place, and that is the nodes' next. The
    # system hands out again at once what it has just got back; with other memory builds took a tenth longer.
    sums = np.empty((len(axes), SUMS))
    centres, normals, sizes, boxes = node_discs(shapes, octree, axes, sums)
    spreads = normal_spreads(octree, leaves, shapes, sums)
    del sums
    nodes = node_rows(octree, axes, cosines, centres, sizes)
    del axes, cosines
    progress("Measuring footprints", 0.6)
    measure_footprints(nodes, normals, sizes[:, 1], shapes, closed=closed)
    progress("Looking for openings", 0.9)
    openings = _openings(model, leaves, shapes)
    progress("Assembling", 0.95)
    radius, half_extents = extents_of(leaves)
    colors = splat_colors(octree, shapes, leaves)
    del shapes
    splats = splat_rows(centres, normals, sizes, boxes, leaves)
    return Hierarchy(
        name=model.name,
        origin=model.origin,
        nodes=nodes,
        splats=splats,
        spreads=spreads,
        colors=colors,
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
