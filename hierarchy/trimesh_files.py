"""Read what trimesh reads: OFF, glTF, 3MF, COLLADA and more, with the scene's transforms applied.

Small files of these kinds may ask for any time and memory (archives, references in circles, images that unpack), so
`read_with_trimesh` is for the child process of `contained.py`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hierarchy.model import Float64Array, UInt8Array
from hierarchy.part import AnyArray, Part, UnreadableFile, indices_in_range, split_corners
from hierarchy.references import inside_folder
from hierarchy.texture import texels
from hierarchy.unpacking import check_unpacked

# What trimesh gives a material that the file does not define.
DEFAULT_GREY = (102, 102, 102, 255)


def trimesh_reads(kind: str) -> bool:
    """Tell whether trimesh has a reader for a suffix (lower case, no dot)."""
    import trimesh

    return kind in trimesh.available_formats()


def read_with_trimesh(path: Path, kind: str, warnings: list[str]) -> list[Part]:
    """Read every mesh and point cloud of a file.

    warnings : gets a sentence for each file that the model refers to, does without, and is missing
    Raises UnreadableFile, OSError and whatever trimesh raises.
    """
    import trimesh

    size = path.stat().st_size
    with path.open("rb") as stream:
        scene = trimesh.load_scene(stream, file_type=kind, resolver=_folder_resolver(path, warnings), process=False)
    parts, elements = [], 0
    for geometry, transforms in _placed_geometries(scene):
        # Before it is copied: a scene may place one geometry any number of times.
        elements += len(transforms) * len(getattr(geometry, "faces", getattr(geometry, "vertices", ())))
        check_unpacked(elements, size)
        if isinstance(geometry, trimesh.Trimesh):
            parts.append(_placed(mesh_part(geometry), transforms))
        elif isinstance(geometry, trimesh.PointCloud):
            parts.append(_placed(_points_part(geometry), transforms))
    if not parts:
        raise UnreadableFile("nothing to draw: it holds neither faces nor points")
    return parts


def _folder_resolver(path: Path, warnings: list[str]) -> Any:
    """Return what trimesh asks for the files that a model refers to: those of the model's own folder."""
    from trimesh.resolvers import Resolver

    class FolderResolver(Resolver):
        def __init__(self, folder: Path) -> None:
            self.folder = folder

        def get(self, name: str) -> bytes:
            try:
                return inside_folder(self.folder, name).read_bytes()
            except OSError:
                # trimesh goes on without an image, but not without a buffer.
                warnings.append(f"the file {name} is not in the model's folder")
                raise UnreadableFile(f"the file {name}, which it refers to, is not in its folder") from None

        def keys(self) -> Iterator[str]:
            return iter(())

        def write(self, name: str, data: Any) -> None:
            raise PermissionError(name)

        def namespaced(self, namespace: str) -> FolderResolver:
            return FolderResolver(self.folder / namespace)

    return FolderResolver(path.parent)


def _placed_geometries(scene: Any) -> Iterator[tuple[Any, Float64Array]]:
    """Yield every geometry that is placed somewhere, and the transforms of its nodes, float64 (N, 4, 4)."""
    transforms: dict[str, list[Any]] = {}
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        transforms.setdefault(name, []).append(transform)
    for name, placed in transforms.items():
        yield scene.geometry[name], np.array(placed, np.float64)


def mesh_part(mesh: Any) -> Part:
    """Take what a `trimesh.Trimesh` holds: its triangles, the file's normals if any, and its colours or material."""
    part = Part(np.array(mesh.vertices, np.float64), np.array(mesh.faces, np.int64).reshape(-1, 3))
    # The property would make normals where the file has none.
    if "vertex_normals" in mesh._cache.cache:
        part.normals = np.array(mesh.vertex_normals, np.float64)
    visual = mesh.visual
    kind = visual.kind
    if kind == "vertex":
        part.colors = np.array(visual.vertex_colors, np.uint8)
    elif kind == "face":
        return _with_face_colors(part, np.asarray(visual.face_colors, np.uint8))
    elif kind == "texture":
        _take_material(part, visual)
    return part


def _with_face_colors(part: Part, colors: UInt8Array) -> Part:
    assert part.faces is not None
    good = indices_in_range(part.faces, len(part.positions))
    split = split_corners(part, part.faces[good])
    split.bad_faces = int(len(good) - good.sum())
    split.colors = np.repeat(colors[good], 3, axis=0)
    return split


def _take_material(part: Part, visual: Any) -> None:
    """Take a material's image and coordinates, or its one colour where it has no image."""
    coordinates = visual.uv
    if coordinates is not None and np.shape(coordinates) == (len(part.positions), 2):
        part.texture_coordinates = np.array(coordinates, np.float64)
    material = visual.material
    image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    color = getattr(material, "baseColorFactor", None)
    if color is None:
        color = getattr(material, "diffuse", None)
    factor = None if color is None else _color(color)
    if image is not None and part.texture_coordinates is not None:
        part.texture = texels(image)
        if hasattr(material, "baseColorFactor") and factor is not None:
            # A table for each channel, not products for each texel, which would take 8 bytes each.
            products = np.rint(np.arange(256)[:, None] * (factor / 255.0)).astype(np.uint8)
            part.texture = np.stack([products[part.texture[..., i], i] for i in range(4)], axis=2)
    elif factor is not None and tuple(factor) != DEFAULT_GREY:
        red, green, blue, alpha = (int(value) for value in factor)
        part.material_color = red, green, blue, alpha


def _color(values: Any) -> UInt8Array:
    """Return uint8 (4,) from what a material calls a colour: three or four numbers to 1 or to 255."""
    values = np.asarray(values)
    if np.issubdtype(values.dtype, np.floating):
        values = np.rint(np.clip(values, 0.0, 1.0) * 255.0)
    color = np.full(4, 255, np.uint8)
    color[: len(values)] = np.clip(values, 0, 255)[:4]
    return color


def _points_part(cloud: Any) -> Part:
    part = Part(np.array(cloud.vertices, np.float64).reshape(-1, 3))
    colors = getattr(cloud, "colors", None)
    if colors is not None and np.shape(colors) == (len(part.positions), 4):
        part.colors = np.array(colors, np.uint8)
    return part


def _placed(part: Part, transforms: Float64Array) -> Part:
    """Return a part once for each of `transforms` (N, 4, 4), all in one; one that mirrors turns the faces round."""
    count, vertices = len(transforms), len(part.positions)
    if count == 1 and np.array_equal(transforms[0], np.eye(4)):
        return part
    linear = transforms[:, :3, :3]
    positions = part.positions @ linear.transpose(0, 2, 1) + transforms[:, None, :3, 3]
    mirrored = np.linalg.det(linear) < 0.0
    normals, faces = None, None
    if part.normals is not None:
        # The cofactor matrix is the inverse transpose times the determinant, and exists for flat transforms too.
        cofactors = np.stack([np.cross(linear[:, (i + 1) % 3], linear[:, (i + 2) % 3]) for i in range(3)], axis=1)
        cofactors[mirrored] *= -1.0
        normals = (part.normals @ cofactors.transpose(0, 2, 1)).reshape(-1, 3)
    if part.faces is not None:
        # An index out of range stays out of range, and does not reach another copy's vertices.
        in_range = indices_in_range(part.faces, vertices)
        bad_faces = count * int(len(in_range) - in_range.sum())
        copies = part.faces[in_range] + vertices * np.arange(count, dtype=np.int64)[:, None, None]
        copies[mirrored] = copies[mirrored][:, :, ::-1]
        part = replace(part, bad_faces=count * part.bad_faces + bad_faces)
        faces = copies.reshape(-1, 3)
    return replace(
        part,
        copies=count,
        positions=positions.reshape(-1, 3),
        faces=faces,
        normals=normals,
        colors=_repeated(part.colors, count),
        texture_coordinates=_repeated(part.texture_coordinates, count),
    )


def _repeated(values: AnyArray | None, count: int) -> AnyArray | None:
    return None if values is None else np.tile(values, (count, 1))
