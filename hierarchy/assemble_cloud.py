"""From the parts of a file to a clean point cloud with normals and radii."""

from __future__ import annotations

import numpy as np

from hierarchy.assemble import join_parts
from hierarchy.clean import clean_points, counted
from hierarchy.cloud_normals import estimate_normals, orient_normals
from hierarchy.mesh_normals import unit_or_bad
from hierarchy.model import Float32Array, Float64Array, Int32Array, PointCloud, Progress, ignore_progress
from hierarchy.neighbours import nearest_neighbours
from hierarchy.part import Part
from hierarchy.spacing import cover_radii

# Neighbours that give a point its plane and its spacing: enough to average the noise of a scan, few enough to follow
# its curvature.
NEIGHBOURS = 16


def assemble_cloud(
    name: str, parts: list[Part], warnings: list[str], progress: Progress = ignore_progress
) -> PointCloud:
    """Clean the points of `parts` and give them normals, where the file has none, and radii.

    Raises UnreadableFile where nothing is left.
    """
    part = join_parts(parts)
    origin, scale, positions, kept = clean_points(part.positions, warnings)
    distances, neighbours = nearest_neighbours(positions, NEIGHBOURS, progress)
    progress("normals", 0.5)
    estimated = part.normals is None
    if part.normals is None:
        normals = estimate_normals(positions, neighbours)
        progress("normals", 0.6)
        normals = orient_normals(positions, normals, neighbours)
    else:
        normals, estimated = _check_normals(positions, part.normals[kept], neighbours, warnings)
    progress("normals", 0.8)
    radii = cover_radii(positions, normals, distances, neighbours)
    progress("normals", 1.0)
    colors = None if part.colors is None else part.colors[kept]
    return PointCloud(name, origin, positions, normals, radii, colors, estimated, tuple(warnings), scale)


def _check_normals(
    positions: Float32Array, normals: Float64Array, neighbours: Int32Array, warnings: list[str]
) -> tuple[Float32Array, bool]:
    """Return the file's normals as unit float32, and whether all had to be estimated after all.

    Those that are no direction are estimated, on the side that the good normals around them face.
    """
    unit, bad = unit_or_bad(normals)
    if not bad.any():
        return unit, False
    estimated = estimate_normals(positions, neighbours)
    if bad.all():
        warnings.append("estimated all normals: the file's have no direction")
        return orient_normals(positions, estimated, neighbours), True
    warnings.append(counted("recomputed", int(bad.sum()), "normal", "without a direction"))
    around = np.where(bad[neighbours][..., None], np.float32(0.0), unit[neighbours]).sum(axis=1)
    away = np.einsum("ij,ij->i", around, estimated) < 0.0
    unit[bad] = np.where(away[:, None], -estimated, estimated)[bad]
    return unit, False
