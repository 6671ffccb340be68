"""A model under measurement: its mesh, what is built from it, and what the building takes."""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TypeVar

import numpy as np

from app.errors import UsageError
from app.memory import peak_memory_mb
from benchmarks.run_file import Json
from hierarchy.build import build_hierarchy
from hierarchy.hierarchy import Hierarchy
from hierarchy.load import load_model
from hierarchy.lod import Cut
from hierarchy.meteoroid import make_meteoroid
from hierarchy.model import Mesh, Model, UInt32Array
from hierarchy.normal_tiles import count_tiles

T = TypeVar("T")

BUILT_IN = "built-in"
# Triangles of the model that is built and baked once so that compiling does not count as building.
WARM_UP_TRIANGLES = 2_000
NORMAL_BYTES = 2
# Tiles of a whole model are baked, to be counted, where tiles of one size would take no more than this.
MOST_TILE_BYTES = 500_000_000


class Subject:
    """A mesh, its two hierarchies and its tiles, each made when it is first asked for.

    name : of the mesh
    info : what a run file says of it under "models"; grows with what is made: "content" (sha256 of the file, or
        "built-in"), "triangles", "vertices", "closed", "load_s"; of the hybrid hierarchy "build_s", "nodes", "leaves",
        "hierarchy_bytes", and by w_s "bake_s" and "tile_bytes"; the same of the point hierarchy as "points_build_s",
        "points_nodes", ...; "peak_memory_mb" of the process once they were built
    """

    def __init__(self, path: Path | None) -> None:
        """Load the model, None: the built-in one, without its colours, which the baseline does not draw either.

        Raises ModelError where it cannot be read, UsageError where it has no surface to compare with.
        """
        if path is None:
            # So that compiling does not count as making.
            make_meteoroid(WARM_UP_TRIANGLES)
        model, load_s = timed(lambda: _load(path))
        if not isinstance(model, Mesh):
            raise UsageError(f"{model.name}: a point cloud has no surface to compare with")
        self.mesh: Mesh = replace(model, colors=None)
        self.name: str = model.name
        self.digest = _mesh_digest(self.mesh)
        self.info: Json = {
            "content": BUILT_IN if path is None else _file_digest(path),
            "triangles": len(model.faces),
            "vertices": len(model.positions),
            "closed": model.closed,
            "load_s": load_s,
            "bake_s": {},
            "tile_bytes": {},
        }
        self._hierarchies: dict[bool, Hierarchy] = {}
        self._tile_bytes: dict[tuple[bool, int], float] = {}

    def hierarchy(self, *, points: bool) -> Hierarchy:
        """Return the point hierarchy or the hybrid one."""
        if points not in self._hierarchies:
            warm_up()
            hierarchy, build_s = timed(lambda: build_hierarchy(self.mesh, points=points))
            self._hierarchies[points] = hierarchy
            of = "points_" if points else ""
            self.info |= {
                f"{of}build_s": build_s,
                f"{of}nodes": hierarchy.node_count,
                f"{of}leaves": hierarchy.leaf_count,
                f"{of}hierarchy_bytes": hierarchy.nbytes,
                "peak_memory_mb": peak_memory_mb(),
            }
        return self._hierarchies[points]

    def tile_bytes(self, *, points: bool, texels: int, fitted: bool) -> float:
        """Return the bytes that the tiles of all nodes take, nan where it would take too long to find out.

        fitted : as few texels as will do, else w_s x w_s each
        """
        hierarchy = self.hierarchy(points=points)
        if not fitted:
            return hierarchy.node_count * texels**2 * NORMAL_BYTES
        if (points, texels) not in self._tile_bytes:
            whole = hierarchy.node_count * texels**2 * NORMAL_BYTES
            if texels == 0 or whole > MOST_TILE_BYTES:
                self._tile_bytes[points, texels] = math.nan if texels else 0.0
                return self._tile_bytes[points, texels]
            count, bake_s = timed(lambda: count_tiles(hierarchy, texels))
            self._tile_bytes[points, texels] = count.nbytes
            if not points:
                self.info["bake_s"][str(texels)] = bake_s
                self.info["tile_bytes"][str(texels)] = count.nbytes
        return self._tile_bytes[points, texels]


def nodes_of(cut: Cut, hierarchy: Hierarchy) -> UInt32Array:
    """Return the splats of a cut that are nodes, and so have a tile."""
    return cut.splats[cut.splats < hierarchy.node_count]


@cache
def warm_up() -> None:
    """Have everything compiled that building and baking needs."""
    small = make_meteoroid(WARM_UP_TRIANGLES)
    for points in (False, True):
        count_tiles(build_hierarchy(small, points=points), 4)


def timed(work: Callable[[], T]) -> tuple[T, float]:
    """Return what the work returns and the seconds that it took."""
    start = time.perf_counter()
    result = work()
    return result, time.perf_counter() - start


def _load(path: Path | None) -> Model:
    return make_meteoroid() if path is None else load_model(path)


def _file_digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _mesh_digest(mesh: Mesh) -> str:
    digest = hashlib.sha256()
    for array in (mesh.positions, mesh.faces, mesh.normals):
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()
