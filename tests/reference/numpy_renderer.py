"""The splatting equations in plain float64 numpy, a primitive and a pass at a time, for small pictures.

Based on Botsch et al., "High-Quality Surface Splatting on Today's GPUs" (2005), the three passes, and Botsch et al.,
"Phong Splatting" (2004), eq. 6, the exact ray-disc intersection. What a renderer may choose is a parameter here: the
kernel, the epsilons, the weight of triangles, what sides are drawn, whether cracks are closed and what coverage means.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hierarchy.view import View

Float64Array = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

Kernel = Callable[[Float64Array], Float64Array]
"""Weight from rho^2, the squared distance to the disc's centre over its squared radius, in 0..1."""

TileNormals = Callable[[int, Float64Array, Float64Array], Float64Array]
"""Model-space normals (K, 3) of disc i at the disc coordinates u, v (K,) along o1 and o2, in -1..1."""


@dataclass(frozen=True, eq=False)
class Discs:
    """Splats in model space.

    centres, normals : (N, 3), normals unit
    radii, epsilons : (N,), epsilons the lengths by which the visibility pass pushes the centres back; the whole disc
        is scaled about the eye, or shifted along parallel view rays, so that it stays plane and covers the same pixels
    o1, o2 : (N, 3), unit tangents, for the tiles' coordinates
    tile_normals : the normal at a point of a disc; None for the discs' own normals
    boxes, angles : (N, 4) and (N,), what is drawn of each disc: low and high ends along u and along v, which are o1 and
        o2 turned by the angle; None: all
    planes : (N, 3), unit normals of the discs that are drawn, where these are others than `normals`
    """

    centres: Float64Array
    normals: Float64Array
    radii: Float64Array
    epsilons: Float64Array
    o1: Float64Array
    o2: Float64Array
    tile_normals: TileNormals | None = None
    boxes: Float64Array | None = None
    angles: Float64Array | None = None
    planes: Float64Array | None = None


@dataclass(frozen=True, eq=False)
class Triangles:
    """Leaf triangles in model space.

    corners, corner_normals : (M, 3, 3), [triangle, corner, axis]
    epsilons : (M,), the shares of their distance from the eye by which the visibility pass pushes back; lengths where
        the view rays are parallel
    weight : of every fragment
    """

    corners: Float64Array
    corner_normals: Float64Array
    epsilons: Float64Array
    weight: float = 1.0


@dataclass(frozen=True, eq=False)
class Picture:
    """What the passes leave; row 0 at the top.

    normal : (H, W, 3), unit, model space; zero where nothing is drawn
    depth : (H, W), weighted mean of the distances along the view axis; inf where nothing is drawn
    coverage : (H, W) in 0..1
    weight : (H, W), sum of the weights
    visibility : (H, W), the pushed-back depth of the first pass; inf where nothing was
    margin : (H, W), the least |depth - visibility| of any fragment: where it is tiny, rounding decides whether that
        fragment counts, and pictures may differ
    """

    normal: Float64Array
    depth: Float64Array
    coverage: Float64Array
    weight: Float64Array
    visibility: Float64Array
    margin: Float64Array


@dataclass(frozen=True, eq=False)
class Fragments:
    """One primitive's fragments: which pixels (H, W), and for these depth, pushed depth, weight (K,), normal (K, 3).

    Where only the pushed-back primitive lies beyond the near plane the weight is 0.
    """

    mask: BoolArray
    depth: Float64Array
    pushed: Float64Array
    weight: Float64Array
    normal: Float64Array


def drawn_or_not(weight: Float64Array) -> Float64Array:
    """Return 1 wherever anything was drawn."""
    return (weight > 0.0).astype(np.float64)


def render(
    view: View,
    discs: Discs | None,
    triangles: Triangles | None,
    kernel: Kernel,
    *,
    cull_back_faces: bool = False,
    close_cracks: bool = False,
    offset: tuple[float, float] = (0.0, 0.0),
    coverage: Callable[[Float64Array], Float64Array] = drawn_or_not,
    facing_away: float = 1.0,
) -> Picture:
    """Draw discs and triangles by the three passes.

    cull_back_faces : leave out discs and triangles whose front is not turned to the eye
    close_cracks : fill uncovered pixels that lie between covered ones (`cracks`)
    offset : where in a pixel, right and down from its centre, it is sampled
    coverage : from the sum of weights (H, W)
    facing_away : the share of their weight that primitives keep which face away from the eye
    """
    shape = (view.height, view.width)
    rays = pixel_rays(view, offset)
    fragments: list[Fragments] = []
    if discs is not None:
        fragments += _disc_fragments(view, rays, discs, kernel, 0.0 if cull_back_faces else facing_away)
    if triangles is not None:
        fragments += _triangle_fragments(view, rays, triangles, 0.0 if cull_back_faces else facing_away)

    # Pass 1, visibility: the nearest pushed-back depth.
    visibility = np.full(shape, np.inf)
    for part in fragments:
        visibility[part.mask] = np.minimum(visibility[part.mask], part.pushed)

    # Pass 2, attributes: the weighted sums of what is not behind it.
    normal, depth, weight = np.zeros((*shape, 3)), np.zeros(shape), np.zeros(shape)
    margin = np.full(shape, np.inf)
    for part in fragments:
        passed = np.where(part.depth <= visibility[part.mask], part.weight, 0.0)
        normal[part.mask] += passed[:, None] * part.normal
        depth[part.mask] += passed * part.depth
        weight[part.mask] += passed
        margin[part.mask] = np.minimum(margin[part.mask], np.abs(part.depth - visibility[part.mask]))

    # Pass 3, resolve: close cracks, divide and normalise.
    if close_cracks:
        crack, around = cracks(np.concatenate([normal, depth[..., None], weight[..., None]], axis=-1))
        normal[crack], depth[crack], weight[crack] = around[crack, :3], around[crack, 3], around[crack, 4]
    drawn = weight > 0.0
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0.0)
    depth = np.divide(depth, weight, out=np.full(shape, np.inf), where=drawn)
    return Picture(normal, depth, coverage(weight), weight, visibility, margin)


def cracks(sums: Float64Array) -> tuple[BoolArray, Float64Array]:
    """Find the pixels that lie in a crack, bool (H, W), and what surrounds them.

    sums : (H, W, C), the last of them the sum of weights; the second result is of the same shape
    An uncovered pixel with a covered one beside, above or below it is in a crack where both sides are covered within
    two pixels on all four axes, or on three of them and five of its eight neighbours are covered. It takes the sum of
    the first covered pixels on all eight sides.
    """
    height, width, _ = sums.shape
    padded = np.pad(sums, ((2, 2), (2, 2), (0, 0)))
    around = np.zeros_like(sums)
    closed, next_to, next_straight = (np.zeros((height, width), np.intp) for _ in range(3))
    for down, right in ((0, 1), (1, 0), (1, 1), (-1, 1)):
        sides = np.zeros((height, width), np.intp)
        for side in (-1, 1):
            first, second = (
                padded[2 + k * down : 2 + k * down + height, 2 + k * right : 2 + k * right + width]
                for k in (side, 2 * side)
            )
            beside = np.where(first[..., -1:] > 0.0, first, second)
            around += beside
            sides += beside[..., -1] > 0.0
            next_to += first[..., -1] > 0.0
            next_straight += (first[..., -1] > 0.0) & (down * right == 0)
        closed += sides == 2
    enclosed = (closed == 4) | ((closed == 3) & (next_to >= 5))
    return (sums[..., -1] <= 0.0) & (next_straight > 0) & enclosed, around


@dataclass(frozen=True, eq=False)
class Rays:
    """View rays in eye space: where they start and their directions, z = -1, (H, W, 3) each."""

    starts: Float64Array
    directions: Float64Array

    @property
    def moments(self) -> Float64Array:
        """Directions x starts, (H, W, 3): with the directions the rays' Pluecker coordinates."""
        return np.cross(self.directions, self.starts)


def pixel_rays(view: View, offset: tuple[float, float] = (0.0, 0.0)) -> Rays:
    """Return the rays through the pixels: from the eye, or parallel ones from the plane through it.

    offset : right and down from the pixels' centres, in pixels
    """
    x = (np.arange(view.width) + 0.5 + offset[0] - 0.5 * view.width) / view.focal_pixels
    y = (0.5 * view.height - np.arange(view.height) - 0.5 - offset[1]) / view.focal_pixels
    grid_y, grid_x = np.meshgrid(y, x, indexing="ij")
    across = np.stack([grid_x, grid_y, np.zeros_like(grid_x)], axis=-1)
    ahead = np.broadcast_to(np.array([0.0, 0.0, -1.0]), across.shape)
    return Rays(across, ahead) if view.is_parallel else Rays(np.zeros_like(across), across + ahead)


def bilinear_tile(tile: Float64Array, u: Float64Array, v: Float64Array) -> Float64Array:
    """Look a tile (w, w, C), [y, x], up at disc coordinates u, v (K,) in -1..1 (Holst 2007, eq. 11): (K, C)."""
    w = len(tile)
    x, y = (np.clip(0.5 * (w - 1) * (t + 1.0), 0.0, w - 1.0) for t in (u, v))
    x0, y0 = (np.minimum(t.astype(np.intp), max(w - 2, 0)) for t in (x, y))
    x1, y1 = (np.minimum(t + 1, w - 1) for t in (x0, y0))
    fx, fy = (x - x0)[:, None], (y - y0)[:, None]
    top = (1.0 - fx) * tile[y0, x0] + fx * tile[y0, x1]
    bottom = (1.0 - fx) * tile[y1, x0] + fx * tile[y1, x1]
    mixed: Float64Array = (1.0 - fy) * top + fy * bottom
    return mixed


def _disc_fragments(view: View, every: Rays, discs: Discs, kernel: Kernel, facing_away: float) -> Iterator[Fragments]:
    """Yield the fragments of each disc: where the ray meets its plane within its radius (Phong Splatting eq. 6)."""
    rotation, translation = view.eye_from_model[:3, :3], view.eye_from_model[:3, 3]
    for i, radius in enumerate(discs.radii):
        centre, normal = rotation @ discs.centres[i] + translation, rotation @ discs.normals[i]
        away = (-normal[2] if view.is_parallel else np.dot(centre, normal)) > 0.0
        if away and facing_away == 0.0:
            continue
        plane = normal if discs.planes is None else rotation @ discs.planes[i]
        corners = centre + radius * (np.indices((2, 2, 2)).reshape(3, 8).T * 2.0 - 1.0)
        window = bounding_window(view, corners)
        rays = Rays(every.starts[window], every.directions[window])
        slope = rays.directions @ plane
        parameter = np.divide((centre - rays.starts) @ plane, slope, out=np.zeros_like(slope), where=slope != 0.0)
        points = rays.starts + rays.directions * parameter[..., None]
        rho2 = ((points - centre) ** 2).sum(axis=-1) / radius**2
        epsilon = float(discs.epsilons[i])
        share = epsilon / max(float(np.linalg.norm(centre)), epsilon, np.finfo(np.float64).tiny)
        pushed = parameter + epsilon if view.is_parallel else (1.0 + share) * parameter
        inside = (rho2 <= 1.0) & (pushed >= view.near) & (parameter <= view.far)
        if discs.boxes is not None and discs.angles is not None:
            at = (points - centre) @ rotation / radius
            x, y, c, s = at @ discs.o1[i], at @ discs.o2[i], np.cos(discs.angles[i]), np.sin(discs.angles[i])
            u, v, (left, right, low, high) = c * x + s * y, c * y - s * x, discs.boxes[i]
            inside &= (u >= left) & (u <= right) & (v >= low) & (v <= high)
        if not inside.any():
            continue
        hit = points[inside]
        offset = (hit - centre) @ rotation / radius
        if discs.tile_normals is None:
            normals = np.broadcast_to(discs.normals[i], hit.shape)
        else:
            normals = discs.tile_normals(i, offset @ discs.o1[i], offset @ discs.o2[i])
        depth = parameter[inside]
        weight = np.where(depth >= view.near, (facing_away if away else 1.0) * kernel(rho2[inside]), 0.0)
        yield Fragments(_whole(view, window, inside), depth, pushed[inside], weight, normals)


def _triangle_fragments(view: View, every: Rays, triangles: Triangles, facing_away: float) -> Iterator[Fragments]:
    """Yield the fragments of each triangle: where the ray's barycentric coordinates are not negative."""
    rotation, translation = view.eye_from_model[:3, :3], view.eye_from_model[:3, 3]
    moments_of_all = every.moments
    for corners, normals, epsilon in zip(triangles.corners, triangles.corner_normals, triangles.epsilons, strict=True):
        a, b, c = corners @ rotation.T + translation
        face = np.cross(b - a, c - a)
        # Below 0 where the front is turned to the eye.
        height = -face[2] if view.is_parallel else np.dot(a, face)
        if height == 0.0 or (facing_away == 0.0 and height > 0.0):
            continue
        window = bounding_window(view, np.stack([a, b, c]))
        rays, moments = Rays(every.starts[window], every.directions[window]), moments_of_all[window]
        # On which side of the ray each edge lies, and how far, is a barycentric coordinate up to a common factor.
        edges = ((b, c), (c, a), (a, b))
        sides = [rays.directions @ np.cross(p, q) - moments @ (q - p) for p, q in edges]
        coordinates = np.stack(sides, axis=-1) / height
        total = coordinates.sum(axis=-1)
        inside = (coordinates >= 0.0).all(axis=-1) & (total > 0.0)
        coordinates = np.divide(coordinates, total[..., None], out=np.zeros_like(coordinates), where=inside[..., None])
        parameter = -(coordinates @ np.stack([a, b, c])[:, 2])
        pushed = parameter + float(epsilon) if view.is_parallel else (1.0 + float(epsilon)) * parameter
        inside &= (pushed >= view.near) & (parameter <= view.far)
        if not inside.any():
            continue
        depth = parameter[inside]
        shading = coordinates[inside] @ normals
        length = np.linalg.norm(shading, axis=1, keepdims=True)
        shading = np.divide(shading, length, out=np.zeros_like(shading), where=length > 0.0)
        share = facing_away if height > 0.0 else 1.0
        weight = np.where(depth >= view.near, share * triangles.weight, 0.0)
        yield Fragments(_whole(view, window, inside), depth, pushed[inside], weight, shading)


Window = tuple[slice, slice]


def bounding_window(view: View, points: Float64Array) -> Window:
    """Return rows and columns that hold the convex hull of points, eye space (K, 3), with two pixels to spare."""
    depths = -points[:, 2]
    if not view.is_parallel and depths.min() <= 1e-9 * np.abs(points).max():
        return slice(0, view.height), slice(0, view.width)
    size = np.array([view.width, view.height])
    pixels = 0.5 * size + points[:, :2] * np.array([1.0, -1.0]) * view.pixels_of_unit(depths)[:, None]
    low, high = np.clip([pixels.min(axis=0) - 2.0, pixels.max(axis=0) + 2.0], 0, size).astype(int)
    return slice(low[1], max(high[1], low[1])), slice(low[0], max(high[0], low[0]))


def _whole(view: View, window: Window, inside: BoolArray) -> BoolArray:
    mask = np.zeros((view.height, view.width), np.bool_)
    mask[window] = inside
    return mask
