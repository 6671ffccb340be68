"""Vertex normals from faces, weighted by the angle that each face has at the vertex.

Based on: Thuermer and Wuethrich, Computing Vertex Normals from Polygonal Facets, 1998.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import get_num_threads, njit, prange

from hierarchy.model import Float32Array, Float64Array, Int32Array

# Every thread sums into an array of its own; beyond this many, adding them up costs more than it saves.
MOST_CHUNKS = 8
# Below this many radians the third angle of a triangle is not taken for what the others leave of pi.
SMALL_ANGLE = 1e-3
# Sums of angle times normal below this are the rounding of faces that cancel out; no triangle that has an area has a
# smaller angle than ten times this (clean.py).
CANCELLED = 1e-13


def vertex_normals(positions: npt.NDArray[np.floating], faces: npt.NDArray[np.integer]) -> Float32Array:
    """Return the angle-weighted mean of the face normals around every vertex.

    positions : float32 or float64 (V, 3)
    faces : integers (T, 3), counter-clockwise seen from outside, in 0 .. V - 1
    Returns float32 (V, 3), unit. Where the faces cancel out one of their normals is taken, at a vertex that no face
    of positive area uses (0, 0, 1).
    """
    corners = np.ascontiguousarray(faces, np.int32)
    return corner_group_normals(positions, corners, corners, len(positions))


def corner_group_normals(
    positions: npt.NDArray[np.floating], faces: Int32Array, groups: Int32Array, group_count: int
) -> Float32Array:
    """Do what `vertex_normals` does for groups of corners, where a crease gives one vertex several normals.

    groups : int32 (T, 3), the group of each corner, in 0 .. group_count - 1
    Returns float32 (group_count, 3), unit.
    """
    # Doubles hold the products of float32 coordinates of any size without overflow.
    points = np.ascontiguousarray(positions, np.float64)
    chunks = max(1, min(MOST_CHUNKS, get_num_threads(), len(faces) // 4096))
    sums = _summed_normals(points, faces, groups, group_count, chunks)
    normals: Float32Array
    normals, failed = _unit_normals(sums)
    if failed.any():
        _take_any_face_normal(points, faces, groups, failed, normals)
    return normals


@njit(inline="always")
def _cross(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> tuple[float, float, float]:
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@njit(cache=True, nogil=True, parallel=True)
def _summed_normals(
    points: Float64Array, faces: Int32Array, groups: Int32Array, group_count: int, chunks: int
) -> Float64Array:
    """Sum angle times unit face normal over the corners of each group, (chunks, group_count, 3)."""
    sums = np.zeros((chunks, group_count, 3))
    for chunk in prange(chunks):
        for t in range(chunk * len(faces) // chunks, (chunk + 1) * len(faces) // chunks):
            a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
            ux, uy, uz = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1], points[b, 2] - points[a, 2]
            vx, vy, vz = points[c, 0] - points[b, 0], points[c, 1] - points[b, 1], points[c, 2] - points[b, 2]
            wx, wy, wz = points[a, 0] - points[c, 0], points[a, 1] - points[c, 1], points[a, 2] - points[c, 2]
            nx, ny, nz = _cross(ux, uy, uz, vx, vy, vz)
            # The cross product of any two sides is as long as twice the area, so one root serves three angles.
            length = math.sqrt(nx * nx + ny * ny + nz * nz)
            if not length > 0.0:
                continue
            nx, ny, nz = nx / length, ny / length, nz / length
            angle_a = math.atan2(length, -(ux * wx + uy * wy + uz * wz))
            angle_b = math.atan2(length, -(vx * ux + vy * uy + vz * uz))
            angle_c = math.pi - angle_a - angle_b
            if angle_c < SMALL_ANGLE:
                # The tip of a needle: nothing but rounding would be left of the difference.
                angle_c = math.atan2(length, -(wx * vx + wy * vy + wz * vz))
            for i, angle in ((0, angle_a), (1, angle_b), (2, angle_c)):
                group = groups[t, i]
                sums[chunk, group, 0] += angle * nx
                sums[chunk, group, 1] += angle * ny
                sums[chunk, group, 2] += angle * nz
    return sums


@njit(cache=True, nogil=True, parallel=True)
def _unit_normals(sums: Float64Array) -> tuple[Float32Array, npt.NDArray[np.bool_]]:
    """Add up the chunks and normalise; say where there is no direction."""
    chunks, count, _ = sums.shape
    normals = np.empty((count, 3), np.float32)
    failed = np.zeros(count, np.bool_)
    for g in prange(count):
        x, y, z = sums[0, g, 0], sums[0, g, 1], sums[0, g, 2]
        for chunk in range(1, chunks):
            x, y, z = x + sums[chunk, g, 0], y + sums[chunk, g, 1], z + sums[chunk, g, 2]
        length = math.sqrt(x * x + y * y + z * z)
        if length > CANCELLED:
            normals[g, 0], normals[g, 1], normals[g, 2] = x / length, y / length, z / length
        else:
            normals[g, 0], normals[g, 1], normals[g, 2] = 0.0, 0.0, 1.0
            failed[g] = True
    return normals, failed


@njit(cache=True, nogil=True)
def _take_any_face_normal(
    points: Float64Array, faces: Int32Array, groups: Int32Array, failed: npt.NDArray[np.bool_], normals: Float32Array
) -> None:
    """Give the groups that failed the normal of their first face of positive area."""
    for t in range(len(faces)):
        for i in range(3):
            group = groups[t, i]
            if failed[group]:
                u = points[faces[t, 1]] - points[faces[t, 0]]
                v = points[faces[t, 2]] - points[faces[t, 0]]
                nx, ny, nz = _cross(u[0], u[1], u[2], v[0], v[1], v[2])
                length = math.sqrt(nx * nx + ny * ny + nz * nz)
                if length > 0.0:
                    normals[group, 0], normals[group, 1], normals[group, 2] = nx / length, ny / length, nz / length
                    failed[group] = False
