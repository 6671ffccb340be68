"""The surface that shows how time grows with the model: one meteoroid in any number of triangles.

Only the number of triangles changes: the roughness ends with waves that 0.1 M triangles just carry, so from there on
every size shows the same picture, and what a frame costs can be compared. Scans are finer where they have more
triangles; what that costs is not in these figures.
"""

from __future__ import annotations

import math

import numpy as np

from benchmarks.views import DISTANCE, VIEW_ANGLE_DEGREES
from hierarchy.meteoroid import make_meteoroid
from hierarchy.model import Mesh
from hierarchy.view import View, look_at

# Triangles that just carry the finest waves, four edges each.
DETAIL = 100_000
SIZES = (10_000, 30_000, 100_000, 270_000, 1_000_000, 4_000_000, 17_000_000)
# Triangles of the copy by which the camera is placed.
FRAMING = 10_000


def make_surface(triangles: int) -> Mesh:
    """Make the surface of about `triangles` triangles, closed, with exact normals.

    Raises ValueError where `triangles` is below 20 or beyond what 32-bit indices hold.
    """
    return make_meteoroid(triangles, detail_of=DETAIL)


def surface_view(mesh: Mesh, resolution: tuple[int, int]) -> View:
    """Return the view "front" of the surface, the same at every size to the last bit of the eye's place.

    mesh : the surface, of any size; its origin and its radius differ a little from size to size
    resolution : width and height in pixels
    """
    coarse = make_surface(FRAMING)
    diagonal = float(np.linalg.norm(coarse.positions.max(axis=0) - coarse.positions.min(axis=0)))
    eye = coarse.origin + coarse.scale * DISTANCE * diagonal * np.array([0.0, 0.0, 1.0])
    radius = float(np.sqrt(np.einsum("ij,ij->i", mesh.positions, mesh.positions).max()))
    return look_at(
        eye,
        coarse.origin,
        (0.0, 1.0, 0.0),
        math.radians(VIEW_ANGLE_DEGREES),
        resolution,
        origin=mesh.origin,
        scale=mesh.scale,
        bounds=(np.zeros(3), radius),
    )
