"""Textures: read an image, and turn it into colours at the vertices.

A surfel carries one colour, so the texture has to live at the vertices. Triangles that span many texels are split
until an edge spans only a few.
"""

from __future__ import annotations

import logging
import os
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

from hierarchy.model import Float32Array, Float64Array, Int32Array, UInt8Array
from hierarchy.part import AnyArray, Int64Array, UnreadableFile
from hierarchy.subdivide import subdivide_edges
from hierarchy.unique_rows import unique_positions

# Texels that an edge may span. Linear interpolation between samples 2.5 texels apart still shows all but the finest
# detail; 1 would cost six times the triangles.
TEXELS_PER_EDGE = 2.5

# Splitting for a texture stops here: a hierarchy of so many leaves takes some seconds to build.
MOST_FACES = 750_000

# All textures of a model together may have so many: 256 MB. An image of a few kilobytes can hold a thousand times that.
MOST_TEXELS = 1 << 26

# What Pillow thinks of an image goes to the standard error where nobody else listens.
logging.getLogger("PIL").addHandler(logging.NullHandler())

# Texels that are converted at once.
BAND = 1 << 22

# What textures come in. Not all that Pillow reads: some kinds are programs that it has another program run.
FORMATS = ("PNG", "JPEG", "TIFF", "BMP", "TGA", "WEBP", "GIF", "JPEG2000", "PPM", "DDS", "SGI", "PCX")

# A model gets so many faces for its textures, however small they are, and two for each of their texels: a texture that
# repeats is worth more, but one that repeats a million times shows nothing, and a million needles take a minute.
FACES_FOR_ANY = 20_000

# What lies on a texture more often than that is worth no more faces.
MOST_COPIES = 16

# Texels along a side of the squares in which a texture is looked at for whether it has more than one colour.
VARIED_BLOCK = 64

# Texels that an edge may span to be split at all. A wall of bricks may repeat a hundred times.
MOST_SPAN = 1 << 16

# Texture coordinates that are larger count as 0: a double does not know their texel any more.
LARGEST_COORDINATE = 1e9

# Edges shorter than this fraction of the model are not split: their middle would fall on an end in float32.
SHORTEST_EDGE = 1e-6


def read_texture(path: Path, most: int = MOST_TEXELS) -> UInt8Array:
    """Read an image file of at most `most` texels as uint8 (H, W, 4) straight RGBA. Raises UnreadableFile."""
    from PIL import Image

    name = path.name
    # Reading a pipe would wait for somebody to write, and a device may never end.
    if path.exists() and not path.is_file():
        raise UnreadableFile(f"the texture {name} is no readable image: it is not a regular file")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with Image.open(path, formats=FORMATS) as image, hushed(image.format == "TIFF"):
                return texels(image, most)
    except FileNotFoundError:
        raise UnreadableFile(f"no such texture: {name}") from None
    except PermissionError:
        raise UnreadableFile(f"no permission to read the texture {name}") from None
    except (UnreadableFile, Image.DecompressionBombError) as error:
        raise UnreadableFile(f"the texture {name} has too many texels") from error
    except Exception as error:
        # Pillow raises a dozen kinds for damaged images.
        raise UnreadableFile(f"the texture {name} is no readable image") from error


@contextmanager
def hushed(is_wanted: bool) -> Iterator[None]:
    """Throw away what C code writes to the standard error within the block: libtiff's words on damaged images."""
    try:
        kept = os.dup(2) if is_wanted else -1
    except OSError:
        # A program without a terminal may have no standard error.
        kept = -1
    if kept < 0:
        yield
        return
    try:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 2)
        os.close(nowhere)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


def texels(image: Any, most: int = MOST_TEXELS) -> UInt8Array:
    """Return a Pillow image as uint8 (H, W, 4) straight RGBA. Raises UnreadableFile where it has more than `most`.

    Pillow raises what it likes where the image is damaged.
    """
    width, height = image.size
    if width * height > most:
        raise UnreadableFile(f"a texture of {width} x {height} texels is too large")
    if width * height == 0:
        raise ValueError("a texture without texels")
    result = np.empty((height, width, 4), np.uint8)
    # In bands, as a large image must not be in memory three times.
    rows = max(1, BAND // max(width, 1))
    for top in range(0, height, rows):
        result[top : top + rows] = _rgba(image.crop((0, top, width, min(top + rows, height))))
    return result


def _rgba(image: Any) -> AnyArray:
    if image.mode.startswith("I"):
        # Pillow clips 16-bit grey instead of scaling it.
        grey = np.clip(np.asarray(image).astype(np.int64) >> 8, 0, 255).astype(np.uint8)
        return np.stack([grey, grey, grey, np.full_like(grey, 255)], axis=2)
    return np.asarray(image.convert("RGBA"))


def sample_bilinear(texture: UInt8Array, coordinates: Float64Array) -> UInt8Array:
    """Sample a texture between its texels' centres.

    texture : uint8 (H, W, 4), row 0 at the top
    coordinates : (N, 2), u to the right and v up, 0..1 over the image. Where one lies outside the image repeats;
        where all are inside it ends at its border, so that opposite borders do not mix. Not finite ones count as 0
    Returns uint8 (N, 4).
    """
    height, width = texture.shape[:2]
    coordinates = np.nan_to_num(coordinates, nan=0.0, posinf=0.0, neginf=0.0)
    repeats = bool(((coordinates < 0.0) | (coordinates > 1.0)).any())
    if repeats:
        coordinates = coordinates - np.floor(coordinates)
    x = coordinates[:, 0] * width - 0.5
    y = (1.0 - coordinates[:, 1]) * height - 0.5
    left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    fx, fy = (x - left)[:, None], (y - top)[:, None]

    def texel(row: Int64Array, column: Int64Array) -> UInt8Array:
        if repeats:
            row, column = row % height, column % width
        else:
            row, column = np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)
        found: UInt8Array = texture[row, column]
        return found

    upper = (1.0 - fx) * texel(top, left) + fx * texel(top, left + 1)
    lower = (1.0 - fx) * texel(top + 1, left) + fx * texel(top + 1, left + 1)
    return np.asarray(np.rint((1.0 - fy) * upper + fy * lower), np.uint8)


def usable_coordinates(coordinates: Float64Array) -> Float64Array:
    """Return texture coordinates (N, 2) with 0 in place of those that are not finite, or too large to mean a texel."""
    return np.where(np.abs(coordinates) <= LARGEST_COORDINATE, coordinates, 0.0)


@njit(cache=True, nogil=True)
def varied_texels(texture: UInt8Array) -> int:
    """Return how many texels lie in blocks that are not of one colour. Nearly all of a large blank image do not."""
    height, width = texture.shape[:2]
    varied = 0
    for top in range(0, height, VARIED_BLOCK):
        for left in range(0, width, VARIED_BLOCK):
            bottom, right = min(top + VARIED_BLOCK, height), min(left + VARIED_BLOCK, width)
            if _is_varied(texture[top:bottom, left:right]):
                varied += (bottom - top) * (right - left)
    return varied


@njit(cache=True, nogil=True)
def _is_varied(block: UInt8Array) -> bool:
    for y in range(block.shape[0]):
        for x in range(block.shape[1]):
            for channel in range(block.shape[2]):
                if block[y, x, channel] != block[0, 0, channel]:
                    return True
    return False


def _faces_for(textures: Sequence[UInt8Array], varied: Sequence[int], copies: Sequence[int]) -> int:
    """Return how many faces a model may be split into for its textures, of which so many texels are varied."""
    # What is a strip makes needles; a square of four times its width is enough for them.
    worth: int = sum(
        min(count, MOST_COPIES) * min(v, 16 * int(min(t.shape[:2])) ** 2)
        for v, t, count in zip(varied, textures, copies, strict=True)
    )
    return min(MOST_FACES, FACES_FOR_ANY + 2 * worth)


def paint(
    positions: Float32Array,
    faces: Int32Array,
    normals: Float32Array,
    colors: UInt8Array | None,
    textures: Sequence[UInt8Array],
    texture_of_vertex: Int32Array,
    texels: Float64Array,
    *,
    copies: Sequence[int] | None = None,
) -> tuple[Float32Array, Int32Array, Float32Array, UInt8Array]:
    """Put textures into vertex colours, splitting triangles until an edge spans at most `TEXELS_PER_EDGE` texels.

    positions, normals : float32 (V, 3); faces : int32 (T, 3)
    colors : uint8 (V, 4) of the vertices without a texture; None is white
    texture_of_vertex : int32 (V,), the number of a texture, one for all corners of a face, or -1
    texels : float64 (V, 2), texture coordinates times the texture's width and height
    copies : how often the mesh holds what lies on each texture; None: once
    Returns positions, faces, normals and colours of a mesh of at most `MOST_FACES` faces, or as many as it had.
    """
    shortest = SHORTEST_EDGE * float(np.abs(positions).max())
    # A texture of one colour needs no splitting; the last is for no texture.
    varied = [varied_texels(texture) for texture in textures]
    is_varied = np.array([*varied, 0]) > 0

    def excess(positions: AnyArray, attributes: Sequence[AnyArray], ends: Int32Array) -> AnyArray:
        a, b = ends.T
        span = np.linalg.norm(attributes[1][a] - attributes[1][b], axis=1)
        length = np.abs(positions[a] - positions[b]).max(axis=1)
        is_worth_it = (length > shortest) & (span <= MOST_SPAN) & is_varied[attributes[3][a]]
        return np.where(is_worth_it, span / TEXELS_PER_EDGE, 0.0)

    points, _ = unique_positions(positions)
    if colors is None:
        colors = np.full((len(positions), 4), 255, np.uint8)
    split = subdivide_edges(
        positions,
        faces,
        [normals, texels, colors, texture_of_vertex],
        excess,
        most_faces=max(_faces_for(textures, varied, copies or [1] * len(textures)), len(faces)),
        points=points,
    )
    normals, texels, colors, texture_of_vertex = split.attributes
    # The middle of two opposite normals has none: keep it finite, along z.
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(lengths > 1e-6, normals / np.maximum(lengths, 1e-6), np.array([0.0, 0.0, 1.0]))
    order = np.argsort(texture_of_vertex, kind="stable")
    ends = np.searchsorted(texture_of_vertex[order], np.arange(len(textures) + 1))
    for number, texture in enumerate(textures):
        painted = order[ends[number] : ends[number + 1]]
        colors[painted] = sample_bilinear(texture, texels[painted] / (texture.shape[1], texture.shape[0]))
    return split.positions, split.faces, normals.astype(np.float32), colors
