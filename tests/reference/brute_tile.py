"""Normal tiles of one surfel, texel by texel and without a hierarchy.

Based on Holst and Schumann, "Normal Mapping for Surfel-Based Rendering" (2007), Algorithms 1 and 2 and eq. 12-15, with
the corrections of the project: texels stand at 2x/(w-1) - 1, and only what faces the surfel's side counts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Float64Array = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

Weight = Callable[[Float64Array, Float64Array], Float64Array]
"""Weight of base surfels from the distances (K,) of the hits to their centres and their radii (K,); eq. 14."""


@dataclass(frozen=True, eq=False)
class Disc:
    """The surfel that owns the tile: centre (3,), unit normal (3,), radius, unit tangents o1, o2 (3,)."""

    centre: Float64Array
    normal: Float64Array
    radius: float
    o1: Float64Array
    o2: Float64Array


def gaussian(sigma: float) -> Weight:
    """Return exp(-0.5 (d / (sigma r))^2)."""
    return lambda distance, radius: np.exp(-0.5 * (distance / (sigma * radius)) ** 2)


def texel_positions(disc: Disc, w: int) -> Float64Array:
    """Return the points (w, w, 3) of the texels, [y, x], on the plane of the disc (eq. 12, corrected)."""
    steps = np.array([0.0]) if w == 1 else 2.0 * np.arange(w) / (w - 1) - 1.0
    positions = np.empty((w, w, 3))
    for y in range(w):
        for x in range(w):
            positions[y, x] = disc.centre + disc.radius * (steps[x] * disc.o1 + steps[y] * disc.o2)
    return positions


def tile_of_surfels(
    disc: Disc,
    w: int,
    centres: Float64Array,
    normals: Float64Array,
    radii: Float64Array,
    weight: Weight,
    *,
    shading_normals: Float64Array | None = None,
    reach: float | None = None,
) -> tuple[Float64Array, BoolArray]:
    """Evaluate Algorithm 1: the weighted sum of the normals of the base discs that the line through a texel meets.

    centres, normals, radii : (N, 3), (N, 3) unit, (N,), the base surfels as discs
    shading_normals : (N, 3), what is summed up, where it is not the discs' own normals
    reach : radius of the surfel's bounding sphere, its disc's radius by default
    Returns unit normals (w, w, 3), [y, x], and whether the sum was one that can be normalised (w, w); the surfel's own
    normal stands where it was not.
    """
    reach = disc.radius if reach is None else reach
    shading_normals = normals if shading_normals is None else shading_normals
    candidate = np.linalg.norm(centres - disc.centre, axis=1) < reach + radii
    candidate &= normals @ disc.normal > 0.0
    tile, found = np.empty((w, w, 3)), np.zeros((w, w), np.bool_)
    positions = texel_positions(disc, w)
    for y in range(w):
        for x in range(w):
            total = np.zeros(3)
            for k in np.flatnonzero(candidate):
                along = np.dot(centres[k] - positions[y, x], normals[k]) / np.dot(disc.normal, normals[k])
                hit = positions[y, x] + along * disc.normal
                distance = np.linalg.norm(hit - centres[k])
                if distance < radii[k]:
                    total += weight(np.array([distance]), radii[k : k + 1])[0] * shading_normals[k]
            length = np.linalg.norm(total)
            found[y, x] = length > 0.0
            tile[y, x] = total / length if length > 0.0 else disc.normal
    return tile, found


def tile_of_triangles(
    disc: Disc,
    w: int,
    corners: Float64Array,
    corner_normals: Float64Array,
    *,
    reach: float | None = None,
) -> tuple[Float64Array, BoolArray]:
    """Evaluate Algorithm 2: the barycentric normal of the triangle that the line through a texel hits.

    Of several hits by triangles that face the disc's side the one nearest to the plane of the disc counts.

    corners, corner_normals : (M, 3, 3), [triangle, corner, axis]; corners counter-clockwise seen from outside
    reach : radius of the surfel's bounding sphere, its disc's radius by default
    Returns unit normals (w, w, 3), [y, x], and whether a triangle was hit (w, w); the surfel's own normal stands where
    none was.
    """
    reach = disc.radius if reach is None else reach
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    spheres = [bounding_sphere(triangle) for triangle in corners]
    candidate = [
        k
        for k, (centre, radius) in enumerate(spheres)
        if np.linalg.norm(centre - disc.centre) < reach + radius and np.dot(faces[k], disc.normal) > 0.0
    ]
    tile, found = np.empty((w, w, 3)), np.zeros((w, w), np.bool_)
    positions = texel_positions(disc, w)
    for y in range(w):
        for x in range(w):
            nearest = np.inf
            tile[y, x] = disc.normal
            for k in candidate:
                weights, along = line_triangle(positions[y, x], disc.normal, corners[k])
                if weights.min() >= 0.0 and abs(along) < nearest:
                    normal = weights @ corner_normals[k]
                    length = np.linalg.norm(normal)
                    if length > 0.0:
                        nearest, tile[y, x], found[y, x] = abs(along), normal / length, True
    return tile, found


def line_triangle(point: Float64Array, direction: Float64Array, corners: Float64Array) -> tuple[Float64Array, float]:
    """Return barycentric coordinates (3,) and the parameter t of the point + t direction in a triangle's plane.

    Solves a + v (b - a) + w (c - a) = point + t direction; the line must not be parallel to the triangle (3, 3).
    """
    a, b, c = corners
    v, w, t = np.linalg.solve(np.stack([b - a, c - a, -direction], axis=1), point - a)
    return np.array([1.0 - v - w, v, w]), float(t)


def bounding_sphere(corners: Float64Array) -> tuple[Float64Array, float]:
    """Return centre (3,) and radius of the smallest sphere around a triangle (3, 3).

    Midpoint of the longest edge where the angle across is at least 90 degrees, the circumcentre otherwise.
    """
    for k in range(3):
        a, b, c = corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]
        if np.dot(b - a, c - a) <= 0.0:
            return 0.5 * (b + c), 0.5 * float(np.linalg.norm(b - c))
    a, b, c = corners[0], corners[1] - corners[0], corners[2] - corners[0]
    normal = np.cross(b, c)
    offset = (np.dot(b, b) * np.cross(c, normal) + np.dot(c, c) * np.cross(normal, b)) / (2.0 * np.dot(normal, normal))
    return a + offset, float(np.linalg.norm(offset))
