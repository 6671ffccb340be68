"""From the parts of a file to a clean mesh."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hierarchy.clean import clean_faces, counted, distinct_corners, has_area, place
from hierarchy.half_edges import is_closed
from hierarchy.mesh_normals import Surface, check_normals, make_normals
from hierarchy.model import Float64Array, Int32Array, Mesh, Progress, UInt8Array, ignore_progress
from hierarchy.part import AnyArray, Int64Array, Part, UnreadableFile
from hierarchy.sides import signed_volume
from hierarchy.texture import paint
from hierarchy.unique_rows import unique_positions


def join_parts(parts: list[Part]) -> Part:
    """Put parts of one kind, all with faces or all without, into one; their textures are left out.

    A part without colours becomes white where another has some; one without normals gets NaN, to be recomputed.
    """
    if len(parts) == 1:
        return parts[0]
    offsets = np.cumsum([0] + [len(part.positions) for part in parts])
    normals: Float64Array | None = None
    if any(part.normals is not None for part in parts):
        normals = np.concatenate([np.full_like(p.positions, np.nan) if p.normals is None else p.normals for p in parts])
    colors: UInt8Array | None = None
    if any(part.colors is not None for part in parts):
        white = [np.full((len(p.positions), 4), 255, np.uint8) if p.colors is None else p.colors for p in parts]
        colors = np.concatenate(white)
    faces: Int64Array | None = None
    if parts[0].faces is not None:
        # An index out of range must not reach into the next part.
        moved = []
        for part, offset in zip(parts, offsets[:-1], strict=True):
            assert part.faces is not None
            outside = (part.faces < 0) | (part.faces >= len(part.positions))
            moved.append(np.where(outside, -1, part.faces + offset))
        faces = np.concatenate(moved)
    positions = np.concatenate([part.positions for part in parts])
    return Part(positions, faces, normals, colors, bad_faces=sum(part.bad_faces for part in parts))


@dataclass(eq=False)
class Skin:
    """The textures of a model's parts, and where each vertex of all parts together lies on one.

    textures : uint8 (H, W, 4) each
    copies : how often the model holds what lies on each
    texture_of_vertex : int32 (V,), -1 for none
    texels : float64 (V, 2), texture coordinates times the texture's width and height
    """

    textures: list[UInt8Array] = field(default_factory=list)
    copies: list[int] = field(default_factory=list)
    texture_of_vertex: Int32Array = field(default_factory=lambda: np.empty(0, np.int32))
    texels: Float64Array = field(default_factory=lambda: np.empty((0, 2)))


def gather_skin(parts: list[Part]) -> Skin | None:
    """Collect the textures of `parts`, or return None where none has both a texture and coordinates."""
    skin = Skin()
    known: dict[int, int] = {}
    numbers, texels = [], []
    for part in parts:
        number, place_on_it = -1, np.zeros((len(part.positions), 2))
        if part.texture is not None and part.texture_coordinates is not None:
            number = known.setdefault(id(part.texture), len(skin.textures))
            if number == len(skin.textures):
                skin.textures.append(part.texture)
                skin.copies.append(1)
            skin.copies[number] = max(skin.copies[number], part.copies)
            height, width = part.texture.shape[:2]
            coordinates = np.nan_to_num(part.texture_coordinates, nan=0.0, posinf=0.0, neginf=0.0)
            place_on_it = coordinates * (width, height)
        numbers.append(np.full(len(part.positions), number, np.int32))
        texels.append(place_on_it)
    if not skin.textures:
        return None
    skin.texture_of_vertex = np.concatenate(numbers)
    skin.texels = np.concatenate(texels)
    return skin


def assemble_mesh(name: str, parts: list[Part], warnings: list[str], progress: Progress = ignore_progress) -> Mesh:
    """Clean the triangles of `parts`, give them normals, find out whether they are closed, and paint them.

    Vertices at one place are one to the normals and to `closed`, whatever else tells them apart (a seam of the
    texture coordinates does). Raises UnreadableFile where nothing is left.
    """
    skin = gather_skin(parts)
    part = join_parts(parts)
    assert part.faces is not None
    positions, faces, kept = clean_faces(part.positions, part.faces, part.bad_faces, warnings)
    origin, scale, placed = place(positions)
    point_of_vertex, first = unique_positions(placed)
    point_faces = point_of_vertex[faces]
    distinct = distinct_corners(point_faces)
    # A triangle whose corners lie on one line takes no part in the picture but holds its neighbours together.
    closed = is_closed(point_faces[distinct], len(first))
    good = distinct & has_area(placed, faces)
    if not good.all():
        warnings.append(counted("dropped", int(len(good) - good.sum()), "degenerate face"))
        if not good.any():
            raise UnreadableFile("nothing to draw: no face has an area")
        # Start again with what is left, as the bounding box may have shrunk.
        positions, faces, still_kept = clean_faces(positions, faces[good].astype(np.int64), 0, warnings)
        kept = kept[still_kept]
        origin, scale, placed = place(positions)
        point_of_vertex, first = unique_positions(placed)
    progress("load", 0.6)

    surface = Surface(placed, faces, placed[first], point_of_vertex)
    if closed and signed_volume(surface.positions, surface.faces) < 0.0:
        warnings.append("turned all faces round: the closed surface was inside out")
        surface.turn()
    attributes: list[AnyArray] = [] if part.colors is None else [part.colors[kept]]
    if skin is not None:
        attributes += [skin.texture_of_vertex[kept], skin.texels[kept]]
    if part.normals is not None:
        normals = check_normals(surface, part.normals[kept], closed, warnings)
        placed, faces = surface.positions, surface.faces
    else:
        placed, faces, normals, attributes = make_normals(surface, attributes)
    progress("load", 0.8)
    colors = None if part.colors is None else attributes[0]
    if skin is not None:
        placed, faces, normals, colors = paint(
            placed, faces, normals, colors, skin.textures, attributes[-2], attributes[-1], copies=skin.copies
        )
    progress("load", 1.0)
    return Mesh(name, origin, placed, faces, normals, colors, closed, tuple(warnings), scale)
