"""No back of an open mesh that a ray meets first is culled, and what no opening shows is."""

import dataclasses
import math
import time

import numba as nb
import numpy as np
import pytest
from brute_visibility import EDGE, ray_directions, ray_starts, visible_triangles
from hypothesis import given, settings
from hypothesis import strategies as st
from small_models import bumpy_sphere, cloud_of, grid, icosphere, mesh_of, terrain, turned

from hierarchy.build import build_hierarchy
from hierarchy.lod import select_cut
from hierarchy.openings import border_caps, find_openings
from hierarchy.view import look_at
from hierarchy.visible_openings import GRID, _may_be_inside, hidden_backs

seeds = st.integers(0, 2**32 - 1)


def torus(n=16, m=8):
    u, v = np.meshgrid(np.arange(n) * 2 * np.pi / n, np.arange(m) * 2 * np.pi / m, indexing="ij")
    ring = 1.0 + 0.4 * np.cos(v)
    positions = np.stack([ring * np.cos(u), ring * np.sin(u), 0.4 * np.sin(v)], -1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(n), np.arange(m), indexing="ij")
    a, b = (i * m + j).ravel(), ((i + 1) % n * m + j).ravel()
    d, c = (i * m + (j + 1) % m).ravel(), ((i + 1) % n * m + (j + 1) % m).ravel()
    return mesh_of(turned(positions, 3), np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]))


def two_spheres(inner=False):
    """Return two spheres, side by side, or a small one, inside out, in a big one: a hollow ball."""
    one, beside = bumpy_sphere(3, 0.1), np.array([1.5, 1.0, 0.3])
    other, faces = (0.5 * one.positions, one.faces[:, ::-1]) if inner else (one.positions + beside, one.faces)
    return mesh_of(np.concatenate([one.positions, other]), np.concatenate([one.faces, faces + len(one.positions)]))


def moebius(n=24):
    angle = np.arange(n) * 2 * np.pi / n
    around = np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)
    lean = np.cos(angle / 2)[:, None] * around + np.sin(angle / 2)[:, None] * [0.0, 0.0, 1.0]
    k = np.arange(n)
    # Behind the last segment both sides have changed places.
    upper, lower = np.where(k < n - 1, k + 1, n), np.where(k < n - 1, n + k + 1, 0)
    faces = np.concatenate([np.stack([k, n + k, lower], 1), np.stack([k, lower, upper], 1)])
    return mesh_of(np.concatenate([around - 0.3 * lean, around + 0.3 * lean]), faces)


def without(mesh, kept):
    return mesh_of(mesh.positions, mesh.faces[kept])


def with_holes(mesh, rng):
    """Take patches of triangles away, some of one triangle, some so large that little is left."""
    centres = mesh.positions[mesh.faces].mean(axis=1)
    kept = np.ones(len(mesh.faces), bool)
    for _ in range(rng.integers(1, 5)):
        middle = centres[rng.integers(len(centres))]
        kept &= np.linalg.norm(centres - middle, axis=1) > rng.choice([0.0, 0.3, 0.7, 1.2])
    kept[rng.integers(len(kept))] = True
    return without(mesh, kept)


CLOSED = {
    "sphere": lambda: bumpy_sphere(4),
    "thin sphere": lambda: mesh_of(bumpy_sphere(4).positions * [1.0, 1.0, 0.1], bumpy_sphere(4).faces),
    "torus": torus,
    "side by side": two_spheres,
    "hollow": lambda: two_spheres(inner=True),
    "inside out": lambda: mesh_of(bumpy_sphere(3).positions, bumpy_sphere(3).faces[:, ::-1]),
}


def corners_of(hierarchy):
    return hierarchy.leaves.positions[hierarchy.leaves.indices].astype(float)


def drawn(hierarchy, view, radii=(0.0, 0.0)):
    """Return which leaves are drawn or lie below a splat that is."""
    cut = select_cut(hierarchy, view, *radii)
    number = {tuple(row): leaf for leaf, row in enumerate(hierarchy.leaves.indices.tolist())}
    result = np.zeros(hierarchy.leaf_count, bool)
    result[[number[tuple(row)] for row in cut.indices.tolist()]] = True
    for node in hierarchy.nodes[cut.splats]:
        result[node["leaf_begin"] : node["leaf_end"]] = True
    return result


def facing_away(hierarchy, view):
    corners = corners_of(hierarchy)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    x, y, z, w = view.homogeneous_eye
    return ((w * corners[:, 0] - [x, y, z]) * normals).sum(axis=1) >= 0.0


def view_from(hierarchy, eye, focus=(0.0, 0.0, 0.0), angle=0.9, size=(40, 30), scale=None):
    view = look_at(eye, focus, (0.1, 1.0, 0.2), angle, size, bounds=hierarchy.bounds, parallel_scale=scale)
    # The law is about rays from the eye, not from the near plane.
    return dataclasses.replace(view, near=1e-9)


def random_view(hierarchy, rng, size=(40, 30)):
    """Return a view from afar, near by, between the parts or a place on the surface, or a parallel one."""
    radius = hierarchy.radius
    direction = rng.normal(size=3)
    eye = rng.choice([0.2, 0.6, 0.9, 1.1, 2.5]) * radius * direction / np.linalg.norm(direction)
    if rng.random() < 0.2:
        eye = corners_of(hierarchy)[rng.integers(hierarchy.leaf_count)].mean(axis=0) * rng.choice([0.99, 1.0, 1.01])
    scale = rng.uniform(0.2, 1.2) * radius if rng.random() < 0.25 else None
    return view_from(hierarchy, eye, 0.4 * radius * rng.normal(size=3), rng.uniform(0.2, 2.0), size, scale)


@nb.njit
def first_hits(starts, directions, corners, edge):
    """Return which triangles some ray meets first, well inside (brute_visibility.py says the same, slowly)."""
    visible = np.zeros(len(corners), np.bool_)
    edges1, edges2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    for r in range(len(directions)):
        d, start = directions[r], starts[r if len(starts) > 1 else 0]
        nearest, first = np.inf, -1
        for k in range(len(corners)):
            e, f = edges1[k], edges2[k]
            g = start - corners[k, 0]
            px, py, pz = d[1] * f[2] - d[2] * f[1], d[2] * f[0] - d[0] * f[2], d[0] * f[1] - d[1] * f[0]
            determinant = e[0] * px + e[1] * py + e[2] * pz
            if determinant == 0.0:
                continue
            u = (g[0] * px + g[1] * py + g[2] * pz) / determinant
            qx, qy, qz = g[1] * e[2] - g[2] * e[1], g[2] * e[0] - g[0] * e[2], g[0] * e[1] - g[1] * e[0]
            v = (d[0] * qx + d[1] * qy + d[2] * qz) / determinant
            t = (f[0] * qx + f[1] * qy + f[2] * qz) / determinant
            inside = min(u, v, 1.0 - u - v)
            if inside >= -edge and 1e-9 < t < nearest:
                nearest, first = t, k if inside > edge else -1
        if first >= 0:
            visible[first] = True
    return visible


def check_law(hierarchy, view, radii=(0.0, 0.0), samples=1):
    visible = first_hits(ray_starts(view, samples), ray_directions(view, samples), corners_of(hierarchy), EDGE)
    missing = visible & ~drawn(hierarchy, view, radii)
    assert not missing.any()
    return visible & facing_away(hierarchy, view)


@settings(derandomize=True, deadline=None, max_examples=30)
@given(st.sampled_from([*CLOSED]), seeds, st.sampled_from([(0.0, 0.0), (0.0, 0.0), (1.0, 6.0)]))
def test_no_back_that_is_seen_is_culled(name, seed, radii):
    rng = np.random.default_rng(seed)
    hierarchy = build_hierarchy(with_holes(CLOSED[name](), rng), min_leaves=2)
    check_law(hierarchy, random_view(hierarchy, rng), radii)


@settings(derandomize=True, deadline=None, max_examples=25)
@given(seeds)
def test_triangles_that_hang_on_nothing(seed):
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(12, 1, 3)) + 0.3 * rng.normal(size=(12, 3, 3))
    hierarchy = build_hierarchy(mesh_of(corners.reshape(-1, 3), np.arange(36).reshape(-1, 3)))
    check_law(hierarchy, random_view(hierarchy, rng))


@settings(derandomize=True, deadline=None, max_examples=40)
@given(seeds)
def test_caps_that_pass_through_large_triangles(seed):
    """A rough landscape of few triangles rises above its cap and falls below it within one triangle."""
    rng = np.random.default_rng(seed)
    hierarchy = build_hierarchy(mesh_of(*grid(2, rng.normal(size=9))))
    check_law(hierarchy, random_view(hierarchy, rng))


@pytest.mark.parametrize("name", [*CLOSED])
def test_the_law_is_not_empty(name):
    """Many views see backs, and yet most backs are culled where the surface is not inside out."""
    seen = culled = backs = 0
    for seed in range(8):
        rng = np.random.default_rng(seed)
        hierarchy = build_hierarchy(with_holes(CLOSED[name](), rng))
        direction = rng.normal(size=3)
        view = view_from(hierarchy, 2.5 * hierarchy.radius * direction / np.linalg.norm(direction), angle=1.0)
        seen += check_law(hierarchy, view).sum()
        away = facing_away(hierarchy, view)
        backs, culled = backs + away.sum(), culled + (away & ~drawn(hierarchy, view)).sum()
    assert seen > 20
    assert culled == 0 if name == "inside out" else culled > 0.05 * backs


def test_a_closed_surface_has_no_openings():
    for mesh in (torus(), two_spheres(), two_spheres(inner=True)):
        openings = build_hierarchy(mesh).openings
        assert (len(openings.caps), len(openings.bare_before), openings.nbytes) == (0, 0, 0)
    assert build_hierarchy(dataclasses.replace(torus(), closed=True)).openings is None
    assert build_hierarchy(cloud_of([[0, 0, 0]], [[0, 0, 1]], 1.0)).openings is None


# --- named cases


def pierced(frequency=8, height=0.8):
    """Return a sphere without what is above a height."""
    mesh = icosphere(frequency)
    return build_hierarchy(without(mesh, mesh.positions[mesh.faces].mean(axis=1)[:, 2] < height))


def test_a_hole_seen_from_outside_shows_what_is_behind_it_only():
    hierarchy = pierced(height=0.95)
    assert len(hierarchy.openings.bare_before) == 0
    view = view_from(hierarchy, (0, 0.3, 4))
    seen, away = check_law(hierarchy, view, samples=3), facing_away(hierarchy, view)
    both = drawn(hierarchy, view) & away
    assert seen.sum() > 50
    assert both.sum() < min(4 * seen.sum(), 0.4 * away.sum())


def test_a_hole_seen_from_inside():
    hierarchy = pierced()
    for eye in ((0, 0, 0), (0.5, 0.1, -0.6), (0, 0, 0.6)):
        view = view_from(hierarchy, eye, (0, 0, 5), 2.0)
        assert facing_away(hierarchy, view).all()
        assert check_law(hierarchy, view).any()


def test_the_eye_on_the_cap():
    hierarchy = pierced()
    for cap in hierarchy.openings.caps.astype(float):
        for eye in (cap.mean(axis=0), cap[2]):
            assert check_law(hierarchy, view_from(hierarchy, eye, angle=1.5)).any()


def test_the_eye_beside_the_surface_within_its_sphere():
    """An eye near by, in a dent or beside a flat model, is outside, and nothing but fronts is drawn."""
    mesh = icosphere(8)
    mesh = mesh_of(mesh.positions * [1.0, 1.0, 0.2], mesh.faces)
    hierarchy = build_hierarchy(without(mesh, mesh.positions[mesh.faces].mean(axis=1)[:, 2] > -0.19))
    view = view_from(hierarchy, (0.3, 0.1, 0.4), (0, 0, 0), 2.0)
    assert np.linalg.norm(view.eye) < 0.6 * hierarchy.radius
    check_law(hierarchy, view)
    assert not (drawn(hierarchy, view) & facing_away(hierarchy, view)).any()


def test_a_border_whose_middle_is_outside():
    """Of a bent sausage the inner side is missing, or all but that: the caps run through the middle of the bend."""
    mesh = torus(24, 12)
    centres = turned(np.eye(3), 3).T @ mesh.positions[mesh.faces].mean(axis=1).T
    half, inner = centres[1] > -0.1, np.hypot(centres[0], centres[1]) < 0.9
    for kept in (half & ~inner, half & inner, half):
        hierarchy = build_hierarchy(without(mesh, kept))
        for seed in range(12):
            check_law(hierarchy, random_view(hierarchy, np.random.default_rng(seed)))


def test_two_borders_that_share_a_vertex():
    mesh = icosphere(6)
    vertex = int(np.argmax(mesh.positions[:, 2]))
    around = np.flatnonzero((mesh.faces == vertex).any(axis=1))
    centres = mesh.positions[mesh.faces[around]].mean(axis=1)
    opposite = around[np.abs(centres[:, 1] * 0.5 - centres[:, 0] * 0.86).argsort()[-2:]]
    kept = np.ones(len(mesh.faces), bool)
    kept[opposite] = False
    hierarchy = build_hierarchy(without(mesh, kept))
    assert len(hierarchy.openings.caps) == 6
    # One border, so one middle.
    assert len(np.unique(hierarchy.openings.caps[:, 2], axis=0)) == 1
    for seed in range(10):
        check_law(hierarchy, random_view(hierarchy, np.random.default_rng(seed)))


def test_a_strip_with_one_side():
    hierarchy = build_hierarchy(moebius())
    for seed in range(20):
        check_law(hierarchy, random_view(hierarchy, np.random.default_rng(seed)))


def test_a_surface_that_is_inside_out_is_all_bare():
    mesh = icosphere(6)
    mesh = mesh_of(mesh.positions, mesh.faces[:-20, ::-1])
    hierarchy = build_hierarchy(mesh)
    assert hierarchy.openings.bare_before[-1] == hierarchy.leaf_count
    assert drawn(hierarchy, view_from(hierarchy, (0, 0, 3))).all()


@pytest.mark.parametrize("slope", [0.0, 0.3])
def test_a_flat_sheet_is_drawn_from_both_sides(slope):
    positions, faces = grid(6)
    hierarchy = build_hierarchy(mesh_of(turned(positions + slope * positions[:, :1] * [0, 0, 1]), faces))
    normal = turned([[-slope, 0, 1]])[0]
    for side in (-3, 3):
        assert drawn(hierarchy, view_from(hierarchy, side * normal)).all()


def test_a_landscape_is_drawn_from_below():
    hierarchy = build_hierarchy(terrain(12))
    for seed in range(20):
        rng = np.random.default_rng(seed)
        eye = np.array([*rng.uniform(-2, 2, 2), rng.uniform(-2.0, -0.1)])
        check_law(hierarchy, view_from(hierarchy, eye, rng.uniform(-0.5, 0.5, 3), 1.2), samples=2)
    # Its hollows lie under the cap.
    bare = np.diff(hierarchy.openings.bare_before) > 0
    heights = corners_of(hierarchy)[:, :, 2].mean(axis=1)
    assert heights[bare].mean() < heights[~bare].mean() - 0.05


def test_a_tiny_hole():
    mesh = icosphere(40)
    face = int(np.argmax(mesh.positions[mesh.faces].mean(axis=1)[:, 2]))
    hierarchy = build_hierarchy(without(mesh, np.arange(len(mesh.faces)) != face))
    view = view_from(hierarchy, (0, 0, 4), size=(30, 30))
    cull, sums = hidden_backs(hierarchy, view)
    assert cull
    assert 1 <= sums[-1, -1] <= 4
    # Rays through the hole, at the back of the far side.
    view = dataclasses.replace(view, view_angle=0.02)
    assert check_law(hierarchy, view, samples=2).any()


def test_faces_on_both_sides_of_an_edge_that_four_share():
    """Two boxes that touch in an edge are closed, though no edge may have four faces to `closed`."""
    a, b = two_cubes = [], []
    for shift in (0.0, 1.0):
        for axis in range(3):
            for side in (0.0, 1.0):
                u, v = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
                square = [side * np.eye(3)[axis] + s * u + t * v for s, t in ((0, 0), (1, 0), (1, 1), (0, 1))]
                square = square if side else square[::-1]
                b.extend([len(a) + k for k in triangle] for triangle in ((0, 1, 2), (0, 2, 3)))
                a.extend(np.array(square) + np.array([shift, shift, 0.0]))
    hierarchy = build_hierarchy(mesh_of(*two_cubes))
    assert hierarchy.openings.nbytes == 0
    view = view_from(hierarchy, (4, 3, 5), (1, 1, 0.5))
    check_law(hierarchy, view)
    assert not (drawn(hierarchy, view) & facing_away(hierarchy, view)).any()


def test_thousands_of_holes_take_no_time():
    mesh = icosphere(100)
    kept = np.random.default_rng(0).random(len(mesh.faces)) > 0.02
    mesh = without(mesh, kept)
    hierarchy = build_hierarchy(mesh)
    assert len(hierarchy.openings.caps) > 9_000
    view = view_from(hierarchy, (0, 0, 4), size=(500, 500))
    hidden_backs(hierarchy, view)
    times = []
    for _ in range(5):
        start = time.perf_counter()
        hidden_backs(hierarchy, view)
        times.append(time.perf_counter() - start)
    assert min(times) < 0.02
    start = time.perf_counter()
    centres = mesh.positions[mesh.faces].mean(axis=1)
    find_openings(mesh.positions, mesh.faces, centres, centres, leaves_are_faces=True)
    assert time.perf_counter() - start < 5.0


# --- the parts


def test_rays_hit_what_the_slow_ones_hit():
    hierarchy = pierced(3)
    view = view_from(hierarchy, (1, 0.5, 3))
    hits = first_hits(ray_starts(view), ray_directions(view), corners_of(hierarchy), EDGE)
    np.testing.assert_array_equal(hits, visible_triangles(corners_of(hierarchy), view))


@settings(derandomize=True, deadline=None, max_examples=25)
@given(seeds)
def test_with_its_caps_a_mesh_is_closed(seed):
    rng = np.random.default_rng(seed)
    # Any faces at all, most edges with one face, some with several that run either way.
    faces = np.array([rng.choice(9, 3, replace=False) for _ in range(12)], np.int32)
    points = rng.normal(size=(9, 3)).astype(np.float32)
    capped, caps = border_caps(points, faces)
    np.testing.assert_array_equal(capped[:9], points)
    assert (caps[:, 2] >= 9).all()
    sums = np.zeros((len(capped), len(capped)), int)
    for a, b, c in np.concatenate([faces, caps]):
        for start, stop in ((a, b), (b, c), (c, a)):
            sums[start, stop] += 1
            sums[stop, start] -= 1
    assert not sums.any()


def test_corners_with_vertices_of_their_own_are_no_border():
    mesh = icosphere(4)
    apart = mesh_of(mesh.positions[mesh.faces.ravel()][3:], np.arange(mesh.faces.size - 3).reshape(-1, 3))
    assert len(build_hierarchy(apart).openings.caps) == 3


@settings(derandomize=True, deadline=None, max_examples=30)
@given(st.sampled_from([*CLOSED]), seeds)
def test_an_eye_is_inside_where_rays_say_so(name, seed):
    """Against solid angles of mesh and caps (van Oosterom and Strackee 1983)."""
    rng = np.random.default_rng(seed)
    hierarchy = build_hierarchy(with_holes(CLOSED[name](), rng))
    eye = rng.uniform(-1.2, 1.2, 3) * hierarchy.half_extents
    all_corners = np.concatenate([corners_of(hierarchy), hierarchy.openings.caps]) - eye
    a, b, c = all_corners.swapaxes(0, 1)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    volume = (a * np.cross(b, c)).sum(axis=1)
    rest = la * lb * lc + (a * b).sum(axis=1) * lc + (b * c).sum(axis=1) * la + (c * a).sum(axis=1) * lb
    winding = (2.0 * np.arctan2(volume, rest)).sum() / (4.0 * math.pi)
    assert winding == pytest.approx(round(winding), abs=1e-4)
    assert _may_be_inside(hierarchy, eye) == (round(winding) > 0)


@settings(derandomize=True, deadline=None, max_examples=25)
@given(seeds)
def test_every_ray_through_the_front_of_a_cap_lies_in_a_covered_cell(seed):
    rng = np.random.default_rng(seed)
    hierarchy = build_hierarchy(with_holes(bumpy_sphere(4), rng))
    view = random_view(hierarchy, rng, size=(64, 48))
    cull, sums = hidden_backs(hierarchy, view)
    if not cull:
        return
    cells = np.diff(np.diff(sums, axis=0), axis=1) if len(sums) else np.zeros((GRID, GRID))
    directions, seen = ray_directions(view), np.zeros(view.width * view.height, bool)
    for a, b, c in hierarchy.openings.caps.astype(float) - view.eye:
        # Which side of the planes through the eye and an edge; all inner ones: through the front.
        sides = np.stack([directions @ np.cross(p, q) for p, q in ((a, b), (b, c), (c, a))])
        seen |= (sides < 0.0).all(axis=0) & (np.dot(a, np.cross(b, c)) < 0.0)
    rows, columns = np.divmod(np.flatnonzero(seen), view.width)
    row = ((view.height - rows - 0.5) / view.height * GRID).astype(int)
    column = ((columns + 0.5) / view.width * GRID).astype(int)
    assert cells[row, column].all()
    assert set(np.unique(cells)) <= {0, 1}


def test_a_point_hierarchy_has_the_openings_of_its_mesh():
    mesh = icosphere(12)
    mesh = without(mesh, mesh.positions[mesh.faces].mean(axis=1)[:, 2] < 0.9)
    hybrid, points = build_hierarchy(mesh), build_hierarchy(mesh, points=True)
    ends = [
        sorted(map(tuple, hierarchy.openings.caps[:, :2].reshape(-1, 6).tolist())) for hierarchy in (hybrid, points)
    ]
    assert ends[0] == ends[1]
    assert len(points.openings.bare_before) == 0
    inside_out = build_hierarchy(mesh_of(mesh.positions, mesh.faces[:, ::-1]), points=True)
    assert inside_out.openings.bare_before[-1] == inside_out.leaf_count
