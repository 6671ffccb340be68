"""Whole cuts in views from in, on and beside spheres and corners: what they leave out is not seen."""

from __future__ import annotations

import math

import numpy as np
import pytest
from brute_selection import clip_planes
from cone_cases import tiny, units
from edge_on import EDGE_ON, visible_thickness
from scene_views import VIEWS
from small_models import box, bumpy_sphere, icosphere, mesh_of, thin_sheet

from hierarchy.build import build_hierarchy
from hierarchy.hierarchy import Hierarchy
from hierarchy.lod import Cut, select_cut
from hierarchy.view import View, look_at

MODELS = {
    "bumpy sphere": lambda: bumpy_sphere(12),
    "box": box,
    "thin sheet": lambda: thin_sheet(12, 1e-4),
    "needles": lambda: mesh_of(*needle_sphere()),
}


def needle_sphere() -> tuple[np.ndarray, np.ndarray]:
    """Return a sphere that is a ten-thousandth as wide as it is long."""
    mesh = icosphere(8)
    return mesh.positions * [1e-4, 1.0, 1.0], mesh.faces


@pytest.fixture(scope="module")
def hierarchies() -> dict[str, Hierarchy]:
    return {name: build_hierarchy(make(), min_leaves=2) for name, make in MODELS.items()}


def nasty_views(hierarchy: Hierarchy, rng: np.random.Generator) -> list[View]:
    """Return views from in, on and next to the spheres of nodes and the corners of leaves, and all of VIEWS."""
    node = hierarchy.nodes[rng.integers(hierarchy.node_count)]
    centre, sphere = np.array([node["x"], node["y"], node["z"]], float), float(node["sphere"])
    corner = hierarchy.leaves.positions[rng.integers(len(hierarchy.leaves.positions))].astype(float)
    direction, up = units(rng, 2)
    axis = np.eye(3)[rng.integers(3)]
    eyes = [centre, centre + sphere * axis, centre + sphere * (1 + tiny(rng, 1)[0]) * direction, corner]
    eyes += [corner + tiny(rng, 1)[0] * direction, 10.0 ** rng.uniform(0, 6) * hierarchy.radius * direction]
    views = []
    for eye in eyes:
        focus = eye + rng.normal(size=3) if rng.random() < 0.3 else 0.3 * hierarchy.radius * rng.normal(size=3)
        scale = rng.choice([1e-3, 0.3, 1.5]) * hierarchy.radius
        for parallel_scale in (None, scale):
            angle = math.radians(rng.choice([1.0, 45.0, 170.0]))
            bounds = hierarchy.bounds
            views.append(look_at(eye, focus, up, angle, (97, 61), bounds=bounds, parallel_scale=parallel_scale))
    return views + [make(hierarchy, (64, 64)) for make in VIEWS.values()]


def may_face(corners: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """Tell which triangles (N, 3, 3) do not face away beyond doubt, without exact arithmetic."""
    u, v, w = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], eye[3] * corners[:, 0] - eye[:3]
    sizes = np.prod([np.linalg.norm(each, axis=1) for each in (u, v, w)], axis=0)
    return (np.cross(u, v) * w).sum(axis=1) <= 1e-12 * sizes


def drawn_times(hierarchy: Hierarchy, cut: Cut) -> np.ndarray:
    """Return how often each leaf is drawn, or stood for by a splat."""
    number = {tuple(row): leaf for leaf, row in enumerate(hierarchy.leaves.indices.tolist())}
    times = np.zeros(hierarchy.leaf_count, int)
    np.add.at(times, [number[tuple(row)] for row in cut.indices.tolist()], 1)
    for node in hierarchy.nodes[cut.splats]:
        times[node["leaf_begin"] : node["leaf_end"]] += 1
    return times


RADII = [(0.0, 0.0), (1e-300, 1e-300), (2.0, 16.0), (0.0, 1e308), (1e308, 0.0), (1e308, 1e308), (5e-324, 32.0)]


def test_what_a_cut_leaves_out_is_not_seen(ledger, amount, rng, hierarchies):
    thickest, largest, cases = 0.0, 0.0, 0
    for _ in range(amount(1, 30)):
        for hierarchy in hierarchies.values():
            corners = hierarchy.leaves.positions[hierarchy.leaves.indices].astype(float)
            for view in nasty_views(hierarchy, rng):
                radii = RADII[rng.integers(len(RADII))]
                with np.errstate(all="raise"):
                    cut = select_cut(hierarchy, view, *radii)
                times = drawn_times(hierarchy, cut)
                assert times.max(initial=0) <= 1
                planes = clip_planes(view)
                # Beyond a plane with all corners, but for what rounding makes of far eyes.
                heights = corners @ planes[:, :3].T + planes[:, 3]
                outside = (heights < 1e-15 * (1.0 + np.linalg.norm(view.eye))).all(axis=1).any(axis=1)
                for leaf in np.flatnonzero((times == 0) & ~outside & may_face(corners, view.homogeneous_eye)):
                    thickest = max(thickest, visible_thickness(corners[leaf], view.homogeneous_eye))
                largest = max(largest, oversize(hierarchy, view, cut, max(radii)))
                cases += 1
    tried = "eyes in, on and 1e-17 beside spheres and corners, to 1e6 radii away; radii 0, 5e-324 and 1e308"
    ledger.record(
        "kernels", "front of what a cut leaves out", tried, cases=cases, worst=thickest, bound=EDGE_ON, unit="px"
    )
    ledger.record("kernels", "radius of a splat beyond its limit", tried, cases=cases, worst=largest, bound=1e-14)


def oversize(hierarchy: Hierarchy, view: View, cut: Cut, limit: float) -> float:
    """Return the share by which the largest splat of a cut exceeds its limit, in long doubles."""
    nodes = hierarchy.nodes[cut.splats]
    if limit > 1e300 or len(nodes) == 0:
        return 0.0
    centres = np.stack([nodes[axis] for axis in "xyz"], 1).astype(np.longdouble) - view.eye
    depths = centres @ -view.eye_from_model[2, :3].astype(np.longdouble)
    pixels = nodes["radius"] * np.longdouble(view.focal_pixels) / (1 if view.is_parallel else depths)
    return float((pixels / np.longdouble(limit)).max() - 1)
