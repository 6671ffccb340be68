"""From a path to what can be drawn: the headless work that the window and the command line share."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from hierarchy.model import Mesh, Model, ModelError, Progress, UInt32Array, ignore_progress, in_file_space

if TYPE_CHECKING:
    from hierarchy.hierarchy import Hierarchy
    from hierarchy.normal_tiles import NormalTiles

T = TypeVar("T")

# Laser scans of the ground come in these files, and their z points up.
Z_UP_SUFFIXES = (".las", ".laz")


@dataclass(frozen=True)
class ModelSource:
    """Which model to open and how.

    path : None: the built-in meteoroid
    texture : an image that colours a mesh with texture coordinates
    points : build a point hierarchy from a mesh, too
    """

    path: Path | None = None
    texture: Path | None = None
    points: bool = False

    @property
    def z_up(self) -> bool:
        return self.path is not None and self.path.suffix.lower() in Z_UP_SUFFIXES


@dataclass(frozen=True)
class Content:
    """What a file holds.

    kind : "mesh" or "point cloud"
    points : number of vertices or points once cleaned; a vertex on a crease or a seam counts once a side
    triangles : 0 for a point cloud
    normals : "one a vertex" of a mesh, from the file or from its faces; of a cloud "in the file" or "estimated"
    lower, upper : corners of the bounding box in the file's own space
    """

    kind: str
    points: int
    triangles: int
    normals: str
    colored: bool
    closed: bool
    lower: tuple[float, float, float]
    upper: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Scene:
    """A model that is ready to be drawn; times in seconds. `tiles` is None until they are baked."""

    source: ModelSource
    content: Content
    hierarchy: Hierarchy
    tiles: NormalTiles | None
    load_s: float
    build_s: float
    bake_s: float


def open_scene(source: ModelSource, texels: int | None, progress: Progress = ignore_progress) -> Scene:
    """Load a model, build its hierarchy and bake its normal tiles.

    texels : along one side of a tile; None: bake no tiles
    progress : may raise `Cancelled`
    Raises ModelError.
    """
    from hierarchy.build import build_hierarchy

    model, load_s = _timed(lambda: _load(source, progress))
    hierarchy, build_s = _timed(lambda: build_hierarchy(model, points=source.points, progress=progress))
    scene = Scene(source, _content(model), hierarchy, None, load_s, build_s, 0.0)
    return scene if texels is None else bake_scene(scene, texels, progress)


def bake_scene(
    scene: Scene, texels: int, progress: Progress = ignore_progress, *, nodes: UInt32Array | None = None
) -> Scene:
    """Return the scene with tiles of `texels` x `texels` normals; progress may raise `Cancelled`.

    nodes : uint32 (K,), bake the tiles of these nodes only; None: of all
    """
    from hierarchy.normal_tiles import bake_tiles

    tiles, bake_s = _timed(lambda: bake_tiles(scene.hierarchy, texels, nodes=nodes, progress=progress))
    return Scene(scene.source, scene.content, scene.hierarchy, tiles, scene.load_s, scene.build_s, bake_s)


def _load(source: ModelSource, progress: Progress) -> Model:
    if source.path is None:
        if source.texture is not None:
            raise ModelError(f"{source.texture}: the built-in model has no texture coordinates")
        from hierarchy.meteoroid import make_meteoroid

        return make_meteoroid()
    from hierarchy.load import load_model

    return load_model(source.path, texture=source.texture, progress=progress)


def _content(model: Model) -> Content:
    lower = in_file_space(model, model.positions.min(axis=0))
    upper = in_file_space(model, model.positions.max(axis=0))
    is_mesh = isinstance(model, Mesh)
    return Content(
        kind="mesh" if is_mesh else "point cloud",
        points=len(model.positions),
        triangles=len(model.faces) if isinstance(model, Mesh) else 0,
        normals=_normals(model),
        colored=model.colors is not None,
        closed=isinstance(model, Mesh) and model.closed,
        lower=(float(lower[0]), float(lower[1]), float(lower[2])),
        upper=(float(upper[0]), float(upper[1]), float(upper[2])),
    )


def _normals(model: Model) -> str:
    if isinstance(model, Mesh):
        return "one a vertex"
    return "estimated" if model.estimated_normals else "in the file"


def _timed(work: Callable[[], T]) -> tuple[T, float]:
    start = time.perf_counter()
    result = work()
    return result, time.perf_counter() - start
