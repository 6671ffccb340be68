"""Read OBJ files: polygons of any size, colours behind the positions, normals, texture coordinates and materials."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from hierarchy.model import BoolArray, Float64Array
from hierarchy.obj_materials import Material, read_materials
from hierarchy.part import AnyArray, Int64Array, Part, UnreadableFile, colors_from_channels
from hierarchy.ply import fan_triangles
from hierarchy.unique_rows import unique_rows

# How many numbers a line of each kind has at least.
LEAST_NUMBERS = {b"v": 3, b"vn": 3, b"vt": 1, b"f": 3}


def read_obj(path: Path, warnings: list[str]) -> list[Part]:
    """Read the faces of an OBJ file, one part per material, or its points where it has no faces.

    warnings : gets a sentence for each material file that is missing
    Raises UnreadableFile where it has neither, OSError.
    """
    from hierarchy.obj_scan import count_lines, scan_lines

    data = path.read_bytes().replace(b"\\\r\n", b" ").replace(b"\\\n", b" ")
    if _is_cut_off(data):
        raise UnreadableFile("truncated: its last line is cut off")
    text = np.frombuffer(data, np.uint8)
    vertices, coordinates, normals, counts, starts, corners = scan_lines(text, count_lines(text))
    if len(vertices) == 0:
        raise UnreadableFile("nothing to draw: it has no line that starts with 'v'")
    colors = None
    if np.isfinite(vertices[:, 3:]).all():
        colors = colors_from_channels([np.ascontiguousarray(channel) for channel in vertices[:, 3:].T])
    points = Part(np.ascontiguousarray(vertices[:, :3]), colors=colors)
    rows, places = fan_triangles(counts)
    if len(rows) == 0:
        if len(normals) == len(vertices):
            points.normals = normals
        return [points]
    triangles = corners[(np.cumsum(counts) - counts)[rows][:, None] + places]
    whole = ((triangles[:, :, 0] >= 0) & (triangles[:, :, 0] < len(vertices))).all(axis=1)
    triangles, starts = triangles[whole], starts[rows[whole]]

    parts = []
    for material, chosen in _by_material(path, data, starts, warnings):
        part = _part(points, coordinates, normals, triangles[chosen])
        part.texture_name, part.material_color = material.texture_name, material.color
        parts.append(part)
    if not parts:
        points.faces = np.empty((0, 3), np.int64)
        parts = [points]
    parts[0].bad_faces = int(len(whole) - whole.sum())
    return parts


def _is_cut_off(data: bytes) -> bool:
    """Tell whether the last line has no end, and too few numbers or half a number for what it starts with."""
    last = data[data.rfind(b"\n") + 1 :].split()
    if not last or last[0] not in LEAST_NUMBERS:
        return False
    try:
        # Of a face's corner the first of three numbers is enough.
        numbers = [float(word.split(b"/")[0]) for word in last[1:]]
    except ValueError:
        return True
    return len(numbers) < LEAST_NUMBERS[last[0]]


def _by_material(path: Path, data: bytes, starts: Int64Array, warnings: list[str]) -> list[tuple[Material, AnyArray]]:
    """Return each material in use and the triangles (indices) that have it, by the bytes where their lines start."""
    uses = [
        (m.start(), m[1].decode("utf-8", "replace").strip()) for m in re.finditer(rb"(?m)^\s*usemtl[ \t]+(.*)$", data)
    ]
    if not uses or len(starts) == 0:
        return [(Material(), np.arange(len(starts)))] if len(starts) else []
    materials: dict[str, Material] = {}
    for match in re.finditer(rb"(?m)^\s*mtllib[ \t]+(.*)$", data):
        name = match[1].decode("utf-8", "replace").strip()
        try:
            materials |= read_materials(path.parent, name)
        except OSError:
            warnings.append(f"the material file {name} is not in the model's folder")
    names = [""] + [name for _, name in uses]
    section = np.searchsorted([start for start, _ in uses], starts, side="right")
    distinct = {materials.get(name, Material()) for name in names}
    numbered = list(distinct)
    number = np.array([numbered.index(materials.get(name, Material())) for name in names])[section]
    return [(numbered[k], np.flatnonzero(number == k)) for k in np.unique(number)]


def _part(points: Part, coordinates: Float64Array, normals: Float64Array, triangles: Int64Array) -> Part:
    """Make vertices of the distinct corners of `triangles` (T, 3, 3): vertex, texture coordinate and normal."""
    corners = triangles.reshape(-1, 3)
    with_coordinates = bool(_present(corners[:, 1], len(coordinates)).any())
    with_normals = bool(_present(corners[:, 2], len(normals)).any())
    used = np.zeros_like(corners)
    used[:, 0] = corners[:, 0]
    # A corner without one takes the one that is added at the end.
    if with_coordinates:
        used[:, 1] = np.where(_present(corners[:, 1], len(coordinates)), corners[:, 1], len(coordinates))
        coordinates = np.concatenate([coordinates, np.zeros((1, 2))])
    if with_normals:
        used[:, 2] = np.where(_present(corners[:, 2], len(normals)), corners[:, 2], len(normals))
        normals = np.concatenate([normals, np.full((1, 3), np.nan)])
    inverse, first = unique_rows(used.astype(np.uint32))
    vertex, coordinate, normal = used[first].T
    return Part(
        positions=points.positions[vertex],
        faces=inverse.reshape(-1, 3).astype(np.int64),
        normals=normals[normal] if with_normals else None,
        colors=None if points.colors is None else points.colors[vertex],
        texture_coordinates=coordinates[coordinate] if with_coordinates else None,
    )


def _present(indices: Int64Array, count: int) -> BoolArray:
    """Return for each of `indices` whether it is in 0 .. count - 1."""
    return (indices >= 0) & (indices < count)
