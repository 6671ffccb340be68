"""What the readers hand on: the parts of a file as they stand in it, not yet cleaned."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from hierarchy.model import BoolArray, Float64Array, UInt8Array

Int64Array = npt.NDArray[np.int64]
AnyArray = npt.NDArray[Any]


class UnreadableFile(Exception):
    """A reader gives up. The message is the reason, in one line and without the file's name."""


@dataclass(eq=False)
class Part:
    """One mesh or one set of points of a file; any value may be wrong, only the shapes agree.

    positions : float64 (V, 3), the file's own space
    faces : int64 (T, 3), or None for points
    normals : float64 (V, 3), or None
    colors : uint8 (V, 4) straight RGBA, or None
    texture_coordinates : float64 (V, 2), v up, or None
    texture : uint8 (H, W, 4) straight RGBA, row 0 at the top, or None
    texture_name : the texture's file as the model names it, not yet read, or None
    material_color : RGBA 0 to 255 where neither `colors` nor a texture says otherwise, or None
    bad_faces : faces that the reader had to leave out because an index was out of range
    copies : how often the part holds what the file has once (a scene may place one mesh many times)
    """

    positions: Float64Array
    faces: Int64Array | None = None
    normals: Float64Array | None = None
    colors: UInt8Array | None = None
    texture_coordinates: Float64Array | None = None
    texture: UInt8Array | None = None
    texture_name: str | None = None
    material_color: tuple[int, int, int, int] | None = None
    bad_faces: int = 0
    copies: int = 1


def indices_in_range(faces: Int64Array, vertices: int) -> BoolArray:
    """Return for each of `faces` (T, 3) whether all its indices are in 0 .. vertices - 1."""
    # As unsigned numbers the negative ones are too big, so that one comparison does.
    in_range: BoolArray = np.all(faces.view(np.uint64) < np.uint64(vertices), axis=1)
    return in_range


def split_corners(part: Part, faces: Int64Array) -> Part:
    """Give every corner of `faces` (T, 3), all in range, a vertex of its own, so that faces can carry attributes."""
    corners = faces.ravel()
    return replace(
        part,
        positions=part.positions[corners],
        faces=np.arange(len(corners), dtype=np.int64).reshape(-1, 3),
        normals=None if part.normals is None else part.normals[corners],
        colors=None if part.colors is None else part.colors[corners],
        texture_coordinates=None if part.texture_coordinates is None else part.texture_coordinates[corners],
    )


def colors_from_channels(channels: list[AnyArray]) -> UInt8Array:
    """Return uint8 (V, 4) RGBA from three or four channels (V,); a missing alpha is opaque.

    Integer channels are 8-bit, or 16-bit where a value exceeds 255; floats run to 1, or to 255 where one exceeds 1.
    Values that are not finite count as 0.
    """
    values = np.stack([np.nan_to_num(c.astype(np.float64), nan=0.0, posinf=0.0, neginf=0.0) for c in channels], axis=1)
    top = float(values.max(initial=0.0))
    if np.issubdtype(channels[0].dtype, np.floating) and top <= 1.0:
        scale = 255.0
    else:
        scale = 1.0 if top <= 255.0 else 255.0 / 65535.0
    colors = np.full((len(values), 4), 255, np.uint8)
    colors[:, : values.shape[1]] = np.clip(np.rint(values * scale), 0, 255).astype(np.uint8)
    return colors
