"""Normal tiles: for every node a small map of the true normals (and colours) over its disc.

What is in them and how it is found is in tile_kernels.py; this is how they are laid out, for all nodes at once or for
some at a time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hierarchy.encoding import BYTE_ZERO
from hierarchy.hierarchy import Hierarchy
from hierarchy.leaves import Triangles
from hierarchy.model import Int32Array, Progress, UInt8Array, UInt32Array, ignore_progress
from hierarchy.tile_kernels import LAYER_SIZE, bake_at_once, bake_in_turn

# Nodes baked between two reports of progress: some 30 ms of work.
BLOCK = 4096


@dataclass(frozen=True, eq=False)
class NormalTiles:
    """The tiles of all nodes, or of some, laid out as the GPU reads them.

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

    def tiles_of(self, splats: UInt32Array) -> Int32Array:
        """Return the tiles of splats (K,), int32 (K,); -1 for those that have none, such as every leaf surfel."""
        nodes = len(self.tile_of_node)
        tiles = self.tile_of_node[np.minimum(splats, nodes - 1)]
        tiles[splats >= nodes] = -1
        return tiles

    def corner(self, tile: int) -> tuple[int, int, int]:
        """Return layer, row and column of a tile's first texel."""
        side = LAYER_SIZE // self.texels
        return tile // side**2, tile // side % side * self.texels, tile % side * self.texels

    def normal_codes(self, tile: int) -> UInt8Array:
        """Return a tile's encoded normals, uint8 (w, w, 2), rows along o2, columns along o1."""
        layer, row, column = self.corner(tile)
        return self.normals[layer, row : row + self.texels, column : column + self.texels]


@dataclass(frozen=True, eq=False)
class TileStrips:
    """Tiles of some nodes, as strips that are as wide as a layer of the GPU's texture.

    nodes : uint32 (K,), in the order of their tiles: along the first strip, then along the second
    normals : uint8 (S, texels, LAYER_SIZE, 2), as in `NormalTiles`
    colors : uint8 (S, texels, LAYER_SIZE, 4), or None
    """

    texels: int
    nodes: UInt32Array
    normals: UInt8Array
    colors: UInt8Array | None


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
        self._arrays = (hierarchy.nodes, disc_normals, read, isinstance(leaves, Triangles))

    def empty(self, layers: int, rows: int) -> tuple[UInt8Array, UInt8Array]:
        """Return normals and colours that nothing has hit: uint8 (layers, rows, LAYER_SIZE, 2), and the same with 4.

        Colours have no layers where the model has none.
        """
        normals = np.full((layers, rows, LAYER_SIZE, 2), int(BYTE_ZERO), np.uint8)
        # Alpha 0 marks a texel that hit nothing: the shader takes the node's own colour there.
        return normals, np.zeros((layers if self.has_colors else 0, rows, LAYER_SIZE, 4), np.uint8)

    def bake_into(self, nodes: UInt32Array, first: int, normals: UInt8Array, colors: UInt8Array) -> None:
        """Bake the tiles of nodes (K,) into what `empty` returned, as the tiles first, first + 1, ..., on all cores."""
        bake_at_once(*self._arrays, nodes, first, self.texels, normals, colors)

    @property
    def tiles_of_strip(self) -> int:
        return LAYER_SIZE // self.texels

    def strips(self, nodes: UInt32Array) -> TileStrips:
        """Bake the tiles of nodes (K,), of which there are no more than a layer has room for, on one core.

        May be called on several threads at once, and while parallel kernels run elsewhere.
        """
        count = max(1, -(-len(nodes) // self.tiles_of_strip))
        normals, colors = self.empty(1, count * self.texels)
        bake_in_turn(*self._arrays, nodes, 0, self.texels, normals, colors)
        shape = (count, self.texels, LAYER_SIZE)
        return TileStrips(
            self.texels, nodes, normals.reshape(*shape, 2), colors.reshape(*shape, 4) if self.has_colors else None
        )


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
