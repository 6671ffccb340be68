"""Small models for the tests: closed, open, flat, degenerate, as meshes and as clouds of surfels."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from hierarchy.geodesic_sphere import geodesic_sphere
from hierarchy.leaves import LeafShapes, Leaves, leaf_order, leaves_in_order
from hierarchy.model import Float64Array, Mesh, Model, PointCloud, UInt8Array, UInt16Array
from hierarchy.vertex_normals import vertex_normals


def sorted_leaves(model: Model) -> tuple[Leaves, LeafShapes, UInt16Array]:
    """Return the leaves that a model's hierarchy has, their shapes and the steps between them."""
    order, steps = leaf_order(model)
    return *leaves_in_order(model, order), steps


def mesh_of(
    positions: npt.ArrayLike,
    faces: npt.ArrayLike,
    *,
    normals: npt.ArrayLike | None = None,
    colors: UInt8Array | None = None,
    closed: bool = False,
) -> Mesh:
    """Return a mesh with the given vertex normals, or with those of its faces."""
    positions, faces = np.asarray(positions, np.float32), np.asarray(faces, np.int32)
    normals = vertex_normals(positions, faces) if normals is None else np.asarray(normals, np.float32)
    return Mesh("model", np.zeros(3), positions, faces, normals, colors, closed)


def cloud_of(
    positions: npt.ArrayLike, normals: npt.ArrayLike, radii: npt.ArrayLike, colors: UInt8Array | None = None
) -> PointCloud:
    """Return a cloud of surfels; normals of any length."""
    unit = np.asarray(normals, np.float64) / np.linalg.norm(normals, axis=-1, keepdims=True)
    count = len(np.asarray(positions))
    radius = np.broadcast_to(np.asarray(radii, np.float32), count).copy()
    return PointCloud("model", np.zeros(3), np.asarray(positions, np.float32), unit.astype(np.float32), radius, colors)


def turned(points: npt.ArrayLike, seed: int = 7) -> Float64Array:
    """Return points (N, 3) turned by a random rotation, so that nothing lies on an axis by chance."""
    q = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    q[0] *= np.linalg.det(q)
    result: Float64Array = np.asarray(points, np.float64) @ q.T
    return result


def icosphere(frequency: int = 4) -> Mesh:
    """Return a unit sphere of 20 frequency^2 triangles."""
    positions, faces = geodesic_sphere(frequency)
    return mesh_of(positions, faces, normals=positions, closed=True)


def bumpy_sphere(frequency: int = 4, height: float = 0.35) -> Mesh:
    """Return a closed mesh of 20 frequency^2 triangles with lobes that hide each other."""
    directions, faces = geodesic_sphere(frequency)
    x, y, z = turned(directions).T
    lobes = np.sin(4.0 * x + 1.0) * np.cos(5.0 * y) + np.sin(6.0 * z) * np.cos(3.0 * x)
    return mesh_of(directions * (1.0 + height * lobes)[:, None], faces, closed=True)


def box(size: npt.ArrayLike = (2.0, 1.0, 0.5)) -> Mesh:
    """Return a closed box around the origin of 12 triangles, with vertices of their own for every side."""
    positions, faces = [], []
    for axis in range(3):
        for side in (-1.0, 1.0):
            u, v = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
            corners = [side * np.eye(3)[axis] + a * u + b * v for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            corners = corners if side > 0.0 else corners[::-1]
            faces += [[len(positions) + k for k in triangle] for triangle in ((0, 1, 2), (0, 2, 3))]
            positions += corners
    return mesh_of(np.array(positions) * 0.5 * np.asarray(size), faces, closed=True)


def grid(n: int, height: npt.ArrayLike = 0.0) -> tuple[Float64Array, npt.NDArray[np.int32]]:
    """Return the positions and 2 n^2 faces of a square grid over [-1, 1]^2 that faces +z, with heights (n+1)^2."""
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, n + 1), np.linspace(-1.0, 1.0, n + 1))
    z = np.broadcast_to(np.asarray(height, np.float64), x.size)
    index = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32)
    return np.stack([x.ravel(), y.ravel(), z], 1), faces


def terrain(n: int = 10, seed: int = 3) -> Mesh:
    """Return an open landscape of 2 n^2 triangles that faces +z."""
    rng = np.random.default_rng(seed)
    x, y = grid(n)[0][:, :2].T
    return mesh_of(*grid(n, 0.3 * np.sin(3.0 * x + 1.0) * np.cos(4.0 * y) + 0.03 * rng.normal(size=x.size)))


def thin_sheet(n: int = 8, gap: float = 0.02) -> Mesh:
    """Return two grids back to back, `gap` apart: seen from +z and from -z, the rims open."""
    positions, faces = grid(n)
    lower = positions - [0.0, 0.0, gap]
    normals = np.repeat([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]], len(positions), axis=0)
    return mesh_of(
        np.concatenate([positions, lower]),
        np.concatenate([faces, faces[:, ::-1] + len(positions)]),
        normals=normals,
    )


def surfel_sphere(count: int = 300, seed: int = 5) -> PointCloud:
    """Return a unit sphere of surfels that cover it, their normals a little off the true ones."""
    rng = np.random.default_rng(seed)
    step = np.arange(count) + 0.5
    z, phi = 1.0 - 2.0 * step / count, step * np.pi * (3.0 - np.sqrt(5.0))
    ring = np.sqrt(1.0 - z * z)
    positions = turned(np.stack([ring * np.cos(phi), ring * np.sin(phi), z], 1))
    spacing = np.sqrt(4.0 * np.pi / count)
    normals = positions + 0.05 * rng.normal(size=positions.shape)
    return cloud_of(positions, normals, rng.uniform(0.9, 1.4, count) * spacing)


def beside_a_far_triangle(mesh: Mesh) -> Mesh:
    """Return a mesh with one triangle far away, so that none of its own is big for it and base surfels split none."""
    first = len(mesh.positions)
    far = [[1e4, 0.0, 0.0], [1e4, 0.01, 0.0], [1e4, 0.0, 0.01]]
    return mesh_of(
        np.concatenate([mesh.positions, far]),
        np.concatenate([mesh.faces, [[first, first + 1, first + 2]]]),
        normals=np.concatenate([mesh.normals, [[1.0, 0.0, 0.0]] * 3]),
        colors=None if mesh.colors is None else np.concatenate([mesh.colors, mesh.colors[:3]]),
        closed=mesh.closed,
    )
