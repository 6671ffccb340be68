"""Read OBJ files: polygons of any size, colours behind the positions, normals, texture coordinates and materials."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from hierarchy.model import BoolArray, Float64Array
from hierarchy.obj_materials import Material, read_materials
from hierarchy.part import AnyArray, Int64Array, Part, UnreadableFile, colors_from_channels
from hierarchy.plain_text import plain_line
from hierarchy.ply import fan_triangles
from hierarchy.unique_rows import unique_rows

# Each material is a part, and takes a millisecond.
MOST_MATERIALS = 4096

# Exporters write one.
MOST_MATERIAL_FILES = 16

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
    # A corner without one takes the one that is added at the end.
    coordinates = np.concatenate([coordinates, np.zeros((1, 2))])
    normals = np.concatenate([normals, np.full((1, 3), np.nan)])
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
    uses = [(m.start(), _name(m[1])) for m in re.finditer(rb"(?m)^[ \t]*usemtl[ \t]+([^\r\n]*)", data)]
    if not uses or len(starts) == 0:
        return [(Material(), np.arange(len(starts)))] if len(starts) else []
    materials = _read_material_files(path, data, warnings)
    # Materials that say the same are one; those beyond the most say nothing.
    numbers = {Material(): 0}
    number_of_use = [0]
    left_out = False
    for _, name in uses:
        material = materials.get(name, Material())
        if len(numbers) < MOST_MATERIALS:
            numbers.setdefault(material, len(numbers))
        number_of_use.append(numbers.get(material, 0))
        left_out |= material not in numbers
    if left_out:
        warnings.append(f"of the materials only {MOST_MATERIALS - 1} are used")
    number = np.array(number_of_use)[np.searchsorted([start for start, _ in uses], starts, side="right")]
    order = np.argsort(number, kind="stable")
    ends = np.cumsum(np.bincount(number, minlength=len(numbers)))
    chosen = np.split(order, ends[:-1])
    return [(material, chosen[k]) for material, k in numbers.items() if len(chosen[k])]


def _read_material_files(path: Path, data: bytes, warnings: list[str]) -> dict[str, Material]:
    """Read each material file that the OBJ names, once."""
    names = dict.fromkeys(_name(m[1]) for m in re.finditer(rb"(?m)^[ \t]*mtllib[ \t]+([^\r\n]*)", data))
    materials: dict[str, Material] = {}
    for name in list(names)[:MOST_MATERIAL_FILES]:
        try:
            materials |= read_materials(path.parent, name)
        except OSError:
            warnings.append(f"the material file {plain_line(name)} is not in the model's folder")
        except UnreadableFile as error:
            warnings.append(f"the material file {plain_line(name)} is {error}")
    if len(names) > MOST_MATERIAL_FILES:
        warnings.append(f"of {len(names)} material files only {MOST_MATERIAL_FILES} are read")
    return materials


def _name(raw: bytes) -> str:
    return raw.decode("utf-8", "replace").strip()


def _part(points: Part, coordinates: Float64Array, normals: Float64Array, triangles: Int64Array) -> Part:
    """Make vertices of the distinct corners of `triangles` (T, 3, 3): vertex, texture coordinate and normal.

    The last of `coordinates` and of `normals` is for corners that have none.
    """
    corners = triangles.reshape(-1, 3)
    no_coordinate, no_normal = len(coordinates) - 1, len(normals) - 1
    has_coordinate, has_normal = _present(corners[:, 1], no_coordinate), _present(corners[:, 2], no_normal)
    with_coordinates, with_normals = bool(has_coordinate.any()), bool(has_normal.any())
    used = np.zeros_like(corners)
    used[:, 0] = corners[:, 0]
    if with_coordinates:
        used[:, 1] = np.where(has_coordinate, corners[:, 1], no_coordinate)
    if with_normals:
        used[:, 2] = np.where(has_normal, corners[:, 2], no_normal)
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
