"""Load a model: from a file on disk to a clean `Mesh` or `PointCloud`, or one clear line why not."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hierarchy.model import Cancelled, Mesh, Model, ModelError, PointCloud, Progress, UInt8Array, ignore_progress
from hierarchy.part import Part, UnreadableFile
from hierarchy.plain_text import plain_line

# What a file starts with says more than what it is called.
SIGNATURES = ((b"ply", "ply"), (b"LASF", "las"), (b"glTF", "glb"), (b"ASTM-E57", "e57"))

LAS_KINDS = ("las", "laz")
TEXT_KINDS = ("xyz", "pts", "txt", "asc", "csv", "xyzrgb", "xyzn")

# A file may refer to thousands of files that are missing; these many warnings say enough.
MOST_WARNINGS = 10

# Letters whose names start with a vowel, and so take "an": an OBJ file.
TAKE_AN = "AEFHILMNORSX"


def load_model(
    path: str | Path, *, texture: str | Path | None = None, progress: Progress = ignore_progress
) -> Mesh | PointCloud:
    """Load a mesh or a point cloud.

    path : a file of any kind that trimesh reads, a PLY, LAS, LAZ, E57, or points as text
    texture : an image for the model's texture coordinates, in place of the one that the model names
    progress : called with the stage "load" or "normals"
    Raises ModelError, one line "NAME: reason", where there is nothing that can be drawn; Cancelled from `progress`.
    """
    path = Path(path)
    name = plain_line(path.name or str(path))
    kind = ""
    warnings: list[str] = []
    try:
        progress("load", 0.0)
        kind = file_kind(path)
        # A file may hold any bits, and some are numbers that signal when they are converted.
        with np.errstate(invalid="ignore", over="ignore"):
            parts = read_parts(path, kind, warnings, progress)
        progress("load", 0.3)
        return _assemble(path, name, parts, texture, warnings, progress)
    except (Cancelled, KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:
        # BaseException, because a panic in Rust code, of which lazrs has some, is no Exception.
        if not isinstance(error, Exception) and type(error).__name__ != "PanicException":
            raise
        raise ModelError(f"{name}: {plain_line(reason(error, kind))}") from error


def file_kind(path: Path) -> str:
    """Return the kind of a file, a suffix in lower case without its dot, by its first bytes or else by its name.

    Raises UnreadableFile where it is a folder, empty or nothing that can be opened as a file; OSError.
    """
    if path.is_dir():
        raise UnreadableFile("is a folder, not a file")
    if path.exists() and not path.is_file():
        raise UnreadableFile("is not a regular file")
    with path.open("rb") as stream:
        start = stream.read(16)
    if not start:
        raise UnreadableFile("the file is empty")
    for signature, kind in SIGNATURES:
        if start.startswith(signature):
            return kind
    return path.suffix[1:].lower()


def read_parts(path: Path, kind: str, warnings: list[str], progress: Progress = ignore_progress) -> list[Part]:
    """Read the parts of a file of a known kind, and warn of files that it refers to and that are missing.

    Raises UnreadableFile, OSError and what the libraries raise.
    """
    if kind == "ply":
        from hierarchy.ply import read_ply

        return read_ply(path)
    if kind == "obj":
        from hierarchy.obj import read_obj

        return read_obj(path, warnings)
    if kind in ("stl", "stl_ascii"):
        from hierarchy.stl import read_stl

        return read_stl(path)
    if kind in LAS_KINDS:
        from hierarchy.las import is_compressed, read_las

        if not is_compressed(path):
            return read_las(path, progress)
    if kind == "e57":
        from hierarchy.e57 import read_e57

        return read_e57(path, warnings, progress)
    if kind in TEXT_KINDS:
        from hierarchy.text_points import read_text_points

        return read_text_points(path)
    # LAZ, and what trimesh reads.
    from hierarchy.contained import read_contained

    return read_contained(path, kind, warnings, progress)


def attach_textures(path: Path, parts: list[Part], texture: str | Path | None, warnings: list[str]) -> None:
    """Give the parts with texture coordinates the image that was asked for, or else the one that they name.

    Raises UnreadableFile where the image that was asked for cannot be read; one that the model names is only missed.
    """
    from hierarchy.references import inside_folder
    from hierarchy.texture import MOST_TEXELS, read_texture, usable_coordinates

    for part in parts:
        if part.texture_coordinates is not None:
            part.texture_coordinates = usable_coordinates(part.texture_coordinates)
    if texture is not None:
        image = read_texture(Path(texture))
        if all(part.texture_coordinates is None for part in parts):
            warnings.append("the texture is not used: the model has no texture coordinates")
        for part in parts:
            part.texture = image
        return
    images: dict[str, UInt8Array | None] = {}
    room = MOST_TEXELS
    for part in parts:
        name = part.texture_name
        if name is None or part.texture_coordinates is None:
            continue
        if name not in images:
            images[name] = None
            try:
                images[name] = image = read_texture(inside_folder(path.parent, name), most=room)
                room -= image.shape[0] * image.shape[1]
            except (UnreadableFile, OSError) as error:
                why = "is not in the model's folder" if isinstance(error, OSError) else "cannot be read"
                warnings.append(f"the texture {plain_line(name)} {why}")
        part.texture = images[name]


def apply_material_colors(parts: list[Part]) -> None:
    """Give the parts that have nothing better the colours of their materials, if those say anything.

    Greys are what exporters write when nobody chose a colour; where no part has more than that, none gets colours.
    """

    def has_more(part: Part) -> bool:
        textured = part.texture is not None and part.texture_coordinates is not None
        return textured or part.colors is not None or len(set((part.material_color or (0, 0, 0, 0))[:3])) > 1

    if any(has_more(part) for part in parts):
        for part in parts:
            if part.colors is None and part.material_color is not None:
                part.colors = np.tile(np.array(part.material_color, np.uint8), (len(part.positions), 1))


def shorten(warnings: list[str]) -> None:
    """Make each warning a plain line, and replace those beyond `MOST_WARNINGS` by their number."""
    beyond = len(warnings) - MOST_WARNINGS
    warnings[:] = [plain_line(warning) for warning in warnings[:MOST_WARNINGS]]
    if beyond > 0:
        warnings.append(f"and {beyond} more like these")


def _assemble(
    path: Path, name: str, parts: list[Part], texture: str | Path | None, warnings: list[str], progress: Progress
) -> Model:
    """Make one model of the parts: a mesh where any has faces, else a cloud."""
    meshes = [part for part in parts if part.faces is not None]
    if meshes:
        from hierarchy.assemble import assemble_mesh

        attach_textures(path, meshes, texture, warnings)
        apply_material_colors(meshes)
        shorten(warnings)
        return assemble_mesh(name, meshes, warnings, progress)
    if texture is not None:
        warnings.append("the texture is not used: the model has no faces")
    from hierarchy.assemble_cloud import assemble_cloud

    shorten(warnings)
    return assemble_cloud(name, parts, warnings, progress)


def reason(error: BaseException, kind: str) -> str:
    """Say in words of the user what went wrong."""
    match error:
        case UnreadableFile():
            return str(error)
        case FileNotFoundError():
            return "no such file"
        case PermissionError():
            return "no permission to read it"
        case MemoryError():
            return "not enough memory to load it"
        case ModuleNotFoundError() if isinstance(error.__context__, UnicodeError):
            # trimesh wants a package that guesses encodings where it meets bytes that are no text.
            return f"{_damaged(kind)} (it holds bytes that are no text)"
        case ModuleNotFoundError():
            return f"reading {kind.upper()} files needs the Python package {error.name}"
        case OSError(strerror=str(text)):
            return f"cannot be read: {text}"
    # What the library says is about its own insides.
    return _damaged(kind)


def _damaged(kind: str) -> str:
    # LAS is said as a word, the others letter by letter.
    article = "an" if kind[:1].upper() in TAKE_AN and kind not in LAS_KINDS else "a"
    return f"damaged, truncated or not {article} {kind.upper()} file"
