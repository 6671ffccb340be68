"""From the parts of a file to a clean mesh or point cloud."""

from __future__ import annotations

import numpy as np

from hierarchy.clean import clean_faces, counted, distinct_corners, has_area, place
from hierarchy.half_edges import is_closed
from hierarchy.mesh_normals import Surface, check_normals, make_normals, weld_equal
from hierarchy.model import Float64Array, Mesh, Progress, UInt8Array, ignore_progress
from hierarchy.part import Part, UnreadableFile
from hierarchy.unique_rows import unique_positions


def join_parts(parts: list[Part]) -> Part:
    """Put parts of one kind, all with faces or all without, into one; textures are left behind.

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
    faces = None
    if parts[0].faces is not None:
        faces = np.concatenate(
            [part.faces + offset for part, offset in zip(parts, offsets[:-1], strict=True) if part.faces is not None]
        )
    positions = np.concatenate([part.positions for part in parts])
    return Part(positions, faces, normals, colors, bad_faces=sum(part.bad_faces for part in parts))


def assemble_mesh(name: str, parts: list[Part], warnings: list[str], progress: Progress = ignore_progress) -> Mesh:
    """Clean the triangles of `parts`, give them normals and find out whether they are closed.

    Vertices at one place are one to the normals and to `closed`, whatever else tells them apart (a seam of the
    texture coordinates does). Raises UnreadableFile where nothing is left.
    """
    part = join_parts(parts)
    assert part.faces is not None
    positions, faces, kept = clean_faces(part.positions, part.faces, part.bad_faces, warnings)
    progress("load", 0.5)
    origin, placed = place(positions)
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
        positions, faces, still_kept = clean_faces(positions, faces[good].astype(np.int64), 0, warnings)
        kept = kept[still_kept]
        origin, placed = place(positions)
        point_of_vertex, first = unique_positions(placed)
    progress("load", 0.7)

    surface = Surface(placed, faces, placed[first], point_of_vertex)
    if closed and surface.signed_volume() < 0.0:
        warnings.append("turned all faces round: the closed surface was inside out")
        surface.turn()
    colors = None if part.colors is None else part.colors[kept]
    if part.normals is not None:
        normals = check_normals(surface, part.normals[kept], closed, warnings)
        positions_out, faces_out, normals, colors = weld_equal(surface.positions, surface.faces, normals, colors)
    else:
        positions_out, faces_out, normals, colors = make_normals(surface, colors)
    progress("load", 1.0)
    return Mesh(name, origin, positions_out, faces_out, normals, colors, closed, tuple(warnings))
