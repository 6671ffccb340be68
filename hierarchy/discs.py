"""The disc of every node: the smallest one that covers its base primitives, projected along its normal.

It covers the base primitives and not the children's discs: that would compound their slack level by level.
The plane has the area-weighted mean normal and the mean height of the primitives below it, so that the disc errs to
both sides of the surface by about the same (cf. Botsch 2004, fig. 3).
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from hierarchy.borrowing import BORROWING
from hierarchy.boxes import TURNS, tight_box
from hierarchy.circles import smallest_circle
from hierarchy.dealing import DEALT, block_count, most_leaves, nodes_of
from hierarchy.disc_corners import corners_in_frame, reaches, vertex_uses
from hierarchy.extremes import low_and_high
from hierarchy.frames import tangents
from hierarchy.leaves import SURFEL_CORNERS, LeafShapes
from hierarchy.model import Float32Array, Float64Array
from hierarchy.octree import Octree
from hierarchy.planes import mean_normal, write_plane_sums

# Radii are stored as float32 and read beside tangents of float32 normals: more than both are off by.
ROUNDED_UP = 1.0 + 1e-6


@nb.njit(**BORROWING)
def _disc(node, shapes, vertices, centres, begin, end, axes, sums, results, work):  # type: ignore[no-untyped-def]
    """Fit a disc to the leaves [begin, end) of a node, and write it to its rows of the results.

    sums : as `write_plane_sums` writes them; results : centres, normals, sizes and boxes; work : arrays to work in
    """
    centre, normal, size, boxes = results
    points, circle, support, ends, older = work
    normal[node, 0], normal[node, 1], normal[node, 2] = mean_normal(sums, axes, node)
    nx, ny, nz = np.float64(normal[node, 0]), np.float64(normal[node, 1]), np.float64(normal[node, 2])
    ux, uy, uz, vx, vy, vz = tangents(nx, ny, nz)
    # Everything relative to the first leaf's centre.
    ox, oy, oz = np.float64(centres[begin, 0]), np.float64(centres[begin, 1]), np.float64(centres[begin, 2])
    frame = (ux, uy, uz, vx, vy, vz, nx, ny, nz)
    count = corners_in_frame(shapes, vertices, begin, end, (ox, oy, oz), frame, points, older)
    low, high = low_and_high(points[2], count)
    mean, area = 0.5 * (low + high), sums[node, 3]
    if area > 0.0:
        x, y, z = sums[node, 4] / area - ox, sums[node, 5] / area - oy, sums[node, 6] / area - oz
        mean = x * nx + y * ny + z * nz
    smallest_circle(points[0], points[1], count, circle, support)
    x, y = circle[0], circle[1]
    centre[node, 0] = ox + x * ux + y * vx + mean * nx
    centre[node, 1] = oy + x * uy + y * vy + mean * ny
    centre[node, 2] = oz + x * uz + y * vz + mean * nz
    # Storing has rounded the centre: measure from there, so that nothing sticks out by rounding.
    x, y, z = np.float64(centre[node, 0]) - ox, np.float64(centre[node, 1]) - oy, np.float64(centre[node, 2]) - oz
    x, y, z = x * ux + y * uy + z * uz, x * vx + y * vy + z * vz, x * nx + y * ny + z * nz
    across2, solid2 = reaches(points, count, x, y, z)
    size[node, 0] = math.sqrt(across2) * ROUNDED_UP
    size[node, 1] = max(high - z, z - low) * ROUNDED_UP
    # The sphere holds the disc too: it stands for both in every culling test.
    size[node, 2] = math.sqrt(max(solid2, across2)) * ROUNDED_UP
    tight_box(points[0], points[1], count, x, y, np.float64(size[node, 0]), boxes[node], ends)


@nb.njit(cache=True, nogil=True, parallel=True)
def _discs(shapes, vertices, centres, areas, octree, axes, sums, results, threads):  # type: ignore[no-untyped-def]
    begin, end = octree[2], octree[3]
    nodes = len(begin)
    write_plane_sums(shapes[3], centres, areas, octree, sums)
    corners = 3 if len(shapes[1]) > 0 else SURFEL_CORNERS
    blocks = block_count(nodes)
    for thread in nb.prange(threads):
        first, last = thread * len(DEALT) // threads, (thread + 1) * len(DEALT) // threads
        most = 0
        for hand in range(first, last):
            most = max(most, corners * most_leaves(hand, begin, end))
        # Once for all hands of a thread: the system clears what is made anew.
        points, older = np.empty((3, most)), np.empty(most + 1, np.int32)
        work = (points, np.empty(3), np.empty((4, 2)), np.empty((TURNS, 4)), older)
        for hand in range(first, last):
            for block in range(DEALT[hand], blocks, len(DEALT)):
                for node in range(*nodes_of(block, nodes)):
                    _disc(node, shapes, vertices, centres, begin[node], end[node], axes, sums, results, work)


def node_discs(
    shapes: LeafShapes, octree: Octree, axes: Float32Array, sums: Float64Array
) -> tuple[Float32Array, Float32Array, Float32Array, Float32Array]:
    """Fit a disc to the leaves of every node.

    shapes : where they are triangles their vertices are in the order of first use
    axes : float32 (M, 3), axes of the normal cones, used where the mean normal vanishes
    sums : float64 (M, SUMS), to work in
    Returns centres float32 (M, 3), unit normals float32 (M, 3), sizes float32 (M, 3): disc radius, thickness
    (largest distance of a primitive from the disc's plane) and radius of the sphere, centred on the disc, around
    everything below the node; and boxes float32 (M, 4), as in `tight_box`.
    """
    s = shapes
    topology = octree.first_child, octree.child_count, octree.leaf_begin, octree.leaf_end
    nodes = len(axes)
    centres, normals, sizes, boxes = (np.empty((nodes, columns), np.float32) for columns in (3, 3, 3, 4))
    arrays, vertices = (s.positions, s.indices, s.radii, s.normals), vertex_uses(s.indices, len(s.positions))
    results = (centres, normals, sizes, boxes)
    threads = min(nb.get_num_threads(), len(DEALT))
    _discs(arrays, vertices, s.centres, s.areas, topology, axes, sums, results, threads)
    return results
