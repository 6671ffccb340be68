"""Algorithm 3 in plain Python with angles, node by node.

Based on Holst and Schumann, "Normal Mapping for Surfel-Based Rendering" (2007), section 5, with the departures that
hierarchy/lod.py states. Nothing is shared with it but its constants, and the cells of the picture in which the fronts
of caps are seen, which have tests of their own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from hierarchy.cones import EVERYTHING
from hierarchy.facing import BACK, FRONT, SILHOUETTE
from hierarchy.hierarchy import Hierarchy
from hierarchy.leaves import Triangles
from hierarchy.traversal import BENT_COSINE, BOTH_SIDES, PARALLAX, PARALLAX_OF_R_SIL, RELIEF_OF_R_SIL
from hierarchy.view import View
from hierarchy.visible_openings import GRID, hidden_backs

Float64Array = npt.NDArray[np.float64]


@dataclass
class Selection:
    """What is drawn, by number of node or leaf, and whether because of the silhouette; and what was left out.

    nodes, leaves : number -> on the silhouette
    culled : leaves that are outside the frustum or face away
    edge_on : triangles that may or may not be culled: the eye is in their planes, but for rounding
    visited : number of nodes looked at
    """

    nodes: dict[int, bool] = field(default_factory=dict)
    leaves: dict[int, bool] = field(default_factory=dict)
    culled: set[int] = field(default_factory=set)
    edge_on: set[int] = field(default_factory=set)
    visited: int = 0


def vector(record: np.void, prefix: str = "") -> Float64Array:
    """Return the fields x, y, z of a record as float64 (3,)."""
    return np.array([record[f"{prefix}{axis}"] for axis in "xyz"], np.float64)


def side_of_cone(axis: Float64Array, half_angle: float, to_centre: Float64Array, sphere: float) -> int:
    """Tell how the normals of a cone, anywhere in a sphere, face the eye; angles in radians.

    to_centre : float64 (3,), from the eye to the sphere's centre
    """
    distance = float(np.linalg.norm(to_centre))
    if half_angle >= math.pi / 2 or distance <= sphere:
        return SILHOUETTE
    along = math.acos(np.clip(axis @ to_centre / (np.linalg.norm(axis) * distance), -1.0, 1.0))
    spread = half_angle + math.asin(sphere / distance)
    if along + spread <= math.pi / 2:
        return BACK
    return FRONT if along - spread >= math.pi / 2 else SILHOUETTE


def side_as_printed(axis: Float64Array, half_angle: float, line_of_sight: Float64Array, view_angle: float) -> int:
    """Tell the same as the paper does, by the field of view alone."""
    spread = half_angle + view_angle
    if spread >= math.pi / 2:
        return SILHOUETTE
    facing = float(axis @ line_of_sight)
    if facing > math.sin(spread):
        return BACK
    return FRONT if facing <= -math.sin(spread) else SILHOUETTE


def clip_planes(view: View) -> Float64Array:
    """Return the near, left, right, bottom and top planes (5, 4) of model space from the projection's rows."""
    x, y, z, w = view.clip_from_eye @ view.eye_from_model
    planes = np.stack([w + z, w + x, w - x, w + y, w - y])
    normalised: Float64Array = planes / np.linalg.norm(planes[:, :3], axis=1, keepdims=True)
    return normalised


def half_angle_of(node: np.void, prefix: str) -> float:
    """Return the half-angle of a node's cone, pi where it contains everything."""
    if node[f"{prefix}_cos"] == EVERYTHING:
        return math.pi
    return math.atan2(float(node[f"{prefix}_sin"]), float(node[f"{prefix}_cos"]))


def select(
    hierarchy: Hierarchy,
    view: View,
    r_sil: float,
    r_inner: float,
    *,
    two_sided: bool = False,
    printed_cone_test: bool = False,
) -> Selection:
    """Choose what draws a view, as `hierarchy.lod.select_cut` does."""
    nodes, selection = hierarchy.nodes, Selection()
    planes, ahead, parallel = clip_planes(view), -view.eye_from_model[2, :3], view.is_parallel
    cull_back, caps = not two_sided, np.zeros((GRID, GRID), np.bool_)
    if not hierarchy.closed:
        cull_back, sums = hidden_backs(hierarchy, view)
        caps = np.diff(np.diff(sums, axis=0), axis=1) > 0 if len(sums) else caps
    bare = bare_leaves(hierarchy)
    waiting = [0]
    while waiting:
        index = waiting.pop()
        node = nodes[index]
        selection.visited += 1
        centre, sphere = vector(node), float(node["sphere"])
        to_centre = centre - view.eye
        # Parallel rays: as from infinitely far away, where the sphere is a point.
        sight, spread = (ahead, 0.0) if parallel else (to_centre, sphere)
        own, print_ = half_angle_of(node, "cone"), half_angle_of(node, "print")
        if printed_cone_test:
            side = print_side = side_as_printed(vector(node, "axis_"), own, ahead, 0.0 if parallel else view.view_angle)
        else:
            side = side_of_cone(vector(node, "axis_"), own, sight, spread)
            print_side = side_of_cone(vector(node, "print_"), print_, sight, spread)
        outside = (planes[:, :3] @ centre + planes[:, 3] < -sphere).any()
        hides_backs = cull_back and (side == FRONT or not caps[cells_of_sphere(view, centre, sphere)].any())
        one_sided = hides_backs and not bare[node["leaf_begin"] : node["leaf_end"]].any()
        if outside or (side == BACK and one_sided):
            selection.culled.update(range(node["leaf_begin"], node["leaf_end"]))
            continue
        silhouette = print_side == SILHOUETTE
        depth = float(to_centre @ ahead)
        if depth - sphere > view.near and (parallel or np.linalg.norm(to_centre) > sphere):
            pixels = view.focal_pixels / (1.0 if parallel else depth)
            fine = silhouette
            if not printed_cone_test:
                bent = print_ > math.acos(BENT_COSINE)
                relief = float(node["relief"]) * pixels
                tilt = math.acos(np.clip(vector(node, "axis_") @ sight / np.linalg.norm(sight), -1.0, 1.0))
                fine = (silhouette or bent) and relief > RELIEF_OF_R_SIL * r_sil
                fine = fine or relief * math.sin(tilt) > max(PARALLAX, PARALLAX_OF_R_SIL * r_sil)
            limit = r_sil if fine else r_inner
            if one_sided and not printed_cone_test and own >= math.pi / 2:
                limit = min(limit, BOTH_SIDES)
            if float(node["radius"]) * pixels <= limit:
                selection.nodes[index] = silhouette
                continue
        children = range(node["first_child"], node["first_child"] + node["child_count"])
        waiting += children
        below = {leaf for child in children for leaf in range(nodes[child]["leaf_begin"], nodes[child]["leaf_end"])}
        for leaf in set(range(node["leaf_begin"], node["leaf_end"])) - below:
            triangles = hierarchy.leaves if isinstance(hierarchy.leaves, Triangles) else None
            sine = 0.0 if triangles is None else sine_of_eye(triangles, leaf, view)
            if triangles is not None and abs(sine) < 1e-14:
                selection.edge_on.add(leaf)
            if hides_backs and not bare[leaf] and triangles is not None and sine >= 0.0:
                selection.culled.add(leaf)
            else:
                selection.leaves[leaf] = silhouette
    return selection


def bare_leaves(hierarchy: Hierarchy) -> npt.NDArray[np.bool_]:
    """Return which leaves are never culled for facing away, bool (N,)."""
    if hierarchy.openings is None or len(hierarchy.openings.bare_before) == 0:
        return np.zeros(hierarchy.leaf_count, np.bool_)
    return np.diff(hierarchy.openings.bare_before) > 0


def cells_of_sphere(view: View, centre: Float64Array, sphere: float) -> tuple[slice, slice]:
    """Return the rows and columns of the grid that can show some of a sphere: those of the box around it."""
    x, y, z = view.eye_from_model[:3, :3] @ centre + view.eye_from_model[:3, 3]
    if -z <= sphere and not view.is_parallel:
        return slice(0, GRID), slice(0, GRID)
    slices = []
    half_height = math.tan(0.5 * view.view_angle) if view.parallel_scale is None else view.parallel_scale
    depths = (1.0,) if view.is_parallel else (-z - sphere, -z + sphere)
    for middle, half in ((y, half_height), (x, half_height * view.width / view.height)):
        ends = [(middle + s) / (depth * half) for s in (-sphere, sphere) for depth in depths]
        first, last = (int(np.clip(np.floor(0.5 * GRID * (1.0 + end)), 0, GRID - 1)) for end in (min(ends), max(ends)))
        slices.append(slice(first, last + 1))
    return slices[0], slices[1]


def sine_of_eye(triangles: Triangles, leaf: int, view: View) -> float:
    """Return the sine of the angle at which the view ray to a triangle's first corner meets its plane, from behind.

    0 where the eye is in the plane, also in the corner itself, or the triangle has no area.
    """
    a, b, c = triangles.positions[triangles.indices[leaf]].astype(np.float64)
    ray = -view.eye_from_model[2, :3] if view.is_parallel else a - view.eye
    normal = np.cross(b - a, c - a)
    return float(normal @ ray / max(np.linalg.norm(normal) * np.linalg.norm(ray), np.finfo(np.float64).tiny))
