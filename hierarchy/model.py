"""What a file holds, once read and cleaned: a mesh or a point cloud.

All positions are in model space, float32: relative to a float64 `origin` (the centre of the bounding box in the
file's own space), so that georeferenced coordinates near 1e7 lose nothing, and in units of a `scale` about as long
as the model, so that no square of a length leaves the range of float32, whatever unit the file is in.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

Float32Array = npt.NDArray[np.float32]
Float64Array = npt.NDArray[np.float64]
Int32Array = npt.NDArray[np.int32]
Int64Array = npt.NDArray[np.int64]
UInt8Array = npt.NDArray[np.uint8]
UInt16Array = npt.NDArray[np.uint16]
UInt32Array = npt.NDArray[np.uint32]
BoolArray = npt.NDArray[np.bool_]

Progress = Callable[[str, float], None]
"""Called as progress(stage, fraction in 0..1) from the working thread; it may raise `Cancelled`."""


class ModelError(Exception):
    """A model cannot be used. The message is one line that names the file and the reason."""


class Cancelled(Exception):
    """The user asked for the work to stop; raised from inside a progress call."""


def ignore_progress(stage: str, fraction: float) -> None:
    """Report progress to nobody."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh, cleaned: finite positions, indices in range, no triangle of zero area.

    name : what to call it, the file's name without its folder
    origin : float64 (3,), the model space's origin in the file's space
    scale : the file's length of a unit of model space; a power of two, by which no digit is lost
    positions : float32 (V, 3), model space
    faces : int32 (T, 3), counter-clockwise seen from outside
    normals : float32 (V, 3), unit vertex normals; a crease has one vertex per side
    colors : uint8 (V, 4) straight RGBA, or None
    closed : every edge is shared by exactly two faces that run along it in opposite directions
    warnings : what was dropped or repaired, one sentence each
    """

    name: str
    origin: Float64Array
    positions: Float32Array
    faces: Int32Array
    normals: Float32Array
    colors: UInt8Array | None = None
    closed: bool = False
    warnings: tuple[str, ...] = ()
    scale: float = 1.0


@dataclass(frozen=True, eq=False)
class PointCloud:
    """A point cloud, cleaned: finite, no two points at the same place, oriented, with a radius each.

    name, origin, scale, warnings : as in `Mesh`
    positions : float32 (N, 3), model space
    normals : float32 (N, 3), unit, consistently oriented
    radii : float32 (N,), such that discs of these radii cover the sampled surface
    colors : uint8 (N, 4) straight RGBA, or None
    estimated_normals : the file had none
    """

    name: str
    origin: Float64Array
    positions: Float32Array
    normals: Float32Array
    radii: Float32Array
    colors: UInt8Array | None = None
    estimated_normals: bool = False
    warnings: tuple[str, ...] = ()
    scale: float = 1.0


Model = Mesh | PointCloud


class Placed(Protocol):
    """What has a model space of its own: a mesh, a point cloud, a hierarchy."""

    @property
    def origin(self) -> Float64Array: ...

    @property
    def scale(self) -> float: ...


def in_file_space(placed: Placed, points: npt.ArrayLike) -> Float64Array:
    """Return points (..., 3) of model space in the file's own space, float64."""
    return placed.origin + placed.scale * np.asarray(points, np.float64)
