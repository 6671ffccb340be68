"""Read PLY files as people really have them.

Ascii and both byte orders; triangles, polygons and mixtures of them; the `tristrips` element that Cyberware's
scanners wrote; points alone; elements and properties that nobody asked for. Most readers fail on one of these.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hierarchy.model import Float64Array, UInt8Array
from hierarchy.part import (
    AnyArray,
    Int64Array,
    Part,
    UnreadableFile,
    colors_from_channels,
    indices_in_range,
    split_corners,
)
from hierarchy.ply_body import Table, read_body
from hierarchy.ply_header import parse_header

INDEX_NAMES = ("vertex_indices", "vertex_index")
NORMAL_NAMES = (("nx", "ny", "nz"), ("normal_x", "normal_y", "normal_z"))
COLOR_NAMES = (("red", "green", "blue"), ("diffuse_red", "diffuse_green", "diffuse_blue"), ("r", "g", "b"))
COORDINATE_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))


def read_ply(path: Path) -> list[Part]:
    """Read the one mesh or the points of a PLY file. Raises UnreadableFile, OSError."""
    data = path.read_bytes()
    header = parse_header(data)
    tables = read_body(data, header)
    vertices = tables.get("vertex")
    if vertices is None or any(axis not in vertices.columns for axis in "xyz"):
        raise UnreadableFile("the PLY file has no vertices with x, y and z")
    part = Part(
        positions=_stacked([vertices.columns[axis] for axis in "xyz"]),
        normals=_float_columns(vertices, NORMAL_NAMES),
        colors=_colors(vertices),
        texture_coordinates=_float_columns(vertices, COORDINATE_NAMES),
        texture_name=header.texture_name,
    )
    faces, rows, corners = _faces(tables)
    if len(faces) == 0:
        return [part]
    good = indices_in_range(faces, len(part.positions))
    part.bad_faces = int(len(good) - good.sum())
    if part.bad_faces:
        faces, rows, corners = faces[good], rows[good], corners[good]
    part.faces = faces
    return [_with_face_attributes(part, tables.get("face", Table()), rows, corners)]


def _faces(tables: dict[str, Table]) -> tuple[Int64Array, Int64Array, Int64Array]:
    """Return the triangles of polygons and strips, the `face` row of each, and its corners' places in that row's list.

    All three have one row a triangle; row is -1 for a strip's.
    """
    faces = np.empty((0, 3), np.int64)
    rows = np.empty(0, np.int64)
    corners = np.empty((0, 3), np.int64)
    indices = _index_list(tables.get("face"))
    if indices is not None:
        counts, items = indices
        rows, corners = fan_triangles(counts)
        first = np.cumsum(counts) - counts
        faces = items.astype(np.int64)[first[rows][:, None] + corners]
    indices = _index_list(tables.get("tristrips"))
    if indices is not None:
        strips = strip_triangles(*indices)
        faces = np.concatenate([faces, strips])
        rows = np.concatenate([rows, np.full(len(strips), -1)])
        corners = np.concatenate([corners, np.zeros_like(strips)])
    return faces, rows, corners


def _index_list(table: Table | None) -> tuple[Int64Array, AnyArray] | None:
    if table is None:
        return None
    return next((table.lists[name] for name in INDEX_NAMES if name in table.lists), None)


def fan_triangles(counts: Int64Array) -> tuple[Int64Array, Int64Array]:
    """Cut polygons of `counts` (F,) corners into fans around their first corner.

    Returns the polygon of each triangle (T,), and its corners' places in that polygon (T, 3).
    Polygons of less than three corners have no triangle.
    """
    triangles = np.maximum(counts - 2, 0)
    rows = np.repeat(np.arange(len(counts)), triangles)
    step = np.arange(len(rows)) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    return rows, np.stack([np.zeros_like(step), step + 1, step + 2], axis=1)


def strip_triangles(counts: Int64Array, items: AnyArray) -> Int64Array:
    """Return the triangles (T, 3) of strips; a strip ends at an index of -1 and at the end of its row.

    Every second triangle of a strip runs backwards, so that all face the same side. Triangles that repeat an index,
    which only stitch strips together, are left out.
    """
    stop = np.int64(-1)
    strip = items.astype(np.int64)
    if items.dtype.kind == "u":
        strip[items == np.iinfo(items.dtype).max] = stop
    strip = np.insert(strip, np.cumsum(counts), stop)
    if len(strip) < 3:
        return np.empty((0, 3), np.int64)
    place = np.arange(len(strip))
    start = np.maximum.accumulate(np.where(strip == stop, place + 1, 0))
    a, b, c = strip[:-2], strip[1:-1], strip[2:]
    odd = ((place - start)[:-2] & 1).astype(bool)
    triangles = np.stack([a, np.where(odd, c, b), np.where(odd, b, c)], axis=1)
    whole = (a != stop) & (b != stop) & (c != stop) & (a != b) & (b != c) & (c != a)
    return np.compress(whole, triangles, axis=0)


def _with_face_attributes(part: Part, table: Table, rows: Int64Array, corners: Int64Array) -> Part:
    """Move colours and texture coordinates that the file keeps per face or per corner to vertices."""
    assert part.faces is not None
    colors = _colors(table) if part.colors is None else None
    wedges = table.lists.get("texcoord")
    indices = _index_list(table)
    if wedges is not None and (indices is None or (wedges[0] != 2 * indices[0]).any()):
        wedges = None
    if (colors is None and wedges is None) or (rows < 0).any():
        return part
    split = split_corners(part, part.faces)
    if colors is not None:
        split.colors = np.repeat(colors[rows], 3, axis=0)
    if wedges is not None:
        counts, values = wedges
        first = np.cumsum(counts) - counts
        places = first[rows][:, None] + 2 * corners
        split.texture_coordinates = np.stack([values[places.ravel()], values[places.ravel() + 1]], 1).astype(np.float64)
    return split


def _stacked(columns: list[AnyArray]) -> Float64Array:
    return np.stack([column.astype(np.float64) for column in columns], axis=1)


def _float_columns(table: Table, choices: tuple[tuple[str, ...], ...]) -> Float64Array | None:
    for names in choices:
        if all(name in table.columns for name in names):
            return _stacked([table.columns[name] for name in names])
    return None


def _colors(table: Table) -> UInt8Array | None:
    for names in COLOR_NAMES:
        if all(name in table.columns for name in names):
            alpha = [table.columns[name] for name in ("alpha", "diffuse_alpha", "a") if name in table.columns]
            return colors_from_channels([table.columns[name] for name in names] + alpha[:1])
    return None
