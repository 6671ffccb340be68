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
# A disc that leans from its triangle's plane is widened to cover it; beyond 60 degrees the normal is just wrong, and
# the plane's is taken.
LEAST_LEAN_COSINE = 0.5
# Radii are stored as float32 beside float32 normals: more than both are off by.
ROUNDED_UP = 1.0 + 1e-6


def surfels_of_mesh(mesh: Mesh) -> PointCloud:
    """Return one surfel a triangle of the mesh, of which big and needle-shaped triangles are split.

    Each surfel has the mesh's normal interpolated at its centre, or its triangle's where that leans too far from it,
    and its triangle's mean colour.
    """
    positions, faces, normals, colors = _split(mesh)
    centres, out_normals, radii = _surfels(positions, normals, faces, mesh.closed)
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

    corners : float64 (3, 3); weights : float64 (3,), receives the coordinates, none negative
    The circumcentre is found from the shortest edge, at both ends of which an acute triangle has at least 45 degrees:
    so it is as good for needles as for any other.
    """
    shortest, apex = np.inf, 0
    for k in range(3):
        edge = corners[(k + 2) % 3] - corners[(k + 1) % 3]
        edge2 = (edge * edge).sum()
        if edge2 < shortest:
            shortest, apex = edge2, k
    start, end = (apex + 1) % 3, (apex + 2) % 3
    u, v = corners[end] - corners[start], corners[apex] - corners[start]
    across = v - u
    uv = (u * v).sum()
    if uv <= 0.0:
        weights[start], weights[end], weights[apex] = 0.0, 0.5, 0.5
    elif (u * across).sum() >= 0.0:
        weights[start], weights[end], weights[apex] = 0.5, 0.0, 0.5
    else:
        # Along u to its middle, and across it, along the part of v that is normal to u, to as far from all three.
        along = uv / shortest
        beta = min(0.5 * (v * across).sum() / ((v * v).sum() - along * uv), 1.0)
        alpha = min(max(0.5 - beta * along, 0.0), 1.0 - beta)
        weights[start], weights[end], weights[apex] = max(1.0 - alpha - beta, 0.0), alpha, beta
    # Relative to a corner: beside the origin's distance a small triangle would lose its digits.
    centre = weights[end] * u + weights[apex] * v
    return math.sqrt(max((centre * centre).sum(), ((u - centre) ** 2).sum(), ((v - centre) ** 2).sum()))


@nb.njit(cache=True, nogil=True)
def _surfel(positions, normals, closed, face, centre, out_normal):  # type: ignore[no-untyped-def]
    """Write centre and normal of a triangle's surfel; return its radius."""
    corners = np.empty((3, 3), np.float64)
    weights = np.empty(3, np.float64)
    for k in range(3):
        for axis in range(3):
            corners[k, axis] = positions[face[k], axis]
    enclosing_disc(corners, weights)
    u, v = corners[1] - corners[0], corners[2] - corners[0]
    plane = np.cross(u, v)
    plane /= max(math.sqrt((plane * plane).sum()), 1e-300)
    normal = np.zeros(3, np.float64)
    for k in range(3):
        for axis in range(3):
            normal[axis] += weights[k] * normals[face[k], axis]
    norm = math.sqrt((normal * normal).sum())
    has_plane = (plane * plane).sum() > 0.0
    if norm > 1e-6:
        normal /= norm
        lean = (normal * plane).sum()
        # What faces away on a closed surface is not drawn: a normal on the wrong side would make a hole there. That of
        # an open one may know the sides better than the order of the corners.
        side = 1.0 if closed or lean >= 0.0 else -1.0
        if has_plane and side * lean < LEAST_LEAN_COSINE:
            normal = side * plane if side * lean > -LEAST_LEAN_COSINE else -normal
    else:
        # Opposite normals at a crease cancel. A triangle without an area has no plane either.
        for axis in range(3):
            normal[axis] = plane[axis] if has_plane else normals[face[0], axis]
    stored = np.empty(3, np.float64)
    for axis in range(3):
        centre[axis] = corners[0, axis] + weights[1] * u[axis] + weights[2] * v[axis]
        out_normal[axis] = normal[axis]
        stored[axis] = centre[axis]
    # From the centre as it is stored, rounded, and rounded up: small triangles far out are covered, too.
    radius2 = 0.0
    for k in range(3):
        radius2 = max(radius2, ((corners[k] - stored) ** 2).sum())
    return math.sqrt(radius2) / max(abs((normal * plane).sum()), LEAST_LEAN_COSINE) * ROUNDED_UP


@nb.njit(cache=True, nogil=True, parallel=True)
def _surfels(positions, normals, faces, closed):  # type: ignore[no-untyped-def]
    count = len(faces)
    centres = np.empty((count, 3), np.float32)
    out_normals = np.empty((count, 3), np.float32)
    radii = np.empty(count, np.float32)
    for i in nb.prange(count):
        radii[i] = _surfel(positions, normals, closed, faces[i], centres[i], out_normals[i])
    return centres, out_normals, radii
