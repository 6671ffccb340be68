"""Silhouette-refined selection of the level of detail: Algorithm 3 of Holst and Schumann 2007.

Departures: the printed cone test widens the cone by the field of view; here it is widened by the angle that the
node's own bounding sphere subtends (the printed one stays as a switch). What faces away is culled by the node's own
cone, but what lies on the silhouette is told by the cone of the disc's footprint, and r_sil limits it only where the
footprint leaves the disc's plane visibly (footprints.py). r_sil limits creases, too, and splats whose relief displaces
what is seen at an angle. Added are what Algorithm 3 leaves out: frustum culling by bounding sphere, and descending
nodes that contain the eye or reach the near plane. Leaf triangles that face away are culled one by one. What faces
away is culled on open surfaces, too, where no opening shows it (openings.py).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from hierarchy.at_once import at_once
from hierarchy.hierarchy import Hierarchy
from hierarchy.leaves import Triangles
from hierarchy.model import Float64Array, UInt32Array
from hierarchy.room import rooms
from hierarchy.traversal import traverse
from hierarchy.view import View
from hierarchy.visible_openings import NO_CAP_IN_VIEW, hidden_backs, screen_rows

NOTHING_BARE = np.empty(0, np.int32)

# As soon as so many nodes wait they are divided into parts, and threads take one after the other: always the same
# parts, so that the order of what is drawn does not depend on the machine.
ENOUGH, PARTS = 512, 4
NO_END = 1 << 40


@dataclass(frozen=True, eq=False)
class Cut:
    """What one frame draws: a cut through the hierarchy, less what was culled.

    splats : uint32 (K,), indices into `Hierarchy.splats`; the first `silhouette_splats` lie on the silhouette
    indices : uint32 (T, 3), vertices of the leaf triangles to draw; the first `silhouette_triangles` were reached
        because they lie on the silhouette
    visited_nodes : nodes looked at
    """

    splats: UInt32Array
    indices: UInt32Array
    silhouette_splats: int
    silhouette_triangles: int
    visited_nodes: int

    @property
    def splat_count(self) -> int:
        return len(self.splats)

    @property
    def triangle_count(self) -> int:
        return len(self.indices)

    @property
    def silhouette_count(self) -> int:
        """Splats and leaf triangles on the silhouette."""
        return self.silhouette_splats + self.silhouette_triangles


def frustum_planes(view: View) -> Float64Array:
    """Return the near, left, right, bottom and top planes, float64 (5, 4), for points relative to the eye.

    A point p (model axes, relative to the eye) is inside where n.p + d >= 0 for every row (n, d), |n| = 1.
    """
    f = 1.0 / view.half_height
    fx = f * view.height / view.width
    # A side's plane holds the eye or, where the rays are parallel, the axis' direction.
    z, d = (0.0, 1.0) if view.is_parallel else (-1.0, 0.0)
    across, up = math.hypot(fx, z), math.hypot(f, z)
    eye_planes = np.array(
        [
            [0.0, 0.0, -1.0, -view.near],
            [fx / across, 0.0, z / across, d / across],
            [-fx / across, 0.0, z / across, d / across],
            [0.0, f / up, z / up, d / up],
            [0.0, -f / up, z / up, d / up],
        ]
    )
    eye_planes[:, :3] = eye_planes[:, :3] @ view.eye_from_model[:3, :3]
    return eye_planes


def select_cut(
    hierarchy: Hierarchy,
    view: View,
    r_sil: float,
    r_inner: float,
    *,
    two_sided: bool = False,
    printed_cone_test: bool = False,
) -> Cut:
    """Choose the splats and leaf triangles that draw a view.

    r_sil, r_inner : largest radius in pixels of a splat on the silhouette and off it, >= 0
    two_sided : draw what faces away from the eye on a closed surface, too. On an open one it makes no difference: what
        faces away is drawn where an eye outside can see it in the openings, and all of it where the eye may be inside
        or the openings are not known (point clouds)
    printed_cone_test : classify by the test as printed in the paper, and limit every silhouette surfel by r_sil
    """
    leaves = hierarchy.leaves
    indices = leaves.indices if isinstance(leaves, Triangles) else np.empty((0, 3), np.int32)
    spread = 0.0 if view.is_parallel else view.view_angle
    eye_and_test = (
        view.eye,
        -view.eye_from_model[2, :3],
        view.near,
        view.focal_pixels,
        view.is_parallel,
        printed_cone_test,
        math.sin(spread),
        math.cos(spread),
    )
    cull_back, caps = (not two_sided, NO_CAP_IN_VIEW) if hierarchy.closed else hidden_backs(hierarchy, view)
    bare_before = NOTHING_BARE if hierarchy.openings is None else hierarchy.openings.bare_before
    planes = frustum_planes(view)
    arguments = (
        hierarchy.nodes,
        leaves.positions,
        indices,
        planes,
        view.homogeneous_eye,
        eye_and_test,
        (float(r_sil), float(r_inner)),
        cull_back,
        (bare_before, caps, screen_rows(view)),
    )
    root = np.array([[0, (1 << len(planes)) - 1]], np.int32)
    first, *others = rooms(1 + PARTS)
    begun = first.traverse(partial(traverse, *arguments, ENOUGH), root)
    parts, waiting = [begun], begun.waiting
    if len(waiting):
        starts = [waiting[k * len(waiting) // PARTS : (k + 1) * len(waiting) // PARTS] for k in range(PARTS)]
        rest = partial(traverse, *arguments, NO_END)
        parts += at_once(lambda part: part[0].traverse(rest, part[1]), zip(others, starts, strict=True))
    return Cut(
        splats=np.concatenate([part.silhouette_splats for part in parts] + [part.inner_splats for part in parts]),
        indices=np.concatenate(
            [part.silhouette_triangles for part in parts] + [part.inner_triangles for part in parts]
        ),
        silhouette_splats=sum(len(part.silhouette_splats) for part in parts),
        silhouette_triangles=sum(len(part.silhouette_triangles) for part in parts),
        visited_nodes=sum(part.visited for part in parts),
    )
