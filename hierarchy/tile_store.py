"""The tiles of a picture in a file that is mapped, not read (tensor_file.py), checked as hierarchies are (store.py).

What the tiles are depends on the code that bakes and fits them, too: that is part of the name of the hierarchy, which
the file holds.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hierarchy.hierarchy import Hierarchy
from hierarchy.normal_tiles import FittedTiles
from hierarchy.tensor_file import DamagedFile, map_tensors, write_tensors
from hierarchy.tile_shelf import ShownTiles
from hierarchy.tile_sizes import sides_of

# Counts up with every change of what is stored.
VERSION = 1
FORMAT = f"surfelscope tiles {VERSION}"


def save_tiles(path: Path, shown: ShownTiles, hierarchy: Hierarchy, entry: str) -> int:
    """Write tiles to a file, whole or not at all, and return the file's size in bytes.

    hierarchy, entry : whose tiles they are, and a name that no other hierarchy has
    Raises ValueError where they could not be used again, OSError.
    """
    tiles = shown.tiles
    fault = fault_of_tiles(shown, hierarchy)
    if fault:
        raise ValueError(fault)
    tensors: dict[str, np.ndarray] = {
        "nodes": tiles.nodes,
        "most": tiles.most,
        "sides": tiles.sides,
        "spreads": tiles.spreads,
        **{f"normals.{side}": array for side, array in tiles.normals.items()},
        **{f"colors.{side}": array for side, array in tiles.colors.items()},
    }
    return write_tensors(path, tensors, {"format": FORMAT, "entry": entry, "texels": str(shown.texels)})


def load_tiles(path: Path, hierarchy: Hierarchy, texels: int, entry: str) -> ShownTiles:
    """Map what `save_tiles` wrote for the same hierarchy and the same number of texels. Raises DamagedFile, OSError."""
    tensors, metadata = map_tensors(path)
    if metadata.get("format") != FORMAT:
        raise DamagedFile("it is from another version")
    if (metadata.get("entry"), metadata.get("texels")) != (entry, str(texels)):
        raise DamagedFile("its tiles are of something else")
    try:
        sides = tensors["sides"]
        present = [int(side) for side in np.unique(sides[sides > 0])]
        tiles = FittedTiles(
            nodes=tensors["nodes"],
            most=tensors["most"],
            sides=sides,
            spreads=tensors["spreads"],
            normals={side: tensors[f"normals.{side}"] for side in present},
            colors={side: tensors[f"colors.{side}"] for side in present if f"colors.{side}" in tensors},
        )
    except LookupError as error:
        raise DamagedFile("it does not hold tiles") from error
    shown = ShownTiles(texels, tiles)
    fault = fault_of_tiles(shown, hierarchy)
    if fault:
        raise DamagedFile(fault)
    return shown


def fault_of_tiles(shown: ShownTiles, hierarchy: Hierarchy) -> str:
    """Say in a few words why tiles must not be drawn of a hierarchy; "": they may."""
    tiles = shown.tiles
    count, colored = len(tiles.nodes), hierarchy.leaves.colors is not None
    numbers = (tiles.nodes, np.uint32), (tiles.most, np.int32), (tiles.sides, np.int32)
    if any(array.shape != (count,) or array.dtype != dtype for array, dtype in numbers):
        return "not one size a node"
    if tiles.spreads.shape != (count, 4) or tiles.spreads.dtype != np.uint8:
        return "not one spread a node"
    if (np.diff(tiles.nodes.astype(np.int64)) <= 0).any() or (tiles.nodes >= hierarchy.node_count).any():
        return "nodes that are none or not in order"
    allowed = sides_of(shown.texels)
    if not np.isin(tiles.most, allowed).all() or not np.isin(tiles.sides, (0, *allowed)).all():
        return "sizes that no tile has"
    if (tiles.sides > tiles.most).any():
        return "tiles with more texels than they may have"
    present = {int(side): int(times) for side, times in zip(*np.unique(tiles.sides, return_counts=True), strict=True)}
    present.pop(0, None)
    for texels, channels, expected in ((tiles.normals, 2, True), (tiles.colors, 4, colored)):
        shapes = {side: array.shape for side, array in texels.items() if array.dtype == np.uint8}
        if shapes != {side: (times, side, side, channels) for side, times in present.items() if expected}:
            return "not as many texels as the tiles have"
    return ""
