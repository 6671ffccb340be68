"""Models in files for the stress tests of the cache, and what must come out of them."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from pathlib import Path

import numpy as np

from hierarchy.meteoroid import make_meteoroid
from hierarchy.model import Mesh


def write_ply(path: Path, mesh: Mesh, *, turn: bool = False) -> Path:
    """Write a mesh as a binary PLY; turned, it is another model in a file of the same length."""
    positions = mesh.positions[:, [1, 2, 0]] if turn else mesh.positions
    faces = np.empty(len(mesh.faces), [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, mesh.faces
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(positions)}"]
    header += [f"property float {axis}" for axis in "xyz"]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
    path.write_bytes("\n".join(header).encode() + positions.astype("<f4").tobytes() + faces.tobytes())
    return path


def small_model(path: Path, triangles: int = 500, *, turn: bool = False) -> Path:
    """Write a small meteoroid."""
    return write_ply(path, make_meteoroid(triangles), turn=turn)


def same(a: object, b: object) -> bool:
    """Tell whether two hierarchies, or parts of them, are equal to the last bit."""
    if is_dataclass(a):
        return type(a) is type(b) and all(same(getattr(a, f.name), getattr(b, f.name)) for f in fields(a))
    if isinstance(a, np.ndarray):
        return isinstance(b, np.ndarray) and a.dtype == b.dtype and np.array_equal(a, b)
    return a == b
