"""Base surfels of a mesh: one disc a triangle, so that the discs cover the surface with no hole.

A disc is the triangle's minimum enclosing circle: on the longest edge as diameter where the triangle is obtuse, the
circumcircle otherwise. Around a big or needle-shaped triangle it sticks out far beyond the surface, so long edges are
halved first.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from hierarchy.model import Float32Array, Int32Array, Mesh, PointCloud, UInt8Array
from hierarchy.part import AnyArray

# Discs overshoot the surface by their radius at most, and edges are halved until that is below this share of the
# bounding box's diagonal: 3 pixels where the model fills a window of 1000. Scans are finer than that as they are.
OVERSHOOT = 1.0 / 300.0
# Splitting stops here, with the worst edges split first: a box of 12 triangles would want about half as many.
MOST_SURFELS = 1_000_000
# A disc that leans from its triangle's plane is widened to cover it; beyond 60 degrees the normal is just wrong.
LEAST_LEAN_COSINE = 0.5


def surfels_of_mesh(mesh: Mesh) -> PointCloud:
    """Return one surfel a triangle of the mesh, of which big and needle-shaped triangles are split.

    Each surfel has the mesh's normal interpolated at its centre, and its triangle's mean colour.
    """
    positions, faces, normals, colors = _split(mesh)
    centres, out_normals, radii = _surfels(positions, normals, faces)
    mean_colors = None if colors is None else np.rint(colors[faces].mean(axis=1)).astype(np.uint8)
    return PointCloud(
        mesh.name, mesh.origin, centres, out_normals, radii, mean_colors, warnings=mesh.warnings, scale=mesh.scale
    )


def _split(mesh: Mesh) -> tuple[Float32Array, Int32Array, Float32Array, UInt8Array | None]:
    """Halve the mesh's edges until none is longer than the overshoot allows."""
    diagonal = float(np.linalg.norm(mesh.positions.max(axis=0).astype(np.float64) - mesh.positions.min(axis=0)))
    longest = 2.0 * OVERSHOOT * diagonal
    if not longest > 0.0 or _longest_edge(mesh.positions, mesh.faces) <= longest:
        return mesh.positions, mesh.faces, mesh.normals, mesh.colors
    from hierarchy.subdivide import subdivide_edges
    from hierarchy.unique_rows import unique_positions

    def excess(positions: np.ndarray, attributes: object, ends: Int32Array) -> np.ndarray:
        a, b = positions[ends[:, 0]].astype(np.float64), positions[ends[:, 1]]
        return np.asarray(np.linalg.norm(a - b, axis=1) / longest)

    points, _ = unique_positions(mesh.positions)
    attributes: list[AnyArray] = [mesh.normals] if mesh.colors is None else [mesh.normals, mesh.colors]
    most = max(MOST_SURFELS, len(mesh.faces))
    split = subdivide_edges(mesh.positions, mesh.faces, attributes, excess, most_faces=most, points=points)
    colors = None if mesh.colors is None else split.attributes[1]
    return split.positions, split.faces, split.attributes[0], colors


@nb.njit(cache=True, nogil=True, parallel=True)
def _longest_edge(positions, faces):  # type: ignore[no-untyped-def]
    longest = 0.0
    for i in nb.prange(len(faces)):
        length2 = 0.0
        for k in range(3):
            a, b = faces[i, k], faces[i, (k + 1) % 3]
            edge2 = 0.0
            for axis in range(3):
                edge2 += (np.float64(positions[a, axis]) - positions[b, axis]) ** 2
            length2 = max(length2, edge2)
        longest = max(longest, length2)
    return math.sqrt(longest)


@nb.njit(cache=True, nogil=True)
def enclosing_disc(corners, weights):  # type: ignore[no-untyped-def]
    """Write the barycentric coordinates of the centre of a triangle's minimum enclosing circle; return the radius.

    corners : float64 (3, 3); weights : float64 (3,), receives the coordinates
    """
    # Squared edge lengths, each opposite to its corner.
    a2 = b2 = c2 = 0.0
    for axis in range(3):
        a2 += (corners[1, axis] - corners[2, axis]) ** 2
        b2 += (corners[2, axis] - corners[0, axis]) ** 2
        c2 += (corners[0, axis] - corners[1, axis]) ** 2
    # Barycentric coordinates of the circumcentre; one would be negative where the angle there is obtuse.
    wa, wb, wc = a2 * (b2 + c2 - a2), b2 * (c2 + a2 - b2), c2 * (a2 + b2 - c2)
    if a2 >= b2 + c2:
        wa, wb, wc, radius = 0.0, 0.5, 0.5, 0.5 * math.sqrt(a2)
    elif b2 >= c2 + a2:
        wa, wb, wc, radius = 0.5, 0.0, 0.5, 0.5 * math.sqrt(b2)
    elif c2 >= a2 + b2:
        wa, wb, wc, radius = 0.5, 0.5, 0.0, 0.5 * math.sqrt(c2)
    else:
        total = wa + wb + wc
        wa, wb, wc = wa / total, wb / total, wc / total
        radius2 = 0.0
        for axis in range(3):
            centre = wa * corners[0, axis] + wb * corners[1, axis] + wc * corners[2, axis]
            radius2 += (centre - corners[0, axis]) ** 2
        radius = math.sqrt(radius2)
    weights[0], weights[1], weights[2] = wa, wb, wc
    return radius


@nb.njit(cache=True, nogil=True)
def _surfel(positions, normals, face, centre, out_normal):  # type: ignore[no-untyped-def]
    """Write centre and normal of a triangle's surfel; return its radius."""
    corners = np.empty((3, 3), np.float64)
    weights = np.empty(3, np.float64)
    for k in range(3):
        for axis in range(3):
            corners[k, axis] = positions[face[k], axis]
    radius = enclosing_disc(corners, weights)
    plane = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    plane /= max(math.sqrt((plane * plane).sum()), 1e-300)
    normal = np.zeros(3, np.float64)
    for k in range(3):
        for axis in range(3):
            normal[axis] += weights[k] * normals[face[k], axis]
    norm = math.sqrt((normal * normal).sum())
    # Opposite normals at a crease cancel.
    normal = normal / norm if norm > 1e-6 else plane
    for axis in range(3):
        centre[axis] = (weights * corners[:, axis]).sum()
        out_normal[axis] = normal[axis]
    return radius / max(abs((normal * plane).sum()), LEAST_LEAN_COSINE)


@nb.njit(cache=True, nogil=True, parallel=True)
def _surfels(positions, normals, faces):  # type: ignore[no-untyped-def]
    count = len(faces)
    centres = np.empty((count, 3), np.float32)
    out_normals = np.empty((count, 3), np.float32)
    radii = np.empty(count, np.float32)
    for i in nb.prange(count):
        radii[i] = _surfel(positions, normals, faces[i], centres[i], out_normals[i])
    return centres, out_normals, radii
