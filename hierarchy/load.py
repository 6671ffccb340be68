"""Load a model: from a file on disk to a clean `Mesh` or `PointCloud`, or one clear line why not."""

from __future__ import annotations

from pathlib import Path

from hierarchy.model import Cancelled, Mesh, Model, ModelError, PointCloud, Progress, ignore_progress
from hierarchy.part import Part, UnreadableFile

# What a file starts with says more than what it is called.
SIGNATURES = ((b"ply", "ply"), (b"LASF", "las"), (b"glTF", "glb"))

LAS_SUFFIXES = ("las", "laz")
TEXT_SUFFIXES = ("xyz", "pts", "txt", "asc", "csv", "xyzrgb", "xyzn")


def load_model(
    path: str | Path, *, texture: str | Path | None = None, progress: Progress = ignore_progress
) -> Mesh | PointCloud:
    """Load a mesh or a point cloud.

    path : a file of any kind that trimesh reads, a PLY, LAS, LAZ, or points as text
    texture : an image for the model's texture coordinates, in place of the one that the model names
    progress : called with the stage "load" or "normals"
    Raises ModelError, one line "NAME: reason", where there is nothing that can be drawn; Cancelled from `progress`.
    """
    path = Path(path)
    name = path.name or str(path)
    try:
        progress("load", 0.0)
        kind = file_kind(path)
        parts = read_parts(path, kind)
        progress("load", 0.3)
        return _assemble(name, path, parts, texture, progress)
    except UnreadableFile as reason:
        raise ModelError(_one_line(f"{name}: {reason}")) from None
    except (ModelError, Cancelled):
        raise
    except FileNotFoundError:
        raise ModelError(_one_line(f"{name}: no such file")) from None
    except PermissionError:
        raise ModelError(_one_line(f"{name}: no permission to read it")) from None
    except OSError as error:
        raise ModelError(_one_line(f"{name}: cannot be read: {error.strerror or error}")) from None
    except MemoryError:
        raise ModelError(_one_line(f"{name}: not enough memory to load it")) from None


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


def read_parts(path: Path, kind: str) -> list[Part]:
    """Read the parts of a file of a known kind. Raises UnreadableFile, OSError."""
    if kind == "ply":
        from hierarchy.ply import read_ply

        return read_ply(path)
    raise UnreadableFile(f"unknown kind of file ({path.suffix or 'no suffix'})")


def _assemble(name: str, path: Path, parts: list[Part], texture: str | Path | None, progress: Progress) -> Model:
    """Make one model of the parts: a mesh where any has faces, else a cloud."""
    from hierarchy.assemble import assemble_mesh

    warnings: list[str] = []
    meshes = [part for part in parts if part.faces is not None]
    if meshes:
        return assemble_mesh(name, meshes, warnings, progress)
    raise UnreadableFile("nothing to draw: it holds neither faces nor points")


def _one_line(message: str) -> str:
    return " ".join(message.split())
