"""Normal tiles: for every node a small map of the true normals (and colours) over its disc.

What is in them and how it is found is in tile_kernels.py; this is how they are laid out, for all nodes at once or for
some at a time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hierarchy.at_once import at_once as on_threads
from hierarchy.encoding import BYTE_ZERO
from hierarchy.fit_tables import FitTables, fit_tables
from hierarchy.hierarchy import Hierarchy
from hierarchy.leaves import Triangles
from hierarchy.model import Int32Array, Progress, UInt8Array, UInt32Array, ignore_progress
from hierarchy.tile_fits import fit_tiles
from hierarchy.tile_kernels import LAYER_SIZE, bake_at_once

# Nodes baked between two reports of progress: some 30 ms of work.
BLOCK = 4096
# Nodes that a thread takes at a time.
PIECE = 128


@dataclass(frozen=True, eq=False)
class NormalTiles:
    """The tiles of all nodes, or of some, side by side in layers.

    texels : texels along one side of a tile (w_s)
    count : number of tiles
    tile_of_node : int32 (M,), each node's tile, -1: none
    normals : uint8 (layers, LAYER_SIZE, LAYER_SIZE, 2), hemi-octahedral in the node's own frame
    colors : uint8 (layers, LAYER_SIZE, LAYER_SIZE, 4), or None
    """

    texels: int
    count: int
    tile_of_node: Int32Array
    normals: UInt8Array
    colors: UInt8Array | None

    @property
    def nbytes(self) -> int:
        """Bytes of the tiles themselves, without the atlas' unused rest."""
        return self.count * self.texels**2 * (2 if self.colors is None else 6)

    def as_fitted(self) -> FittedTiles:
        """Return the same tiles as if nothing less would do."""
        side = LAYER_SIZE // self.texels
        tiles = np.flatnonzero(self.tile_of_node >= 0).astype(np.uint32)
        layer, place = np.divmod(self.tile_of_node[tiles], side**2)
        row, column = np.divmod(place, side)

        def gather(atlas: UInt8Array) -> UInt8Array:
            used = atlas[:, : side * self.texels, : side * self.texels]
            grid = used.reshape(len(atlas), side, self.texels, side, self.texels, -1)
            found: UInt8Array = grid[layer, row, :, column]
            return found

        sides = np.full(len(tiles), self.texels, np.int32)
        spreads = np.tile(np.array([0, 0, 255, 255], np.uint8), (len(tiles), 1))
        colors = {} if self.colors is None else {self.texels: gather(self.colors)}
        return FittedTiles(tiles, sides, sides, spreads, {self.texels: gather(self.normals)}, colors)

    def corner(self, tile: int) -> tuple[int, int, int]:
        """Return layer, row and column of a tile's first texel."""
        side = LAYER_SIZE // self.texels
        return tile // side**2, tile // side % side * self.texels, tile % side * self.texels

    def normal_codes(self, tile: int) -> UInt8Array:
        """Return a tile's encoded normals, uint8 (w, w, 2), rows along o2, columns along o1."""
        layer, row, column = self.corner(tile)
        return self.normals[layer, row : row + self.texels, column : column + self.texels]


@dataclass(frozen=True, eq=False)
class FittedTiles:
    """Tiles of some nodes, each of as few texels as show its normals.

    nodes : uint32 (K,)
    most : int32 (K,), texels along one side that each tile might have had
    sides : int32 (K,), texels that it has; 0: the node's own normal and colour are all it takes
    spreads : uint8 (K, 4), low.x, low.y, width.x and width.y of each: byte b of its normals stands for the byte
        low + b width / 255 of encoding.py
    normals : by side uint8 (N, side, side, 2), in the order of the nodes whose tiles have that side
    colors : by side uint8 (N, side, side, 4); empty where the model has none
    """

    nodes: UInt32Array
    most: Int32Array
    sides: Int32Array
    spreads: UInt8Array
    normals: dict[int, UInt8Array]
    colors: dict[int, UInt8Array]

    @property
    def count(self) -> int:
        """How many nodes have a tile."""
        return int(np.count_nonzero(self.sides))

    @property
    def nbytes(self) -> int:
        texels = sum(array.nbytes for array in (*self.normals.values(), *self.colors.values()))
        return int(texels + self.count * self.spreads.shape[1])


@dataclass(frozen=True)
class TileCount:
    """What the tiles of all nodes take.

    texels : along one side at most (w_s)
    nodes, tiles : how many, and how many of them one normal is not enough for
    nbytes : of the tiles
    """

    texels: int
    nodes: int
    tiles: int
    nbytes: int


class TileBaker:
    """Bakes the tiles of a hierarchy, as many at a time as anybody wants."""

    def __init__(self, hierarchy: Hierarchy, texels: int) -> None:
        """texels : texels along one side of a tile (w_s), 1..LAYER_SIZE; raises ValueError where out of range."""
        if not 1 <= texels <= LAYER_SIZE:
            raise ValueError(f"a tile has 1 to {LAYER_SIZE} texels a side, not {texels}")
        self.texels = texels
        leaves = hierarchy.leaves
        self.has_colors = leaves.colors is not None
        read = (
            leaves.positions,
            leaves.normals,
            leaves.indices if isinstance(leaves, Triangles) else np.empty((0, 3), np.int32),
            np.empty(0, np.float32) if isinstance(leaves, Triangles) else leaves.radii,
            leaves.colors if leaves.colors is not None else np.empty((0, 4), np.uint8),
        )
        disc_normals = hierarchy.splats["normal"][: hierarchy.node_count]
        self._model = (hierarchy.nodes, disc_normals, read, isinstance(leaves, Triangles))
        self._own_colors = hierarchy.colors if hierarchy.colors is not None else np.empty((0, 4), np.uint8)
        self._tables: FitTables | None = None

    def empty(self, layers: int, rows: int) -> tuple[UInt8Array, UInt8Array]:
        """Return normals and colours that nothing has hit: uint8 (layers, rows, LAYER_SIZE, 2), and the same with 4.

        Colours have no layers where the model has none.
        """
        normals = np.full((layers, rows, LAYER_SIZE, 2), int(BYTE_ZERO), np.uint8)
        # Alpha 0 marks a texel that hit nothing: the shader takes the node's own colour there.
        return normals, np.zeros((layers if self.has_colors else 0, rows, LAYER_SIZE, 4), np.uint8)

    def bake_into(self, nodes: UInt32Array, first: int, normals: UInt8Array, colors: UInt8Array) -> None:
        """Bake the tiles of nodes (K,) into what `empty` returned, as the tiles first, first + 1, ..., on all cores."""
        bake_at_once(*self._model, nodes, first, self.texels, normals, colors)

    def fitted(self, nodes: UInt32Array, most: Int32Array, *, at_once: bool = False) -> FittedTiles:
        """Bake tiles of as few texels as will do.

        nodes, most : uint32 and int32 (K,), most texels along one side of each tile, of `tile_sizes.sides_of`
        at_once : on all cores; else on this one. Other threads may do either meanwhile
        """
        if self._tables is None:
            self._tables = fit_tables(self.texels)
        texels = int(most.max(initial=1)) ** 2
        normals = np.empty((len(nodes), 2 * texels), np.uint8)
        colors = np.empty((len(nodes) if self.has_colors else 0, 4 * texels), np.uint8)
        sides, spreads = np.empty(len(nodes), np.int32), np.zeros((len(nodes), 4), np.uint8)
        tables = tuple(vars(self._tables).values())

        def bake(piece: slice) -> None:
            wanted, rest = (nodes[piece], most[piece]), (spreads[piece], sides[piece])
            fit_tiles(*self._model, self._own_colors, *wanted, tables, normals[piece], colors[piece], rest)

        size = PIECE if at_once else max(len(nodes), 1)
        on_threads(bake, [slice(first, first + size) for first in range(0, len(nodes), size)])
        found, of_normals, of_colors = np.unique(sides[sides > 0]), {}, {}
        for side in found.tolist():
            here = np.flatnonzero(sides == side)
            of_normals[side] = normals[here, : 2 * side**2].reshape(-1, side, side, 2)
            if self.has_colors:
                of_colors[side] = colors[here, : 4 * side**2].reshape(-1, side, side, 4)
        return FittedTiles(nodes, most, sides, spreads, of_normals, of_colors)


def bake_tiles(
    hierarchy: Hierarchy, texels: int, *, nodes: UInt32Array | None = None, progress: Progress = ignore_progress
) -> NormalTiles:
    """Bake the normal tiles of the nodes; colours too where the model has them.

    texels : texels along one side of a tile (w_s), 1..LAYER_SIZE
    nodes : uint32 (K,), bake the tiles of these nodes only; None: of all
    progress : called from this thread; an exception that it raises ends the work
    Raises ValueError where `texels` is out of range.
    """
    baker = TileBaker(hierarchy, texels)
    wanted = np.arange(hierarchy.node_count, dtype=np.uint32) if nodes is None else np.unique(nodes)
    count = len(wanted)
    # A texture has at least one layer, and a cut may hold no node.
    normals, colors = baker.empty(max(1, -(-count // (LAYER_SIZE // texels) ** 2)), LAYER_SIZE)
    for first in range(0, count, BLOCK):
        progress("Baking normal tiles", first / count)
        baker.bake_into(wanted[first : first + BLOCK], first, normals, colors)
    progress("Baking normal tiles", 1.0)
    tile_of_node = np.full(hierarchy.node_count, -1, np.int32)
    tile_of_node[wanted] = np.arange(count, dtype=np.int32)
    return NormalTiles(texels, count, tile_of_node, normals, colors if baker.has_colors else None)


def count_tiles(hierarchy: Hierarchy, texels: int, progress: Progress = ignore_progress) -> TileCount:
    """Bake the tiles of all nodes, of as few texels as will do, and count what they take.

    texels : along one side at most (w_s)
    progress : as in `bake_tiles`
    """
    baker = TileBaker(hierarchy, texels)
    tiles = nbytes = 0
    for first in range(0, hierarchy.node_count, BLOCK):
        progress("Baking normal tiles", first / hierarchy.node_count)
        nodes = np.arange(first, min(first + BLOCK, hierarchy.node_count), dtype=np.uint32)
        baked = baker.fitted(nodes, np.full(len(nodes), texels, np.int32), at_once=True)
        tiles, nbytes = tiles + baked.count, nbytes + baked.nbytes
    progress("Baking normal tiles", 1.0)
    return TileCount(texels, hierarchy.node_count, tiles, nbytes)
