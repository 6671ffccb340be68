"""The normals of a mesh: those of its file where they are good, else made from its faces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hierarchy.clean import counted
from hierarchy.creases import smooth_groups
from hierarchy.model import BoolArray, Float32Array, Float64Array, Int32Array
from hierarchy.part import AnyArray
from hierarchy.sides import most_area_disagrees
from hierarchy.unique_rows import unique_rows
from hierarchy.vertex_normals import corner_group_normals, vertex_normals

# A file's normal shorter than this fraction of a unit is no direction. Exporters that write unit normals with three
# decimals stay far above it.
SHORTEST_NORMAL = 1e-6
# Components below this fraction of the largest are zero: float32 could hardly hold them.
NEGLIGIBLE = 1e-30


@dataclass(eq=False)
class Surface:
    """Triangles whose vertices know which of them are at one place.

    positions : float32 (V, 3); faces : int32 (T, 3)
    points : float32 (P, 3), the distinct positions
    point_of_vertex : int32 (V,)
    """

    positions: Float32Array
    faces: Int32Array
    points: Float32Array
    point_of_vertex: Int32Array

    @property
    def point_faces(self) -> Int32Array:
        """The faces in terms of points, int32 (T, 3)."""
        return self.point_of_vertex[self.faces]

    def turn(self) -> None:
        """Let every face run the other way round."""
        self.faces = np.ascontiguousarray(self.faces[:, ::-1])


def make_normals(
    surface: Surface, attributes: Sequence[AnyArray]
) -> tuple[Float32Array, Int32Array, Float32Array, list[AnyArray]]:
    """Make normals where the file has none; a crease gets one vertex per side.

    attributes : arrays (V, ...) that tell vertices at one place apart
    Returns positions, faces, normals and attributes of the new vertices.
    """
    point_faces = surface.point_faces
    groups = smooth_groups(surface.points, point_faces)
    if groups is not None:
        normals = corner_group_normals(surface.points, point_faces, *groups)[groups[0].ravel()]
        corners = np.arange(point_faces.size, dtype=np.int32).reshape(-1, 3)
        at_corners = [values[surface.faces.ravel()] for values in attributes]
        return weld_equal(surface.points[point_faces.ravel()], corners, normals, at_corners)
    normals = vertex_normals(surface.points, point_faces)
    if not attributes:
        return surface.points, point_faces, normals, []
    return weld_equal(surface.positions, surface.faces, normals[surface.point_of_vertex], attributes)


def check_normals(surface: Surface, normals: Float64Array, closed: bool, warnings: list[str]) -> Float32Array:
    """Return the file's normals (V, 3) as unit float32, with those that are no direction made anew and counted.

    Where most of the area disagrees with its normals about the outer side, one of them is wrong: the normals where
    the surface is closed, because then the volume tells; else the faces, which are turned in `surface`.
    """
    unit, bad = unit_or_bad(normals)
    if most_area_disagrees(surface.positions, surface.faces, unit, bad):
        if closed:
            warnings.append("turned all normals round: they pointed into the closed surface")
            unit = -unit
        else:
            warnings.append("turned all faces round: their normals pointed to the other side")
            surface.turn()
    if bad.any():
        warnings.append(counted("recomputed", int(bad.sum()), "normal", "without a direction"))
        made = vertex_normals(surface.points, surface.point_faces)
        unit[bad] = made[surface.point_of_vertex[bad]]
    return unit


def unit_or_bad(normals: Float64Array) -> tuple[Float32Array, BoolArray]:
    """Return normals (V, 3) as unit float32, and which of them, (V,), are no direction: not finite, or zero."""
    largest = np.abs(normals).max(axis=1)
    bad: BoolArray = ~(np.isfinite(largest) & (largest > SHORTEST_NORMAL))
    safe, largest = np.where(bad[:, None], 1.0, normals), np.where(bad, 1.0, largest)[:, None]
    # Divided by the largest component first, so that the square of none overflows; what would underflow is none.
    safe = np.where(np.abs(safe) < NEGLIGIBLE * largest, 0.0, safe) / largest
    return (safe / np.linalg.norm(safe, axis=1, keepdims=True)).astype(np.float32), bad


def weld_equal(
    positions: Float32Array, faces: Int32Array, normals: Float32Array, attributes: Sequence[AnyArray]
) -> tuple[Float32Array, Int32Array, Float32Array, list[AnyArray]]:
    """Make one of vertices (V, ...) that agree in everything; returns positions, faces, normals and attributes."""
    columns = [np.ascontiguousarray(values).reshape(len(values), -1) for values in (positions, normals, *attributes)]
    inverse, first = unique_rows(np.concatenate([values.view(np.uint32) for values in columns], axis=1))
    if len(first) == len(positions):
        return positions, faces, normals, list(attributes)
    return positions[first], inverse[faces], normals[first], [values[first] for values in attributes]
