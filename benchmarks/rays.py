"""One ray through the same point of many pixels: directions for embree, and what its answers mean on the mesh."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

from benchmarks.extras import require
from hierarchy.model import Float32Array, Float64Array, Int32Array, Mesh
from hierarchy.view import View

PixelArray = npt.NDArray[np.int64]

# Rays of one call to embree: few enough to share out to the cores, many enough that Python between them costs nothing.
RAYS_PER_CALL = 65_536


@dataclass(frozen=True, eq=False)
class Sample:
    """What one ray a pixel meets first, every ray through the same point of its pixel; row 0 at the top.

    normal : float32 (H, W, 3), unit interpolated vertex normal, model space; zero where nothing was hit
    depth : float32 (H, W), distance along the view axis; inf where nothing was hit
    color : float32 (H, W, 3), interpolated vertex colour, sRGB in 0..1, zero where nothing was hit; None: the mesh
        has no colours
    """

    normal: Float32Array
    depth: Float32Array
    color: Float32Array | None


class RayCaster:
    """Embree's bounding volume hierarchy over a mesh, for any number of views."""

    def __init__(self, mesh: Mesh) -> None:
        """Build it. Raises UsageError without embreex."""
        construction, core = (require(f"embreex.{name}", "embreex") for name in ("mesh_construction", "rtcore_scene"))
        self._scene: Any = core.EmbreeScene()
        positions = np.ascontiguousarray(mesh.positions, np.float32)
        self._faces = np.ascontiguousarray(mesh.faces, np.int32)
        self._normals = np.ascontiguousarray(mesh.normals, np.float32)
        self._colors = None if mesh.colors is None else mesh.colors[:, :3].astype(np.float32) / np.float32(255.0)
        construction.TriangleMesh(self._scene, positions, self._faces)
        # The first call commits the scene, which threads must not do side by side.
        self._scene.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))
        low, high = positions.min(axis=0), positions.max(axis=0)
        self._centre = 0.5 * (low.astype(np.float64) + high)
        self._radius = float(np.sqrt(((positions - self._centre) ** 2).sum(axis=1).max()))

    def samples(self, view: View, offsets: list[tuple[float, float]]) -> Iterator[Sample]:
        """Yield what the rays through one point of every pixel hit, for one point after the other.

        Both sides of a triangle are hit. Rays start at the eye: the clip planes of the view do not cut the model.

        offsets : x right and y down of the points in their pixels, in 0..1
        """
        pixels = pixels_near(view, self._centre, self._radius)
        parts = [pixels[start : start + RAYS_PER_CALL] for start in range(0, len(pixels), RAYS_PER_CALL)]
        size = view.width * view.height
        with ThreadPoolExecutor(os.cpu_count()) as threads:
            for offset in offsets:
                normal = np.zeros((size, 3), np.float32)
                depth = np.full(size, np.inf, np.float32)
                color = None if self._colors is None else np.zeros((size, 3), np.float32)

                def cast(
                    part: PixelArray,
                    offset: tuple[float, float] = offset,
                    normal: Float32Array = normal,
                    depth: Float32Array = depth,
                    color: Float32Array | None = color,
                ) -> None:
                    self._cast(part, view, offset, normal, depth, color)

                # Every part writes pixels of its own: the order of the threads does not show.
                for _ in threads.map(cast, parts):
                    pass
                shape = (view.height, view.width)
                yield Sample(
                    normal.reshape(*shape, 3), depth.reshape(shape), None if color is None else color.reshape(*shape, 3)
                )

    def _cast(
        self,
        pixels: PixelArray,
        view: View,
        offset: tuple[float, float],
        normal: Float32Array,
        depth: Float32Array,
        color: Float32Array | None,
    ) -> None:
        """Cast rays through some pixels (indices into the flat arrays) and write what they hit."""
        rotation = np.ascontiguousarray(view.eye_from_model[:3, :3])
        directions = _directions(pixels, view.width, view.height, view.focal_pixels, *offset, rotation)
        origins = np.empty_like(directions)
        origins[:] = view.eye
        if view.is_parallel:
            origins += directions + rotation[2].astype(np.float32)
            directions[:] = -rotation[2]
        # |z| = 1 in eye space, so embree's ray parameter is the distance along the view axis.
        hits = self._scene.run(origins, directions, output=True)
        triangles, u, v = hits["primID"], hits["u"], hits["v"]
        _write_depth(pixels, triangles, hits["tfar"] + np.float32(view.depth_of_eye), depth)
        _interpolate(pixels, triangles, u, v, self._faces, self._normals, True, normal)
        if color is not None and self._colors is not None:
            _interpolate(pixels, triangles, u, v, self._faces, self._colors, False, color)


def pixels_near(view: View, centre: Float64Array, radius: float) -> PixelArray:
    """Return the flat indices, ascending, of the pixels whose square can meet a sphere in model space."""
    centre_eye = view.eye_from_model[:3, :3] @ centre + view.eye_from_model[:3, 3]
    if view.is_parallel:
        x = np.arange(view.width) + 0.5 - (0.5 * view.width + centre_eye[0] * view.focal_pixels)
        y = (np.arange(view.height) + 0.5 - (0.5 * view.height - centre_eye[1] * view.focal_pixels))[:, None]
        return np.flatnonzero(np.hypot(x, y) <= radius * view.focal_pixels + 1.0)
    distance = float(np.linalg.norm(centre_eye))
    if distance <= radius:
        return np.arange(view.width * view.height)
    # Half a pixel's diagonal, 0.71 pixels, subtends less than 1 / focal length, at the picture's centre as elsewhere.
    limit = np.arcsin(radius / distance) + 1.0 / view.focal_pixels
    x = (np.arange(view.width) + 0.5 - 0.5 * view.width) / view.focal_pixels
    y = (0.5 * view.height - 0.5 - np.arange(view.height))[:, None] / view.focal_pixels
    towards = (x * centre_eye[0] + y * centre_eye[1] - centre_eye[2]) / distance
    return np.flatnonzero(towards >= np.cos(limit) * np.sqrt(x * x + y * y + 1.0))


@njit(cache=True, nogil=True)
def _directions(
    pixels: PixelArray, width: int, height: int, focal: float, dx: float, dy: float, rotation: Float64Array
) -> Float32Array:
    """Return float32 (P, 3) directions in model space through a point of each pixel, -1 long along eye space's z."""
    directions = np.empty((len(pixels), 3), np.float32)
    for ray in range(len(pixels)):
        x = (pixels[ray] % width + dx - 0.5 * width) / focal
        y = (0.5 * height - (pixels[ray] // width + dy)) / focal
        for axis in range(3):
            directions[ray, axis] = x * rotation[0, axis] + y * rotation[1, axis] - rotation[2, axis]
    return directions


@njit(cache=True, nogil=True)
def _write_depth(pixels: PixelArray, triangles: Int32Array, along: Float32Array, depth: Float32Array) -> None:
    for ray in range(len(pixels)):
        if triangles[ray] >= 0:
            depth[pixels[ray]] = along[ray]


@njit(cache=True, nogil=True)
def _interpolate(
    pixels: PixelArray,
    triangles: Int32Array,
    u: Float32Array,
    v: Float32Array,
    faces: Int32Array,
    values: Float32Array,
    unit: bool,
    out: Float32Array,
) -> None:
    """Interpolate values (V, 3) of the vertices over the triangles hit, and write them at their pixels.

    u, v : barycentric weights of the second and the third corner
    unit : scale the results to length 1, those of length 0 excepted
    """
    for ray in range(len(pixels)):
        triangle = triangles[ray]
        if triangle < 0:
            continue
        a, b, c = faces[triangle, 0], faces[triangle, 1], faces[triangle, 2]
        wb, wc = float(u[ray]), float(v[ray])
        wa = 1.0 - wb - wc
        x = wa * values[a, 0] + wb * values[b, 0] + wc * values[c, 0]
        y = wa * values[a, 1] + wb * values[b, 1] + wc * values[c, 1]
        z = wa * values[a, 2] + wb * values[b, 2] + wc * values[c, 2]
        scale = 1.0
        if unit:
            length = np.sqrt(x * x + y * y + z * z)
            scale = 1.0 / length if length > 0.0 else 0.0
        pixel = pixels[ray]
        out[pixel, 0], out[pixel, 1], out[pixel, 2] = scale * x, scale * y, scale * z
