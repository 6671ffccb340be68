"""From a path to what can be drawn: the headless work that the window and the command line share."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from app.kernels import spare_blas
from hierarchy.model import Mesh, Model, ModelError, Progress, ignore_progress, in_file_space
from hierarchy.plain_text import plain_line

if TYPE_CHECKING:
    from app.cache import Cache
    from app.inputs import Inputs
    from hierarchy.hierarchy import Hierarchy

T = TypeVar("T")

# Laser scans of the ground come in these files, and their z points up.
Z_UP_SUFFIXES = (".las", ".laz")

# Triangles or points from which on a hierarchy takes so long to build that a coarse one is shown before: two seconds.
WORTH_A_STAND_IN = 1_000_000

# Seconds that building has to take to be worth keeping.
WORTH_KEEPING = 0.05


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


@dataclass(eq=False)
class Provenance:
    """Where a hierarchy comes from; all scenes with that hierarchy share it.

    inputs : the files that it was built from, None: there is nothing left to do for the cache
    entry : what it is called in the cache, "": it is not there
    """

    inputs: Inputs | None
    entry: str = ""


@dataclass(frozen=True, eq=False)
class Scene:
    """A model that is ready to be drawn; times in seconds.

    load_s : the file's, or the cache's where the hierarchy was in it; nothing is built then, and `build_s` is 0
    """

    source: ModelSource
    content: Content
    hierarchy: Hierarchy
    load_s: float
    build_s: float
    provenance: Provenance = field(default_factory=lambda: Provenance(None))

    @property
    def is_mesh(self) -> bool:
        """Its hierarchy's leaves are triangles."""
        from hierarchy.leaves import Triangles

        return isinstance(self.hierarchy.leaves, Triangles)


def open_scene(
    source: ModelSource,
    progress: Progress = ignore_progress,
    *,
    cache: Cache | None = None,
    show: Callable[[Scene], None] | None = None,
) -> Scene:
    """Load a model and build its hierarchy, or take that from the cache.

    progress : may raise `Cancelled`
    show : called with a coarse stand-in for the scene as soon as there is one, where the rest takes long; None: nobody
        wants to see it
    Raises ModelError.
    """
    # Kernels come from here on.
    spare_blas()
    scene = _find(source, cache)
    return _build(source, progress, show) if scene is None else scene


def keep_scene(scene: Scene, cache: Cache, progress: Callable[[float], None] = lambda fraction: None) -> None:
    """Put a hierarchy into the cache that took long to make and is not there.

    progress : called now and then; an exception that it raises ends the work and is passed on
    """
    provenance = scene.provenance
    if provenance.inputs is not None and scene.load_s + scene.build_s > WORTH_KEEPING:
        inputs, provenance.inputs = provenance.inputs, None
        entry, notes = cache.entry(scene.source, inputs)
        notes["content"] = json.dumps(asdict(scene.content))
        if entry and cache.keep(entry, scene.hierarchy, notes, progress):
            provenance.entry = entry


def _find(source: ModelSource, cache: Cache | None) -> Scene | None:
    """Take a model from the cache; None: it has to be built."""
    if cache is None or (source.path is None and source.texture is not None):
        return None
    found, find_s = _timed(lambda: cache.find(source))
    content = None if found is None else _content_of_notes(found.notes)
    if found is None or content is None:
        return None
    name = found.hierarchy.name if source.path is None else plain_line(source.path.name)
    hierarchy = replace(found.hierarchy, name=name)
    return Scene(source, content, hierarchy, find_s, 0.0, Provenance(None, found.entry))


def _build(source: ModelSource, progress: Progress, show: Callable[[Scene], None] | None) -> Scene:
    from app.inputs import watch
    from hierarchy.build import build_hierarchy

    (model, inputs), load_s = _timed(lambda: watch(source, lambda: _load(source, progress)))
    primitives = len(model.faces) if isinstance(model, Mesh) else len(model.positions)
    if show is not None and primitives >= WORTH_A_STAND_IN:
        from hierarchy.stand_in import stand_in

        # Without a stand-in it has to do, too.
        with suppress(MemoryError):
            coarse, coarse_s = _timed(lambda: build_hierarchy(stand_in(model), progress=progress))
            show(Scene(source, _content(model), coarse, load_s, coarse_s))
    hierarchy, build_s = _timed(lambda: build_hierarchy(model, points=source.points, progress=progress))
    return Scene(source, _content(model), hierarchy, load_s, build_s, Provenance(inputs))


def _content_of_notes(notes: Mapping[str, str]) -> Content | None:
    """Read what `keep_scene` noted; None: another version of the program did."""
    try:
        noted = json.loads(notes["content"])
        return Content(**{**noted, "lower": tuple(noted["lower"]), "upper": tuple(noted["upper"])})
    except (LookupError, TypeError, ValueError, AttributeError):
        return None


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
