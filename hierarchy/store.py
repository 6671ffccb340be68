"""Hierarchies in files that are mapped, not read (tensor_file.py).

Every array goes in as it is in memory, in breadth-first order, so that a prefix of each is a coarse model; numbers and
words go into the metadata. A file is taken for what it is only if its format, which follows from the layout of the
records, is this program's, if every checksum fits, and if the kernels can run on what it holds (soundness.py).
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hierarchy.hierarchy import NODE, SPLAT, Hierarchy
from hierarchy.leaves import Leaves, Surfels, Triangles
from hierarchy.openings import Openings
from hierarchy.soundness import fault_of_hierarchy
from hierarchy.spreads import SCALES
from hierarchy.tensor_file import DamagedFile, map_tensors, read_metadata, write_tensors

# Counts up with every change of what is stored that the records' layout does not show.
VERSION = 1
_LAYOUT = f"{VERSION} {NODE.descr} {SPLAT.descr} {SCALES}"
FORMAT = f"surfelscope {hashlib.sha256(_LAYOUT.encode()).hexdigest()[:16]}"

# Records are stored as rows of floats. The integers of a node are at least 0 and far below 2,139,095,040, so that
# their bits, too, are those of finite floats.
NODE_COLUMNS, SPLAT_COLUMNS = NODE.itemsize // 4, SPLAT.itemsize // 4

Written = Callable[[float], None]


def save_hierarchy(path: Path, hierarchy: Hierarchy, notes: Mapping[str, str], progress: Written) -> int:
    """Write a hierarchy to a file, whole or not at all, and return the file's size in bytes.

    notes : anything that shall come back with it
    progress : called with the fraction written; an exception that it raises ends the work
    Raises ValueError where the hierarchy could not be used again, OSError.
    """
    fault = fault_of_hierarchy(hierarchy)
    if fault:
        raise ValueError(fault)
    leaves, openings = hierarchy.leaves, hierarchy.openings
    tensors: dict[str, np.ndarray | None] = {
        "nodes": hierarchy.nodes.view(np.float32).reshape(-1, NODE_COLUMNS),
        "splats": hierarchy.splats.view(np.float32).reshape(-1, SPLAT_COLUMNS),
        "spreads": hierarchy.spreads,
        "colors": hierarchy.colors,
        **{f"leaves.{name}": array for name, array in vars(leaves).items()},
        **({} if openings is None else {f"openings.{name}": array for name, array in vars(openings).items()}),
    }
    described = {
        "name": hierarchy.name,
        "origin": hierarchy.origin.tolist(),
        "scale": float(hierarchy.scale),
        "closed": bool(hierarchy.closed),
        "radius": float(hierarchy.radius),
        "half_extents": hierarchy.half_extents.tolist(),
        "warnings": list(hierarchy.warnings),
    }
    present = {name: array for name, array in tensors.items() if array is not None}
    metadata = {"format": FORMAT, "hierarchy": json.dumps(described), "notes": json.dumps(dict(notes))}
    return write_tensors(path, present, metadata, progress)


def load_hierarchy(path: Path) -> tuple[Hierarchy, dict[str, str]]:
    """Map what `save_hierarchy` wrote, and return it with the notes. Raises DamagedFile, OSError."""
    tensors, metadata = map_tensors(path)
    described = _described(metadata)
    try:
        hierarchy = Hierarchy(
            name=str(described["name"]),
            origin=np.array(described["origin"], np.float64).reshape(3),
            nodes=_take(tensors, "nodes", np.float32, NODE_COLUMNS).view(NODE).reshape(-1),
            splats=_take(tensors, "splats", np.float32, SPLAT_COLUMNS).view(SPLAT).reshape(-1),
            spreads=_take(tensors, "spreads", np.uint16, SCALES),
            colors=_take(tensors, "colors", np.uint8, 4) if "colors" in tensors else None,
            leaves=_leaves(tensors),
            closed=bool(described["closed"]),
            radius=float(described["radius"]),
            half_extents=np.array(described["half_extents"], np.float64).reshape(3),
            warnings=tuple(str(warning) for warning in described["warnings"]),
            openings=_openings(tensors),
            scale=float(described["scale"]),
        )
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise DamagedFile("it does not describe a hierarchy") from error
    fault = fault_of_hierarchy(hierarchy)
    if fault:
        raise DamagedFile(fault)
    return hierarchy, _notes(metadata)


def read_notes(path: Path) -> dict[str, str]:
    """Return the notes that `save_hierarchy` wrote, without what they belong to. Raises DamagedFile, OSError."""
    metadata = read_metadata(path)
    _described(metadata)
    return _notes(metadata)


def _described(metadata: Mapping[str, str]) -> dict[str, Any]:
    """Return what the metadata says of what is stored. Raises DamagedFile where it is not this program's."""
    if metadata.get("format") != FORMAT:
        raise DamagedFile("it is from another version")
    try:
        described = json.loads(metadata["hierarchy"])
    except (LookupError, ValueError) as error:
        raise DamagedFile("it does not hold a hierarchy") from error
    if not isinstance(described, dict):
        raise DamagedFile("it does not hold a hierarchy")
    return described


def _notes(metadata: Mapping[str, str]) -> dict[str, str]:
    try:
        return {str(name): str(value) for name, value in json.loads(metadata["notes"]).items()}
    except (LookupError, ValueError, AttributeError) as error:
        raise DamagedFile("it has no notes") from error


def _take(tensors: Mapping[str, np.ndarray], name: str, dtype: type[np.generic], *row: int) -> np.ndarray:
    """Return an array whose dtype and whose shape (..., *row) are as they should be."""
    array = tensors[name]
    if array.dtype != dtype or array.shape[1:] != row:
        raise DamagedFile(f"its {name} are of another kind")
    return array


def _leaves(tensors: Mapping[str, np.ndarray]) -> Leaves:
    positions = _take(tensors, "leaves.positions", np.float32, 3)
    normals = _take(tensors, "leaves.normals", np.float32, 3)
    colors = _take(tensors, "leaves.colors", np.uint8, 4) if "leaves.colors" in tensors else None
    if "leaves.indices" in tensors:
        return Triangles(positions, normals, _take(tensors, "leaves.indices", np.int32, 3), colors)
    return Surfels(positions, normals, _take(tensors, "leaves.radii", np.float32), colors)


def _openings(tensors: Mapping[str, np.ndarray]) -> Openings | None:
    if "openings.caps" not in tensors:
        return None
    before = _take(tensors, "openings.bare_before", np.int32)
    return Openings(_take(tensors, "openings.caps", np.float32, 3, 3), before)
