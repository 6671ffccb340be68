"""Which leaves a view shows: one ray a sample against every one of them.

A leaf is visible when some ray meets its inside before anything else, between the clip planes. Hits at rims and edges
hide what is behind them but are not counted as visible: there, rounding decides which neighbour has them.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from hierarchy.view import View

Float64Array = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

# How far inside, in barycentric coordinates or of the radius, a hit must be to be counted.
EDGE = 1e-9
# Hits as near as this to the first, relative to it, are first as well.
TIE = 1e-9


def ray_directions(view: View, samples: int = 1) -> Float64Array:
    """Return model-space directions (H * samples * W * samples, 3), row by row, with length 1 along the view axis."""
    x = (np.arange(view.width * samples) + 0.5) / samples - 0.5 * view.width
    y = 0.5 * view.height - (np.arange(view.height * samples) + 0.5) / samples
    grid_y, grid_x = np.meshgrid(y, x, indexing="ij")
    across = 0.0 if view.is_parallel else 1.0 / view.focal_pixels
    eye = np.stack([across * grid_x, across * grid_y, np.full_like(grid_x, -1.0)], axis=-1)
    return eye.reshape(-1, 3) @ view.eye_from_model[:3, :3]


def ray_starts(view: View, samples: int = 1) -> Float64Array:
    """Return the model-space points (1 or H * samples * W * samples, 3) that the rays of `ray_directions` start at."""
    if not view.is_parallel:
        return view.eye[None]
    directions = ray_directions(dataclasses.replace(view, parallel_scale=None), samples) @ view.eye_from_model[:3, :3].T
    slope = view.height / (2.0 * np.tan(0.5 * view.view_angle))
    return view.eye + (directions * [1.0, 1.0, 0.0] * slope / view.focal_pixels) @ view.eye_from_model[:3, :3]


def visible_triangles(corners: npt.ArrayLike, view: View, samples: int = 1) -> BoolArray:
    """Return for triangles (M, 3, 3), [triangle, corner, axis], whether a ray meets either side first: bool (M,)."""
    corners = np.asarray(corners, np.float64)
    directions, starts = ray_directions(view, samples), ray_starts(view, samples)
    depth = np.full((len(directions), len(corners)), np.inf)
    inside = np.zeros(depth.shape, np.bool_)
    for k, triangle in enumerate(corners):
        depth[:, k], inside[:, k] = _ray_triangle(starts, directions, triangle)
    return _first(depth, inside, view)


def visible_discs(
    centres: npt.ArrayLike, normals: npt.ArrayLike, radii: npt.ArrayLike, view: View, samples: int = 1
) -> BoolArray:
    """Return for discs (N, 3), (N, 3), (N,) whether a ray meets either side of them first: bool (N,)."""
    centres, normals, radii = (np.asarray(array, np.float64) for array in (centres, normals, radii))
    directions, starts = ray_directions(view, samples), ray_starts(view, samples)
    slope = directions @ normals.T
    heights = (centres * normals).sum(axis=1) - starts @ normals.T
    depth = np.divide(heights, slope, out=np.zeros_like(slope), where=slope != 0.0)
    hit = starts[:, None] + depth[..., None] * directions[:, None]
    distance = np.linalg.norm(hit - centres, axis=-1) / radii
    met = (slope != 0.0) & (distance <= 1.0 + EDGE)
    return _first(np.where(met, depth, np.inf), met & (distance < 1.0 - EDGE), view)


def _ray_triangle(
    starts: Float64Array, directions: Float64Array, triangle: Float64Array
) -> tuple[Float64Array, BoolArray]:
    """Return the ray parameters (R,), inf where missed, and whether the hits are inside (Moeller and Trumbore 1997)."""
    edge1, edge2 = triangle[1] - triangle[0], triangle[2] - triangle[0]
    p = np.cross(directions, edge2)
    determinant = p @ edge1
    s = starts - triangle[0]
    q = np.cross(s, edge1)
    crossing = determinant != 0.0
    over = np.divide(1.0, determinant, out=np.zeros_like(determinant), where=crossing)
    u, v, t = (p * s).sum(axis=1) * over, (directions * q).sum(axis=1) * over, (q @ edge2) * over
    smallest = np.minimum(np.minimum(u, v), 1.0 - u - v)
    met = crossing & (smallest >= -EDGE)
    return np.where(met, t, np.inf), met & (smallest > EDGE)


def _first(depth: Float64Array, inside: BoolArray, view: View) -> BoolArray:
    """Return which columns of depth (R, K) are the first in some row, between the clip planes and met inside."""
    clipped = np.where((depth >= view.near) & (depth <= view.far), depth, np.inf)
    nearest = clipped.min(axis=1, initial=np.inf)[:, None]
    first: BoolArray = ((clipped <= nearest * (1.0 + TIE)) & np.isfinite(clipped) & inside).any(axis=0)
    return first
