"""What single rays meet first on a mesh: what the views are chosen by. It needs embreex."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks.extras import require
from hierarchy.model import Float64Array, Mesh


class Sight:
    """A mesh, and what an eye sees of it first."""

    def __init__(self, mesh: Mesh) -> None:
        """Raises UsageError without embreex."""
        construction, core = (require(f"embreex.{name}", "embreex") for name in ("mesh_construction", "rtcore_scene"))
        self._scene: Any = core.EmbreeScene()
        construction.TriangleMesh(
            self._scene, np.ascontiguousarray(mesh.positions, np.float32), np.ascontiguousarray(mesh.faces, np.int32)
        )
        corners = mesh.positions[mesh.faces].astype(np.float64)
        areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        lengths = np.linalg.norm(areas, axis=1, keepdims=True)
        self.centroids: Float64Array = corners.mean(axis=1)
        self.normals: Float64Array = areas / np.maximum(lengths, np.finfo(np.float64).tiny)

    def first_hits(self, eye: Float64Array, targets: Float64Array) -> tuple[npt.NDArray[np.intp], Float64Array]:
        """Return the triangles that the rays from `eye` (3,) through `targets` (N, 3) meet first, and how far away.

        -1 and inf where there is none. Model space, single precision.
        """
        towards = targets - eye
        towards /= np.linalg.norm(towards, axis=1, keepdims=True)
        directions = np.ascontiguousarray(towards, np.float32)
        origins = np.ascontiguousarray(np.broadcast_to(eye, directions.shape), np.float32)
        answer = self._scene.run(origins, directions, output=True)
        triangles = np.asarray(answer["primID"], np.intp)
        return triangles, np.where(triangles >= 0, answer["tfar"], np.inf).astype(np.float64)
