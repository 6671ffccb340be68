"""The picture that a model should give: its triangles cast with rays, several to a pixel.

The yardstick of the benchmarks and of the tests of the whole renderer. It needs embreex, which the viewer does not.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from hierarchy.model import Float32Array, Float64Array, Mesh
from hierarchy.view import View

# Rays in flight at once: with origin, direction and the answers some 100 bytes each, so 50 MB.
RAYS_PER_CHUNK = 500_000


@dataclass(frozen=True, eq=False)
class Reference:
    """What rays through the pixels of a view meet first; row 0 at the top.

    normal : float32 (H, W, 3), unit mean of the interpolated vertex normals of the samples that hit, model space,
        as the mesh has them (not turned towards the eye); zero where nothing was hit
    depth : float32 (H, W), distance along the view axis, mean of the samples that hit; inf where nothing was hit
    coverage : float32 (H, W) in 0..1, share of a pixel's samples that hit
    focal_pixels : pixels that a unit length covers at unit depth, as in `View`
    """

    normal: Float32Array
    depth: Float32Array
    coverage: Float32Array
    focal_pixels: float


def cast(mesh: Mesh, view: View, samples: int = 3) -> Reference:
    """Cast samples x samples rays through every pixel of `view` and average what they hit first.

    The samples form a regular grid at the centres of equal sub-pixels. Both sides of a triangle are hit. Rays start
    at the eye: the clip planes of the view do not cut the model.

    samples : along one side of a pixel, at least 1
    Raises ValueError where samples < 1, ImportError without embreex.
    """
    if samples < 1:
        raise ValueError("a pixel needs at least one sample")
    shape = (view.height, view.width)
    total = np.zeros((*shape, 3), np.float64)
    depth = np.zeros(shape, np.float64)
    hits = np.zeros(shape, np.int64)
    scene = _scene(mesh)
    for rows, columns in _chunks(_pixels_near(mesh, view), samples):
        inside, sample_normal, sample_depth = _cast_pixels(scene, mesh, view, rows, columns, samples)
        total[rows, columns] = sample_normal.sum(axis=1)
        depth[rows, columns] = sample_depth.sum(axis=1)
        hits[rows, columns] = inside.sum(axis=1)

    covered = hits > 0
    length = np.linalg.norm(total, axis=-1)
    normal = np.divide(total, length[..., None], out=np.zeros_like(total), where=(length > 0.0)[..., None])
    mean_depth = np.divide(depth, hits, out=np.full(shape, np.inf), where=covered)
    coverage = hits / samples**2
    return Reference(
        normal.astype(np.float32), mean_depth.astype(np.float32), coverage.astype(np.float32), view.focal_pixels
    )


def _scene(mesh: Mesh) -> Any:
    """Return embree's bounding volume hierarchy over the triangles of `mesh`."""
    from embreex import mesh_construction, rtcore_scene

    scene = rtcore_scene.EmbreeScene()
    mesh_construction.TriangleMesh(
        scene, np.ascontiguousarray(mesh.positions, np.float32), np.ascontiguousarray(mesh.faces, np.int32)
    )
    return scene


def _directions(view: View, x: Float64Array, y: Float64Array) -> Float64Array:
    """Return float64 (..., 3) directions through image points (x right, y down, pixels) in eye space, z = -1."""
    return np.stack(
        [
            (x - 0.5 * view.width) / view.focal_pixels,
            (0.5 * view.height - y) / view.focal_pixels,
            np.full(x.shape, -1.0),
        ],
        axis=-1,
    )


def _pixels_near(mesh: Mesh, view: View) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Return rows and columns of the pixels whose square can meet the bounding sphere of `mesh`."""
    low, high = mesh.positions.min(axis=0), mesh.positions.max(axis=0)
    centre = 0.5 * (low.astype(np.float64) + high)
    radius = float(np.sqrt(((mesh.positions - centre) ** 2).sum(axis=1).max()))
    centre_eye = view.eye_from_model[:3, :3] @ centre + view.eye_from_model[:3, 3]
    distance = float(np.linalg.norm(centre_eye))
    if distance <= radius:
        rows, columns = np.indices((view.height, view.width))
        return rows.ravel(), columns.ravel()
    y, x = np.mgrid[0 : view.height, 0 : view.width] + 0.5
    directions = _directions(view, x, y)
    cosine = directions @ (centre_eye / distance) / np.linalg.norm(directions, axis=-1)
    # Half a pixel's diagonal, 0.71 pixels, subtends less than 1 / focal length, at the picture's centre as elsewhere.
    limit = np.arcsin(radius / distance) + 1.0 / view.focal_pixels
    rows, columns = np.nonzero(np.arccos(np.clip(cosine, -1.0, 1.0)) <= limit)
    return rows, columns


def _chunks(
    pixels: tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]], samples: int
) -> Iterator[tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]]:
    """Yield the pixels in row order, as many at a time as keep RAYS_PER_CHUNK."""
    step = max(1, RAYS_PER_CHUNK // samples**2)
    for start in range(0, len(pixels[0]), step):
        yield pixels[0][start : start + step], pixels[1][start : start + step]


def _cast_pixels(
    scene: Any,
    mesh: Mesh,
    view: View,
    rows: npt.NDArray[np.intp],
    columns: npt.NDArray[np.intp],
    samples: int,
) -> tuple[npt.NDArray[np.bool_], Float64Array, Float64Array]:
    """Return hit (P, S), unit normal (P, S, 3) and depth (P, S) of the S samples of P pixels; zero where none."""
    offsets = (np.arange(samples) + 0.5) / samples
    offset_y, offset_x = (grid.ravel() for grid in np.meshgrid(offsets, offsets, indexing="ij"))
    eye_directions = _directions(view, columns[:, None] + offset_x, rows[:, None] + offset_y)
    # Row vectors: d @ R is the transpose of R turned into model space. |z| = 1 in eye space, so embree's ray
    # parameter is the distance along the view axis.
    directions = (eye_directions @ view.eye_from_model[:3, :3]).reshape(-1, 3).astype(np.float32)
    origins = np.ascontiguousarray(np.broadcast_to(view.eye.astype(np.float32), directions.shape))
    answer = scene.run(origins, directions, output=True)

    hit = answer["primID"] >= 0
    triangles = mesh.faces[answer["primID"][hit]]
    u = answer["u"][hit].astype(np.float64)[:, None]
    v = answer["v"][hit].astype(np.float64)[:, None]
    corners = mesh.normals[triangles].astype(np.float64)
    interpolated = (1.0 - u - v) * corners[:, 0] + u * corners[:, 1] + v * corners[:, 2]
    length = np.linalg.norm(interpolated, axis=1, keepdims=True)
    normal = np.zeros((hit.size, 3))
    normal[hit] = interpolated / np.maximum(length, np.finfo(np.float64).tiny)
    depth = np.where(hit, answer["tfar"], 0.0).astype(np.float64)
    shape = (rows.size, samples**2)
    return hit.reshape(shape), normal.reshape(*shape, 3), depth.reshape(shape)
