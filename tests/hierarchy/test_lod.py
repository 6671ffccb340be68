"""A cut is a true cut: every leaf is drawn once, or lies below one splat, or was culled and is invisible."""

import dataclasses
import math

import numpy as np
import pytest
from brute_selection import clip_planes, select, side_as_printed, side_of_cone
from brute_visibility import visible_discs, visible_triangles
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from small_models import box, bumpy_sphere, cloud_of, icosphere, mesh_of, surfel_sphere, terrain, thin_sheet

from hierarchy.build import build_hierarchy
from hierarchy.cones import EVERYTHING
from hierarchy.facing import BACK, FRONT, SILHOUETTE, classify_cone, classify_cone_printed
from hierarchy.leaves import Triangles
from hierarchy.lod import frustum_planes, select_cut
from hierarchy.traversal import BENT_COSINE, BOTH_SIDES, PARALLAX, PARALLAX_OF_R_SIL, RELIEF_OF_R_SIL
from hierarchy.view import look_at


def open_sphere():
    """Return a bumpy sphere with holes that one can look into."""
    mesh = bumpy_sphere(5)
    x, y, z = mesh.positions[mesh.faces].mean(axis=1).T
    return mesh_of(mesh.positions, mesh.faces[(z < 0.6) & (np.abs(x - 0.5) + np.abs(y + 0.5) > 0.35)])


MODELS = {
    "bumpy sphere": lambda: bumpy_sphere(3),
    "box": box,
    "open sphere": open_sphere,
    "terrain": lambda: terrain(6),
    "thin sheet": lambda: thin_sheet(5),
    "one triangle": lambda: mesh_of([[0, 0, 0], [1, 0, 0], [0, 2, 1]], [[0, 1, 2]]),
    "cloud": lambda: surfel_sphere(150),
    "one surfel": lambda: cloud_of([[0.1, 0.2, 0.3]], [[0, 0.6, 0.8]], 0.5),
    "two surfels": lambda: cloud_of([[0, 0, 0], [1, 0, 0]], [[0, 0, 1], [0.6, 0, 0.8]], [0.5, 0.2]),
    "all in one cell": lambda: cloud_of(np.zeros((50, 3)), surfel_sphere(50).normals, 0.3),
}
KINDS = [
    *("outside", "far", "grazing", "inside", "tiny angle", "wide angle", "on a surfel", "on a corner", "away"),
    *("parallel", "parallel close up", "parallel from afar"),
]

kinds = st.sampled_from(KINDS)
seeds = st.integers(0, 2**32 - 1)
radii = st.one_of(
    st.sampled_from([(0.0, 0.0), (1.0, 1.0), (6.0, 3.0), (0.0, 30.0), (40.0, 400.0)]),
    # Around the sizes that the models have in these views.
    st.tuples(st.floats(0.5, 4.0), st.floats(2.0, 20.0)),
)

_built = {}


def built(name):
    """Return the hierarchy of a model, built once."""
    if name not in _built:
        if name == "closed points":
            _built[name] = dataclasses.replace(build_hierarchy(surfel_sphere(150)), closed=True)
        else:
            _built[name] = build_hierarchy(MODELS[name](), min_leaves=2 if name in ("box", "two surfels") else 4)
    return _built[name]


NAMES = [*MODELS, "closed points"]


def view_of(hierarchy, kind, seed, resolution=(40, 30), margin=1.0):
    """Return a random view; clip planes stand off the model's sphere by a margin."""
    rng = np.random.default_rng(seed)
    centre, radius = hierarchy.bounds
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    up = rng.normal(size=3)
    focus = centre + 0.3 * radius * rng.normal(size=3)
    angle = rng.uniform(0.4, 1.2)
    distances = {"far": 300.0, "grazing": 1.02, "inside": 0.4, "tiny angle": 3.0, "parallel from afar": 1e6}
    distance = distances.get(kind, rng.uniform(1.1, 4.0))
    eye = centre + distance * radius * direction
    if kind == "grazing":
        focus = eye + np.cross(direction, up)
    elif kind == "tiny angle":
        angle = 0.01
    elif kind == "wide angle":
        angle = 2.8
    elif kind == "on a surfel":
        eye = hierarchy.splats["centre"][rng.integers(len(hierarchy.splats))].astype(float)
    elif kind == "on a corner":
        eye = hierarchy.leaves.positions[rng.integers(len(hierarchy.leaves.positions))].astype(float)
    elif kind == "away":
        focus = eye + (eye - centre) + 0.5 * radius * rng.normal(size=3)
    scale = (0.2 if kind == "parallel close up" else rng.uniform(0.5, 1.5)) * radius
    parallel_scale = scale if "parallel" in kind else None
    return look_at(eye, focus, up, angle, resolution, bounds=(centre, margin * radius), parallel_scale=parallel_scale)


def heights_of_eye(view, points, normals):
    """Return how far the eye, or the place that parallel rays come from, is before planes, times its distance."""
    x, y, z, w = view.homogeneous_eye
    return (([x, y, z] - w * points) * normals).sum(axis=1)


def drawn_leaves(hierarchy, cut):
    """Return the numbers of the leaves that a cut draws themselves."""
    if not isinstance(hierarchy.leaves, Triangles):
        assert len(cut.indices) == 0
        return cut.splats[cut.splats >= hierarchy.node_count].astype(int) - hierarchy.node_count
    number = {tuple(row): leaf for leaf, row in enumerate(hierarchy.leaves.indices.tolist())}
    return np.array([number[tuple(row)] for row in cut.indices.tolist()], int)


def coverage(hierarchy, cut):
    """Return how often every leaf is drawn or lies below a splat that is, int (N,)."""
    times = np.zeros(hierarchy.leaf_count, int)
    np.add.at(times, drawn_leaves(hierarchy, cut), 1)
    for node in cut.splats[cut.splats < hierarchy.node_count]:
        times[hierarchy.nodes["leaf_begin"][node] : hierarchy.nodes["leaf_end"][node]] += 1
    return times


@settings(derandomize=True, deadline=None, max_examples=250)
@given(st.sampled_from(NAMES), kinds, seeds, radii, st.booleans(), st.booleans())
def test_cuts_are_those_of_the_plain_algorithm(name, kind, seed, radii, two_sided, printed):
    hierarchy = built(name)
    view = view_of(hierarchy, kind, seed)
    options = {"two_sided": two_sided, "printed_cone_test": printed}
    cut, expected = select_cut(hierarchy, view, *radii, **options), select(hierarchy, view, *radii, **options)
    # Every leaf once, or culled.
    times = coverage(hierarchy, cut)
    assert times.max() <= 1
    either = expected.edge_on
    assert set(np.flatnonzero(times == 0).tolist()) - either == expected.culled - either
    # Node by node and leaf by leaf, each on its side of the silhouette.
    count, silhouette = hierarchy.node_count, cut.silhouette_splats
    on, off = cut.splats[:silhouette], cut.splats[silhouette:]
    assert set(on[on < count].tolist()) == {n for n, s in expected.nodes.items() if s}
    assert set(off[off < count].tolist()) == {n for n, s in expected.nodes.items() if not s}
    leaves = drawn_leaves(hierarchy, cut)
    first = cut.silhouette_triangles
    if not isinstance(hierarchy.leaves, Triangles):
        first = int((on >= count).sum())
    assert set(leaves[:first].tolist()) - either == {n for n, s in expected.leaves.items() if s} - either
    assert set(leaves[first:].tolist()) - either == {n for n, s in expected.leaves.items() if not s} - either
    assert cut.visited_nodes == expected.visited
    if not either:
        assert cut.splat_count + cut.triangle_count == len(expected.nodes) + len(expected.leaves)
        assert cut.silhouette_count == sum(expected.nodes.values()) + sum(expected.leaves.values())


@settings(derandomize=True, deadline=None, max_examples=150)
@given(st.sampled_from(["bumpy sphere", "open sphere"]), kinds, seeds, radii, st.booleans(), st.booleans())
def test_no_visible_triangle_is_culled(name, kind, seed, radii, two_sided, printed):
    hierarchy = built(name)
    view = view_of(hierarchy, kind, seed, resolution=(20, 16))
    leaves = hierarchy.leaves
    corners = leaves.positions[leaves.indices].astype(float)
    visible = visible_triangles(corners, view)
    if hierarchy.closed and not two_sided:
        # From inside, too, only fronts are drawn.
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        visible &= heights_of_eye(view, corners[:, 0], normals) > 0.0
    # The printed test knows nothing of pixels far off the axis.
    assume(not printed or kind != "wide angle")
    cut = select_cut(hierarchy, view, *radii, two_sided=two_sided, printed_cone_test=printed)
    assert coverage(hierarchy, cut)[visible].all()


@settings(derandomize=True, deadline=None, max_examples=60)
@given(st.sampled_from(["cloud", "closed points", "two surfels"]), kinds, seeds, radii)
def test_no_visible_surfel_is_culled(name, kind, seed, radii):
    hierarchy = built(name)
    view = view_of(hierarchy, kind, seed, resolution=(20, 16))
    leaves = hierarchy.leaves
    visible = visible_discs(leaves.positions, leaves.normals, leaves.radii, view)
    if hierarchy.closed:
        visible &= heights_of_eye(view, leaves.positions, leaves.normals) > 0.0
    assert coverage(hierarchy, select_cut(hierarchy, view, *radii))[visible].all()


@pytest.mark.parametrize("name", ["terrain", "cloud", "thin sheet"])
def test_nothing_is_culled_where_openings_are_not_known(name):
    hierarchy = dataclasses.replace(built(name), openings=None)
    for seed in range(20):
        view = view_of(hierarchy, "outside", seed)
        times = coverage(hierarchy, select_cut(hierarchy, view, 1.0, 8.0))
        leaves = hierarchy.leaves
        points = leaves.positions[leaves.indices].astype(float) if name != "cloud" else leaves.positions[:, None]
        planes = clip_planes(view)
        inside = ((points @ planes[:, :3].T + planes[:, 3]) > 0.0).all(axis=2).any(axis=1)
        assert inside.any()
        assert (times[inside] == 1).all()
        assert (times <= 1).all()


@pytest.mark.parametrize("points", [False, True])
def test_an_open_surface_seen_beside_its_openings_is_drawn_as_a_closed_one(points):
    mesh = icosphere(24)
    above = mesh.positions[mesh.faces].mean(axis=1)[:, 2] > -0.97
    opened = build_hierarchy(mesh_of(mesh.positions, mesh.faces[above], normals=mesh.normals), points=points)
    assert not opened.closed
    view = look_at((0, 0, 4), (0, 0, 0), (0, 1, 0), 0.6, (400, 400), bounds=opened.bounds)
    cuts = [
        select_cut(hierarchy, view, 0.5, 8.0, two_sided=two_sided)
        for hierarchy in (dataclasses.replace(opened, closed=True), opened)
        for two_sided in (False, True)
    ]
    # Lighting from both sides draws more of a closed surface, but not of this one.
    closed, both, one_sided, two_sided = cuts
    np.testing.assert_array_equal(one_sided.splats, closed.splats)
    np.testing.assert_array_equal(one_sided.indices, closed.indices)
    np.testing.assert_array_equal(two_sided.splats, closed.splats)
    assert both.splat_count + both.triangle_count > 1.5 * (closed.splat_count + closed.triangle_count)


def test_two_sided_draws_both_sides_of_a_closed_surface():
    hierarchy = built("bumpy sphere")
    view = look_at((0, 0, 5), (0, 0, 0), (0, 1, 0), 0.8, (60, 60), bounds=hierarchy.bounds)
    one, both = (select_cut(hierarchy, view, 1.0, 4.0, two_sided=two) for two in (False, True))
    assert (coverage(hierarchy, both) == 1).all()
    assert 0.3 < coverage(hierarchy, one).mean() < 0.8


@settings(derandomize=True, deadline=None, max_examples=150)
@given(st.sampled_from(NAMES), kinds, seeds, radii, st.booleans())
def test_radii_limit_every_drawn_splat(name, kind, seed, radii, printed):
    hierarchy = built(name)
    view = view_of(hierarchy, kind, seed)
    r_sil, r_inner = radii
    cut = select_cut(hierarchy, view, r_sil, r_inner, printed_cone_test=printed)
    silhouette = np.arange(cut.splat_count) < cut.silhouette_splats
    drawn = cut.splats < hierarchy.node_count
    nodes, silhouette = hierarchy.nodes[cut.splats[drawn]], silhouette[drawn]
    offset = np.stack([nodes["x"], nodes["y"], nodes["z"]], 1) - view.eye
    depth = offset @ -view.eye_from_model[2, :3]
    pixels = view.pixels_of_unit(depth)
    # Nothing that reaches the near plane or holds the eye.
    assert (depth - nodes["sphere"] > view.near).all()
    if view.is_parallel:
        offset = np.broadcast_to(-view.eye_from_model[2, :3], offset.shape)
    else:
        assert (np.linalg.norm(offset, axis=1) > nodes["sphere"]).all()
    size = nodes["radius"] * pixels
    assert (size <= max(r_sil, r_inner) * (1 + 1e-6)).all()
    bent = nodes["print_cos"] < BENT_COSINE
    rough = nodes["relief"] * pixels > RELIEF_OF_R_SIL * r_sil
    facing = np.stack([nodes["axis_x"], nodes["axis_y"], nodes["axis_z"]], 1) * offset
    tilt = np.arccos(np.clip(facing.sum(axis=1) / np.linalg.norm(offset, axis=1), -1.0, 1.0))
    displaced = nodes["relief"] * pixels * np.sin(tilt)
    parallax = max(PARALLAX, PARALLAX_OF_R_SIL * r_sil)
    # Rounding may put what is just at the limit on either side of it.
    fine = silhouette if printed else (silhouette | bent) & rough | (displaced > parallax * (1 + 1e-4))
    assert (size[fine] <= r_sil * (1 + 1e-6)).all()
    at_limit = (np.abs(displaced - parallax) < 1e-3) & (not printed)
    assert (size[~(fine | at_limit)] <= r_inner * (1 + 1e-6)).all()


@pytest.mark.parametrize("name", NAMES)
def test_no_radius_draws_leaves_only(name):
    hierarchy = built(name)
    for seed in range(5):
        cut = select_cut(hierarchy, view_of(hierarchy, "outside", seed), 0.0, 0.0)
        assert (cut.splats >= hierarchy.node_count).all()
        assert cut.splat_count + cut.triangle_count > 0


@pytest.mark.parametrize("name", NAMES)
def test_any_radius_draws_the_root_alone(name):
    hierarchy = built(name)
    # The near plane must not touch the root's sphere, which is larger than the model's.
    cut = select_cut(hierarchy, view_of(hierarchy, "far", 3, margin=1.5), 1e9, 1e9)
    assert cut.splats.tolist() == [0]
    assert cut.visited_nodes == 1
    assert cut.triangle_count == 0


@pytest.mark.parametrize("name", NAMES)
def test_larger_radii_draw_no_more(name):
    hierarchy = built(name)
    for seed in range(5):
        view = view_of(hierarchy, "outside", seed, resolution=(200, 200))
        counts = []
        for r in (0.0, 0.5, 1.0, 2.0, 5.0, 12.0, 30.0, 100.0):
            # Nothing culled for facing away: one splat can replace leaves of which none was left.
            cut = select_cut(dataclasses.replace(hierarchy, openings=None), view, r, 4.0 * r, two_sided=True)
            counts.append((cut.splat_count + cut.triangle_count, cut.visited_nodes))
        assert counts == sorted(counts, reverse=True)


@pytest.mark.parametrize("name", ["bumpy sphere", "cloud"])
def test_a_cut_depends_on_nothing_but_its_view(name):
    hierarchy = built(name)
    view = view_of(hierarchy, "outside", 1)
    first = select_cut(hierarchy, view, 1.0, 8.0)
    select_cut(hierarchy, view_of(hierarchy, "inside", 2), 3.0, 3.0)
    again = select_cut(hierarchy, view, 1.0, 8.0)
    np.testing.assert_array_equal(first.splats, again.splats)
    np.testing.assert_array_equal(first.indices, again.indices)
    assert first.splats.dtype == first.indices.dtype == np.uint32


def test_nothing_in_view_draws_nothing():
    hierarchy = built("bumpy sphere")
    view = look_at((0, 0, 5), (0, 0, 10), (0, 1, 0), 0.8, (40, 40), bounds=hierarchy.bounds)
    cut = select_cut(hierarchy, view, 2.0, 16.0)
    assert (cut.splat_count, cut.triangle_count, cut.visited_nodes) == (0, 0, 1)
    assert cut.indices.shape == (0, 3)


def test_detail_goes_to_the_silhouette():
    """From the front the rim of a sphere is drawn finer than its middle."""
    hierarchy = build_hierarchy(bumpy_sphere(48, height=0.02))
    view = look_at((0, 0, 4), (0, 0, 0), (0, 1, 0), 0.6, (400, 400), bounds=hierarchy.bounds)
    nodes = hierarchy.nodes
    on_rim, in_middle = [], []
    for r_sil in (1.0, 0.5, 0.25, 0.1):
        cut = select_cut(hierarchy, view, r_sil, 12.0)
        rim, middle = np.split(nodes[cut.splats], [cut.silhouette_splats])
        triangles = hierarchy.leaves.positions[cut.indices[: cut.silhouette_triangles]].mean(axis=1)
        assert np.hypot(rim["x"], rim["y"]).min() > 0.8
        assert np.hypot(triangles[:, 0], triangles[:, 1]).min() > 0.8
        on_rim.append(cut.silhouette_count)
        # A unit length is 160 pixels: the middle is drawn as coarsely as r_inner allows, whatever r_sil.
        middle = middle[np.hypot(middle["x"], middle["y"]) < 0.7]
        in_middle.append(len(middle))
        assert np.median(middle["radius"]) * 160 > 6.0
        # What is spent is little beside everything that faces the eye.
        assert cut.splat_count + cut.triangle_count < 0.2 * (coverage(hierarchy, cut) > 0).sum()
    assert in_middle[0] > 100
    assert len(set(in_middle)) == 1
    assert on_rim == sorted(on_rim)
    assert on_rim[-1] > 4 * on_rim[0]


# --- classification


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


@settings(derandomize=True, deadline=None, max_examples=150)
@given(seeds, st.floats(0.0, 1.7), st.floats(0.01, 1.2), st.booleans())
def test_no_normal_of_a_cone_contradicts_its_class(seed, half_angle, share, aligned):
    rng = np.random.default_rng(seed)
    centre = rng.normal(size=3)
    # Along the line of sight both classes are common.
    axis = unit(rng.choice([-1, 1]) * unit(centre) + 0.4 * rng.normal(size=3)) if aligned else unit(rng.normal(size=3))
    distance = np.linalg.norm(centre)
    sphere = share * distance
    cosine = math.cos(half_angle) if half_angle < math.pi / 2 else EVERYTHING
    side = classify_cone(axis @ centre, distance**2, sphere, math.sin(half_angle), cosine)
    assert side == side_of_cone(axis, half_angle, centre, sphere)
    # Normals in the cone, half of them on its rim, and points of the sphere, half of them on its surface.
    across = unit(np.cross(axis, rng.normal(size=(400, 3))))
    lean = half_angle * np.where(np.arange(400) % 2, 1.0, rng.random(400))[:, None]
    normals = np.cos(lean) * axis + np.sin(lean) * across
    points = centre + sphere * unit(rng.normal(size=(400, 3))) * np.where(np.arange(400) % 4 < 2, 1, 0.5)[:, None]
    facing = (unit(points) * normals).sum(axis=1)
    if side == BACK:
        assert facing.min() >= -1e-9
    elif side == FRONT:
        assert facing.max() <= 1e-9
    elif half_angle < math.pi / 2 and share < 1.0:
        # And silhouette only where it must be: some normal somewhere faces away and another does not.
        along = math.acos(np.clip(axis @ unit(centre), -1, 1))
        spread = half_angle + math.asin(share)
        assert along - spread <= math.pi / 2 <= along + spread


def test_a_node_that_holds_the_eye_is_silhouette():
    assert classify_cone(5.0, 1.0, 1.0, 0.0, 1.0) == SILHOUETTE
    assert classify_cone(0.0, 0.0, 1.0, 0.0, 1.0) == SILHOUETTE


def test_a_cone_of_everything_is_silhouette():
    assert classify_cone(1.0, 100.0, 0.1, 0.0, EVERYTHING) == SILHOUETTE
    assert classify_cone_printed(1.0, 0.0, EVERYTHING, 0.1, 0.99) == SILHOUETTE


def test_a_flat_disc_far_away_is_front_or_back():
    assert classify_cone(-10.0, 100.0, 0.01, 0.0, 1.0) == FRONT
    assert classify_cone(10.0, 100.0, 0.01, 0.0, 1.0) == BACK
    assert classify_cone(0.0, 100.0, 0.01, 0.0, 1.0) == SILHOUETTE


@settings(derandomize=True, deadline=None, max_examples=100)
@given(seeds, st.floats(0.0, 1.7), st.floats(0.01, 3.1))
def test_the_printed_test_is_the_papers(seed, half_angle, view_angle):
    axis, sight = unit(np.random.default_rng(seed).normal(size=(2, 3)))
    cosine = math.cos(half_angle) if half_angle < math.pi / 2 else EVERYTHING
    side = classify_cone_printed(axis @ sight, math.sin(half_angle), cosine, math.sin(view_angle), math.cos(view_angle))
    assert side == side_as_printed(axis, half_angle, sight, view_angle)


# --- frustum


@settings(derandomize=True, deadline=None, max_examples=100)
@given(seeds, st.floats(0.02, 3.0), st.integers(1, 3000), st.integers(1, 3000), st.sampled_from([None, 0.01, 1.5]))
def test_frustum_planes_agree_with_the_projection(seed, view_angle, width, height, scale):
    rng = np.random.default_rng(seed)
    eye, focus, up = rng.normal(size=(3, 3))
    view = look_at(eye, focus, up, view_angle, (width, height), bounds=((0.2, 0.1, 0.0), 2.0), parallel_scale=scale)
    planes = frustum_planes(view)
    np.testing.assert_allclose(np.linalg.norm(planes[:, :3], axis=1), 1.0, rtol=1e-12)
    # Relative to the eye in frustum_planes, to the model's origin in the projection's rows.
    relative = clip_planes(view)
    relative[:, 3] += relative[:, :3] @ view.eye
    np.testing.assert_allclose(planes, relative, atol=1e-9)
    points = rng.normal(size=(200, 3)) * 3.0
    clip = np.column_stack([points, np.ones(200)]) @ (view.clip_from_eye @ view.eye_from_model).T
    margins = np.stack([clip[:, 3] + clip[:, 2], *(clip[:, 3] + s * clip[:, k] for k in (0, 1) for s in (1, -1))], 1)
    distances = (points - view.eye) @ planes[:, :3].T + planes[:, 3]
    clear = (np.abs(distances) > 1e-9).all(axis=1)
    np.testing.assert_array_equal((distances > 0.0)[clear], (margins > 0.0)[clear])


def test_thin_closed_wall_never_shows_its_hidden_side():
    hierarchy = build_hierarchy(dataclasses.replace(thin_sheet(60, 0.004), closed=True))
    view = look_at((0.3, 0.2, 3.0), (0, 0, 0), (0, 1, 0), math.radians(45.0), (1024, 1024), bounds=hierarchy.bounds)
    cut = select_cut(hierarchy, view, 2.0, 16.0)
    splats = hierarchy.splats[cut.splats]
    facing = np.einsum("ij,ij->i", splats["normal"], splats["centre"] - view.eye)
    size = splats["radius"] * view.focal_pixels / 3.0
    assert cut.splat_count + cut.triangle_count > 0
    assert not ((facing > 0) & (size > 2.0 * BOTH_SIDES)).any()
