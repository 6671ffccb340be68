"""Where the backs of an open mesh can be seen: through the caps over its borders, and on bare triangles.

Every border gets a cap: a fan of triangles from its middle. Mesh and caps together are closed, so that winding numbers
(winding.py) tell inside from outside, whatever the mesh is like. Say a ray from an eye outside, where the winding
number is not positive, meets the mesh for the first time, at the back of a triangle. There the number falls by one. So
it is negative in front of that triangle, unless the ray came in through the front of a cap. It follows which backs
can be seen from outside:

- those seen through the front of a cap,
- those of triangles with a negative number in front of them: *bare* ones. On a solid with holes there are none. The
  hollows of a landscape are bare (its cap lies over them), as is all of a mesh that is inside out.

Any cap would do. A triangle that a cap passes through counts as bare; where the mesh passes through itself, a triangle
counts as its centre does. Where thousands of triangles lie over one place, as in a fan, what is there counts as bare.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba as nb
import numpy as np
import numpy.typing as npt

from hierarchy.clean import distinct_corners, has_area
from hierarchy.half_edges import number_edges
from hierarchy.model import BoolArray, Float32Array, Int32Array
from hierarchy.triangle_overlap import pass_through
from hierarchy.unique_rows import unique_positions
from hierarchy.winding import turn, winding_numbers

# How far before a triangle the winding number is taken, as a share of the model's size: some ten times the rounding
# of float32 coordinates.
STEP = 1e-6


@dataclass(frozen=True, eq=False)
class Openings:
    """What an eye outside can see the backs of an open mesh by.

    caps : float32 (C, 3, 3), [triangle, corner, axis], model space; counter-clockwise seen from outside
    bare_before : int32 (N + 1,), how many bare leaves come before each; (0,) where no leaf is bare
    """

    caps: Float32Array
    bare_before: Int32Array

    @property
    def nbytes(self) -> int:
        return self.caps.nbytes + self.bare_before.nbytes


def find_openings(
    positions: Float32Array,
    faces: Int32Array,
    centres: Float32Array,
    normals: Float32Array,
    *,
    leaves_are_faces: bool,
) -> Openings:
    """Cap the borders of a mesh and find its bare leaves.

    positions : float32 (V, 3), model space; vertices at one place are one
    faces : int32 (T, 3)
    centres, normals : float32 (N, 3), of the leaves: points of the surface and unit vectors to its front
    leaves_are_faces : leaf i is face i; else the leaves are surfels, and a cap may pass through them
    """
    point_of_vertex, first = unique_positions(positions)
    point_faces = point_of_vertex[faces]
    point_faces = point_faces[distinct_corners(point_faces)]
    points, caps = border_caps(positions[first], point_faces)
    cycle = np.concatenate([point_faces, caps])
    if len(cycle) == 0:
        return Openings(np.empty((0, 3, 3), np.float32), np.empty(0, np.int32))
    step = STEP * float(np.abs(positions).max())
    turned = turn(points)
    bare: BoolArray = winding_numbers(turned, cycle, turn(centres + step * normals.astype(np.float64))) < 0
    # The edge of many faces has as many caps, one over the other. To be seen one is enough.
    caps = caps[np.append(True, (caps[1:] != caps[:-1]).any(axis=1))] if len(caps) else caps
    caps = caps[has_area(points, caps)]
    if leaves_are_faces and len(caps) > 0:
        unknown = np.flatnonzero(~bare)
        bare[unknown] = pass_through(turn(positions), faces[unknown], turned, caps, step)
    before = np.empty(0, np.int32)
    if bare.any():
        before = np.concatenate([np.zeros(1, np.int32), np.cumsum(bare, dtype=np.int32)])
    return Openings(np.ascontiguousarray(points[caps]), before)


def border_caps(points: Float32Array, faces: Int32Array) -> tuple[Float32Array, Int32Array]:
    """Return points, with the middles of all borders behind them, and caps int32 (C, 3) over the borders.

    points : float32 (P, 3), distinct; faces : int32 (T, 3), with distinct corners
    An edge is on a border where its faces do not run along it as often in one direction as in the other. With the caps
    they do.
    """
    edges, edge_count = number_edges(faces, len(points))
    ends = np.empty((edge_count, 2), np.int32)
    starts, stops = faces, np.roll(faces, -1, axis=1)
    ends[edges.ravel(), 0] = np.minimum(starts, stops).ravel()
    ends[edges.ravel(), 1] = np.maximum(starts, stops).ravel()
    upward = np.where(starts < stops, 1.0, -1.0).ravel()
    excess = np.bincount(edges.ravel(), weights=upward, minlength=edge_count).astype(np.int32)
    border = ends[excess != 0]
    if len(border) == 0:
        return points, np.empty((0, 3), np.int32)
    excess = excess[excess != 0]
    numbers, count = _number_borders(border, len(points))
    # The middle of the edges' middles; float64, as borders may have many.
    middles = np.zeros((count, 3))
    np.add.at(middles, numbers, 0.5 * points[border[:, 0]].astype(np.float64) + 0.5 * points[border[:, 1]])
    middles /= np.bincount(numbers, minlength=count)[:, None]
    downward = excess < 0
    caps = np.stack(
        [
            np.where(downward, border[:, 0], border[:, 1]),
            np.where(downward, border[:, 1], border[:, 0]),
            (len(points) + numbers).astype(np.int32),
        ],
        axis=1,
    ).astype(np.int32)
    return np.concatenate([points, middles.astype(np.float32)]), np.repeat(caps, np.abs(excess), axis=0)


@nb.njit(cache=True, nogil=True)
def _number_borders(edges: Int32Array, points: int) -> tuple[npt.NDArray[np.int64], int]:
    """Return for each of edges (B, 2) the number of the connected border that it belongs to, and how many there are."""
    parent = np.arange(points, dtype=np.int32)
    # The smaller set joins the larger one: along a long border paths would else grow with it.
    size = np.ones(points, np.int32)
    for e in range(len(edges)):
        a, b = edges[e, 0], edges[e, 1]
        while parent[a] != a:
            parent[a] = parent[parent[a]]
            a = parent[a]
        while parent[b] != b:
            parent[b] = parent[parent[b]]
            b = parent[b]
        if a != b:
            if size[a] > size[b]:
                a, b = b, a
            parent[a] = b
            size[b] += size[a]
    names = np.full(points, -1, np.int64)
    numbers = np.empty(len(edges), np.int64)
    count = 0
    for e in range(len(edges)):
        a = edges[e, 0]
        while parent[a] != a:
            a = parent[a]
        if names[a] < 0:
            names[a] = count
            count += 1
        numbers[e] = names[a]
    return numbers, count
