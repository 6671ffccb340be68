"""The hierarchy of surfels: flat arrays in breadth-first order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hierarchy.leaves import Leaves, Triangles
from hierarchy.model import Float64Array, UInt8Array, UInt16Array
from hierarchy.openings import Openings

# What the selection reads of a node.
NODE = np.dtype(
    [
        ("x", "f4"), ("y", "f4"), ("z", "f4"),  # disc centre, model space; also the centre of the sphere
        ("sphere", "f4"),  # radius of the bounding sphere of the disc and the whole subtree
        ("axis_x", "f4"), ("axis_y", "f4"), ("axis_z", "f4"),  # normal cone: unit axis ...
        ("cone_sin", "f4"), ("cone_cos", "f4"),  # ... and half-angle; cos -1: contains every direction
        ("print_x", "f4"), ("print_y", "f4"), ("print_z", "f4"),  # cone of the footprint (footprints.py): axis ...
        ("print_sin", "f4"), ("print_cos", "f4"),  # ... and half-angle, as above
        ("radius", "f4"),  # disc radius
        ("relief", "f4"),  # largest distance of the footprint's surface from the disc's plane
        ("first_child", "i4"), ("child_count", "i4"),  # children are contiguous
        ("leaf_begin", "i4"), ("leaf_end", "i4"),  # all leaves of the subtree are contiguous
    ]
)  # fmt: skip

# What the GPU reads of a splat, node or leaf surfel: three RGBA32F texels.
SPLAT = np.dtype(
    [
        ("centre", "f4", 3),  # model space
        ("radius", "f4"),
        ("normal", "f4", 3),  # unit
        ("thickness", "f4"),  # largest distance of the primitives below from the disc's plane
        ("box", "f4", 4),  # rectangle of the disc that is drawn (boxes.py)
    ]
)
assert SPLAT.itemsize == 48


@dataclass(frozen=True, eq=False)
class Hierarchy:
    """Surfels at every level of detail over a model's base primitives.

    name, origin, scale, warnings : as in `Mesh`
    nodes : NODE (M,), breadth-first, root first, parents before children; inner nodes only
    splats : SPLAT (M,) or (M + N,), the nodes' discs and, in a point hierarchy, the N leaf surfels behind them
    spreads : uint16 (M, SCALES), how much the normals below a node vary (spreads.py)
    colors : uint8, one row a splat, or None
    leaves : base primitives in Morton order; a node's leaves are a contiguous range of them. A leaf that lies in
        a node's range but in none of its children's hangs on the node itself.
    closed : the surface has an inside that no eye outside sees
    openings : of a mesh that is not closed: where its backs can be seen; None: everywhere, or nowhere if closed
    radius : of the sphere around the model space's origin that holds every base primitive
    half_extents : float64 (3,), of the box around the origin that does
    """

    name: str
    origin: Float64Array
    nodes: np.ndarray
    splats: np.ndarray
    spreads: UInt16Array
    colors: UInt8Array | None
    leaves: Leaves
    closed: bool
    radius: float
    half_extents: Float64Array
    warnings: tuple[str, ...] = ()
    openings: Openings | None = None
    scale: float = 1.0

    @property
    def node_count(self) -> int:
        return len(self.nodes)

    @property
    def leaf_count(self) -> int:
        return len(self.leaves)

    @property
    def leaf_kind(self) -> str:
        """What the leaves are: "triangles" (hybrid hierarchy) or "surfels" (point hierarchy)."""
        return "triangles" if isinstance(self.leaves, Triangles) else "surfels"

    @property
    def bounds(self) -> tuple[npt.NDArray[np.float64], float]:
        """Centre, model space, and radius of a sphere that holds the model."""
        return np.zeros(3), self.radius

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        arrays = [self.nodes, self.splats, self.spreads, self.colors, *vars(self.leaves).values(), self.openings]
        return sum(a.nbytes for a in arrays if a is not None)
