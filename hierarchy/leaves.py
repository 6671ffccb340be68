"""The base primitives under a hierarchy, triangles or surfels, in Morton order.

Kernels that fit discs, spheres and cones need only a leaf's corners, its normal, its centre and its area, so both
kinds of leaf go one way through them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba as nb
import numpy as np

from hierarchy.frames import tangents
from hierarchy.model import Float32Array, Float64Array, Int32Array, Mesh, Model, PointCloud, UInt8Array, UInt16Array
from hierarchy.morton import morton_order
from hierarchy.part import AnyArray

# A surfel is bounded by the octagon around its rim: 8% wider than the disc, exact in its plane.
SURFEL_CORNERS = 8
SURFEL_CORNER_SCALE = 1.0 / math.cos(math.pi / SURFEL_CORNERS)


@dataclass(frozen=True, eq=False)
class Triangles:
    """Leaves of a hybrid hierarchy; vertices are in order of first use.

    positions : float32 (V, 3), model space
    normals : float32 (V, 3), unit shading normals
    indices : int32 (N, 3), in Morton order of the triangles' centroids
    colors : uint8 (V, 4) or None
    """

    positions: Float32Array
    normals: Float32Array
    indices: Int32Array
    colors: UInt8Array | None

    def __len__(self) -> int:
        return len(self.indices)


@dataclass(frozen=True, eq=False)
class Surfels:
    """Leaves of a point hierarchy, in Morton order of their centres.

    positions : float32 (N, 3), disc centres, model space
    normals : float32 (N, 3), unit disc normals
    radii : float32 (N,)
    colors : uint8 (N, 4) or None
    """

    positions: Float32Array
    normals: Float32Array
    radii: Float32Array
    colors: UInt8Array | None

    def __len__(self) -> int:
        return len(self.positions)


Leaves = Triangles | Surfels


@dataclass(frozen=True, eq=False)
class LeafShapes:
    """What a fitting kernel reads of its leaves.

    positions : float32 (V, 3), vertices or disc centres
    indices : int32 (N, 3), or (0, 3) where the leaves are surfels
    radii : float32 (N,), or (0,) where the leaves are triangles
    normals : float32 (N, 3), unit geometric normals: those that decide what faces the eye
    centres : float32 (N, 3), centroids
    areas : float64 (N,), weights of the averages; squares of lengths, which float32 may not hold
    extents : float32 (N,), radii of spheres around the centres that hold the primitives
    """

    positions: Float32Array
    indices: Int32Array
    radii: Float32Array
    normals: Float32Array
    centres: Float32Array
    areas: Float64Array
    extents: Float32Array


@nb.njit(cache=True, nogil=True, inline="always")
def corner(positions, indices, radii, normals, leaf, k):  # type: ignore[no-untyped-def]
    """Return corner k of a leaf in float64: 3 corners of a triangle, 8 of a surfel."""
    if len(indices) > 0:
        v = indices[leaf, k]
        return np.float64(positions[v, 0]), np.float64(positions[v, 1]), np.float64(positions[v, 2])
    nx, ny, nz = np.float64(normals[leaf, 0]), np.float64(normals[leaf, 1]), np.float64(normals[leaf, 2])
    ux, uy, uz, vx, vy, vz = tangents(nx, ny, nz)
    angle = (2.0 * math.pi / SURFEL_CORNERS) * k
    r = SURFEL_CORNER_SCALE * radii[leaf]
    c, s = r * math.cos(angle), r * math.sin(angle)
    return (
        positions[leaf, 0] + c * ux + s * vx,
        positions[leaf, 1] + c * uy + s * vy,
        positions[leaf, 2] + c * uz + s * vz,
    )


@nb.njit(cache=True, nogil=True, inline="always")
def _centroid(positions, a, b, c):  # type: ignore[no-untyped-def]
    """Return the centroid of a triangle, computed relative to the first corner: small ones keep their digits."""
    x, y, z = np.float64(positions[a, 0]), np.float64(positions[a, 1]), np.float64(positions[a, 2])
    return (
        x + ((positions[b, 0] - x) + (positions[c, 0] - x)) / 3.0,
        y + ((positions[b, 1] - y) + (positions[c, 1] - y)) / 3.0,
        z + ((positions[b, 2] - z) + (positions[c, 2] - z)) / 3.0,
    )


@nb.njit(cache=True, nogil=True, parallel=True)
def _centroids(positions, faces, centres):  # type: ignore[no-untyped-def]
    for i in nb.prange(len(faces)):
        x, y, z = _centroid(positions, faces[i, 0], faces[i, 1], faces[i, 2])
        centres[i, 0], centres[i, 1], centres[i, 2] = x, y, z


@nb.njit(cache=True, nogil=True, parallel=True)
def _measure_triangles(positions, faces, normals, centres, areas, extents):  # type: ignore[no-untyped-def]
    for i in nb.prange(len(faces)):
        a, b, c = faces[i, 0], faces[i, 1], faces[i, 2]
        px, py, pz = np.float64(positions[a, 0]), np.float64(positions[a, 1]), np.float64(positions[a, 2])
        ux, uy, uz = positions[b, 0] - px, positions[b, 1] - py, positions[b, 2] - pz
        vx, vy, vz = positions[c, 0] - px, positions[c, 1] - py, positions[c, 2] - pz
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        norm = math.sqrt(nx * nx + ny * ny + nz * nz)
        if norm > 0.0:
            normals[i, 0], normals[i, 1], normals[i, 2] = nx / norm, ny / norm, nz / norm
        else:
            normals[i, 0], normals[i, 1], normals[i, 2] = 0.0, 0.0, 1.0
        centres[i, 0], centres[i, 1], centres[i, 2] = _centroid(positions, a, b, c)
        areas[i] = 0.5 * norm
        extent2 = 0.0
        for k in range(3):
            v = faces[i, k]
            x, y, z = positions[v, 0] - centres[i, 0], positions[v, 1] - centres[i, 1], positions[v, 2] - centres[i, 2]
            extent2 = max(extent2, np.float64(x) * x + np.float64(y) * y + np.float64(z) * z)
        # Rounded up: a sphere that holds its triangle but for the last bit would be of no use.
        extents[i] = math.sqrt(extent2) * (1.0 + 1e-6)


def triangle_shapes(positions: Float32Array, faces: Int32Array) -> LeafShapes:
    """Measure triangles: positions float32 (V, 3), faces int32 (N, 3)."""
    count = len(faces)
    shapes = LeafShapes(
        positions=positions,
        indices=faces,
        radii=np.empty(0, np.float32),
        normals=np.empty((count, 3), np.float32),
        centres=np.empty((count, 3), np.float32),
        areas=np.empty(count, np.float64),
        extents=np.empty(count, np.float32),
    )
    _measure_triangles(positions, faces, shapes.normals, shapes.centres, shapes.areas, shapes.extents)
    return shapes


@nb.njit(cache=True, nogil=True)
def _number_by_first_use(indices, new_from_old, old_from_new):  # type: ignore[no-untyped-def]
    """Number the vertices in the order in which triangles first use them; return how many are used.

    indices : int32 (N, 3), changed in place
    new_from_old : int32 (V,), -1 throughout, to work in
    old_from_new : int32 (V,), receives which had the numbers before
    """
    used = 0
    for i in range(len(indices)):
        for k in range(3):
            v = indices[i, k]
            if new_from_old[v] < 0:
                new_from_old[v] = used
                old_from_new[used] = v
                used += 1
            indices[i, k] = new_from_old[v]
    return used


@nb.njit(cache=True, nogil=True, parallel=True)
def _take(words, which, taken):  # type: ignore[no-untyped-def]
    for i in nb.prange(len(which)):
        for k in range(words.shape[1]):
            taken[i, k] = words[which[i], k]


def _rows(array: AnyArray, which: Int32Array) -> AnyArray:
    """Return rows of an array, all of which exist, of whole words of four bytes: so all kinds go one way."""
    taken = np.empty((len(which), *array.shape[1:]), array.dtype)
    if taken.size:
        words = np.ascontiguousarray(array).reshape(len(array), -1).view(np.int32)
        _take(words, which, taken.reshape(len(taken), -1).view(np.int32))
    return taken


def leaf_order(model: Model) -> tuple[Int32Array, UInt16Array]:
    """Return the Morton order of a mesh's triangles or a cloud's surfels, and the steps, as `morton_order` does."""
    if isinstance(model, PointCloud):
        return morton_order(model.positions)
    # Only what they are sorted by is measured before: the rest need not be brought into another order then.
    centroids = np.empty((len(model.faces), 3), np.float32)
    _centroids(model.positions, model.faces, centroids)
    return morton_order(centroids)


def triangles_in_order(mesh: Mesh, order: Int32Array) -> tuple[Triangles, LeafShapes]:
    """Put a mesh's triangles into an order; return them and their shapes."""
    indices = _rows(mesh.faces, order)
    old_from_new = np.empty(len(mesh.positions), np.int32)
    old_from_new = old_from_new[: _number_by_first_use(indices, np.full_like(old_from_new, -1), old_from_new)]
    triangles = Triangles(
        _rows(mesh.positions, old_from_new),
        _rows(mesh.normals, old_from_new),
        indices,
        None if mesh.colors is None else _rows(mesh.colors, old_from_new),
    )
    return triangles, triangle_shapes(triangles.positions, indices)


def surfels_in_order(cloud: PointCloud, order: Int32Array) -> tuple[Surfels, LeafShapes]:
    """Put a cloud's surfels into an order; return them and their shapes."""
    surfels = Surfels(
        _rows(cloud.positions, order),
        _rows(cloud.normals, order),
        _rows(cloud.radii, order),
        None if cloud.colors is None else _rows(cloud.colors, order),
    )
    shapes = LeafShapes(
        positions=surfels.positions,
        indices=np.empty((0, 3), np.int32),
        radii=surfels.radii,
        normals=surfels.normals,
        centres=surfels.positions,
        areas=surfels.radii.astype(np.float64) ** 2,
        extents=surfels.radii,
    )
    return surfels, shapes


def leaves_in_order(model: Model, order: Int32Array) -> tuple[Leaves, LeafShapes]:
    """Put a model's base primitives into an order; return them and their shapes."""
    return surfels_in_order(model, order) if isinstance(model, PointCloud) else triangles_in_order(model, order)
