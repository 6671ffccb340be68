"""Smallest circles, base surfels, and the discs, spheres and rectangles of nodes, toward everything that is degenerate.

Circles are found by measuring, in squared distances of some four roundings each, and a search stops within 2e-15: a
radius is too large by 2e-15 at most. Discs are measured from their stored, rounded centre and rounded up by 1e-6, and
storing and the float32 normal, by which the tangents are off unit length, add 3e-7.
"""

import math

import numpy as np
import pytest
from brute_circle import minimum_circle
from exact import smallest_circle_radius
from small_models import beside_a_far_triangle, bumpy_sphere, mesh_of, sorted_leaves

from hierarchy.boxes import TURN_STEP, TURNS, tight_box
from hierarchy.circles import smallest_circle
from hierarchy.cones import normal_cones
from hierarchy.discs import node_discs
from hierarchy.frames import tangents
from hierarchy.leaves import triangle_shapes
from hierarchy.octree import Octree
from hierarchy.planes import SUMS
from hierarchy.surfels import enclosing_disc, surfels_of_mesh

RELATIVE = 4e-15
ROUNDED_UP = 1.3e-6


@pytest.fixture(autouse=True)
def no_float_errors():
    with np.errstate(all="raise", under="ignore"):
        yield


def circle_of(points):
    circle = np.empty(3)
    smallest_circle(*np.ascontiguousarray(points.T), len(points), circle, np.empty((4, 2)))
    return circle[:2], math.sqrt(circle[2])


def flat_points(rng, kind, count):
    """Return points (N, 2) of one degenerate kind."""
    angle = rng.uniform(0.0, 2.0 * math.pi, count)
    angle[:3] = [0.1, 2.2, 4.3][: len(angle[:3])]
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    small = 10.0 ** rng.uniform(-16.0, 0.0)
    if kind == "cocircular" and count > 2:
        return rng.permutation(circle)
    if kind == "collinear":
        along = rng.uniform(-1.0, 1.0, count)
        along[:2] = [-1.0, 1.0][: len(along[:2])]
        return rng.permutation(along[:, None] * circle[-1:])
    if kind == "nearly collinear":
        return rng.uniform(-1.0, 1.0, (count, 2)) * [1.0, small]
    if kind == "two clusters":
        return np.where(rng.random((count, 1)) < 0.5, [1.0, 0.0], [0.0, 0.0]) + small * rng.normal(size=(count, 2))
    if kind == "cluster and far":
        points = small * rng.normal(size=(count, 2))
        points[-1] = [1.0, 0.0]
        return points
    return rng.normal(size=(count, 2))


@pytest.mark.parametrize(
    "kind", ["cocircular", "collinear", "nearly collinear", "two clusters", "cluster and far", "any"]
)
def test_smallest_circles(ledger, amount, rng, kind):
    count, wider, outside = amount(150, 4_000), 0.0, 0.0
    for _ in range(count):
        points = flat_points(rng, kind, int(rng.choice([1, 2, 3, 4, 6, 9])))
        points = points * 2.0 ** rng.integers(-60, 60)
        if rng.random() < 0.5:
            points = np.repeat(points, 2, axis=0)
        centre, found = circle_of(points)
        _, smallest = minimum_circle(points)
        wider = max(wider, found / smallest - 1.0 if smallest > 0.0 else found)
        # The centre is relative to the first point, and rounded once more where that is added.
        reach = np.linalg.norm(points - centre, axis=1).max()
        outside = max(outside, (reach - found) / max(np.abs(points).max(), 1e-300))
    tried = (
        "collinear, cocircular, repeated, two clusters 1e-16 wide, one point far from the others, 2^-60 to 2^60 in size"
    )
    row = ("kernels", "smallest circles, beyond the optimum", tried)
    ledger.record(*row, cases=count, worst=wider, bound=RELATIVE, unit="of the radius")
    row = ("kernels", "smallest circles, points outside", "the same, relative to the coordinates")
    ledger.record(*row, cases=count, worst=max(outside, 0.0), bound=RELATIVE, unit="")


def triangles(rng, count):
    """Return triangles (N, 3, 3): needles, flat and right-angled ones, of all sizes, far from the origin or not."""
    height = 10.0 ** rng.uniform(-15.0, 0.0, count)
    base = rng.normal(size=(count, 3, 3))
    flat = np.zeros((count, 3, 3))
    flat[:, 1, 0] = 1.0
    flat[:, 2, 0] = rng.choice([0.0, 0.5, 1.0, 0.3, 1.5], count)
    flat[:, 2, 1] = height
    needle = np.zeros((count, 3, 3))
    needle[:, 0, 1], needle[:, 1, 1], needle[:, 2, 0] = height, -height * rng.uniform(0.0, 1.0, count), 1.0
    regular = height[:, None, None] * np.array([[1, 0, 0], [-0.5, 0.75**0.5, 0], [-0.5, -(0.75**0.5), 0]]) + base[:, :1]
    kind = rng.integers(0, 4, count)
    corners = np.choose(kind[:, None, None], [base, flat, needle, regular])
    turned = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]
    # Off the axes every second time: there the corners of the simple ones are rounded.
    corners = np.where((np.arange(count) % 2 == 0)[:, None, None], corners @ turned, corners)
    return corners[:, rng.permutation(3)]


def test_smallest_circles_of_triangles(ledger, amount, rng):
    """Needles of a base of 1e-8 once got a disc of half their length that left out the tip."""
    count, wider, outside = amount(300, 12_000), 0.0, 0.0
    for corners in np.ascontiguousarray(triangles(rng, count)):
        weights = np.empty(3)
        radius = enclosing_disc(corners, weights)
        assert weights.min() >= 0.0
        assert abs(weights.sum() - 1.0) <= 4e-16
        smallest = smallest_circle_radius(corners)
        if smallest == 0:
            continue
        # Relative to a corner, as the coordinates of the sum are rounded.
        edges = corners - corners[0]
        reach = np.linalg.norm(edges - weights @ edges, axis=1).max()
        wider = max(wider, float(radius / smallest - 1))
        outside = max(outside, float(reach / radius) - 1.0)
    tried = "needles, flat, right-angled and regular triangles, 1e-15 to 1, against exact rationals"
    row = ("kernels", "circles around triangles, beyond the optimum", tried)
    ledger.record(*row, cases=count, worst=max(wider, 0.0), bound=RELATIVE, unit="of the radius")
    row = ("kernels", "circles around triangles, corners outside", tried)
    ledger.record(*row, cases=count, worst=max(outside, 0.0), bound=RELATIVE, unit="of the radius")


def leaves_of(rng, count):
    """Return LeafShapes of `count` ranges of four leaves each: triangles that are degenerate in every way."""
    corners = triangles(rng, 4 * count).reshape(count, 4, 3, 3)
    spread = 10.0 ** rng.uniform(-8.0, 0.0, (count, 1, 1, 1))
    corners = spread * corners + (rng.random((count, 1, 1, 1)) < 0.5) * rng.normal(size=(count, 1, 1, 3))
    kind = rng.integers(0, 6, count)
    # Pairs that cancel, all in one place, all collinear.
    corners[kind == 0, 2:] = corners[kind == 0, :2, ::-1]
    corners[kind == 1] = corners[kind == 1, :1, :1]
    corners[kind == 2] = corners[kind == 2, :1, :1] + corners[kind == 2][..., :1] * [1.0, 2.0, -0.5]
    positions = corners.reshape(-1, 3).astype(np.float32)
    mesh = mesh_of(
        positions, np.arange(len(positions)).reshape(-1, 3), normals=np.tile([0.0, 0.0, 1.0], (len(positions), 1))
    )
    return mesh


def discs_of(shapes, size):
    begin = np.arange(0, len(shapes.areas) - size + 1, size, dtype=np.int32)
    axes, _ = normal_cones(shapes.normals, begin, begin + size)
    childless = np.zeros(len(begin), np.int32)
    return node_discs(shapes, Octree(childless, childless, begin, begin + size), axes, np.empty((len(axes), SUMS)))


def unsorted(mesh):
    """Return the shapes of a mesh's triangles in the order of its faces."""
    return triangle_shapes(mesh.positions, mesh.faces)


def test_discs_spheres_and_rectangles_hold_what_is_below_them(ledger, amount, rng):
    count = amount(2_000, 60_000)
    shapes = unsorted(leaves_of(rng, count))
    centres, normals, sizes, boxes = discs_of(shapes, 4)
    for array in (centres, normals, sizes, boxes):
        assert np.isfinite(array).all()
    corners = shapes.positions[shapes.indices].astype(np.float64).reshape(count, 12, 3)
    frames = np.array([tangents(*n) for n in normals.astype(np.float64).tolist()]).reshape(count, 2, 3)
    offset = corners - centres[:, None].astype(np.float64)
    u, v = (np.einsum("nkx,nx->nk", offset, frames[:, k]) for k in range(2))
    height = np.einsum("nkx,nx->nk", offset, normals.astype(np.float64))
    radius, thickness, sphere = sizes.T.astype(np.float64)
    # Nothing is added for where a model lies, only for storing: what is outside is so by rounding of doubles.
    rounding = 1e-15 * np.abs(corners).max(axis=(1, 2))
    outside = {
        "disc": np.hypot(u, v).max(axis=1) - radius,
        "thickness": np.abs(height).max(axis=1) - thickness,
        "sphere": np.linalg.norm(offset, axis=2).max(axis=1) - sphere,
    }
    tried = "four triangles: needles, zero areas, all in one place, collinear, cancelling normals, 1e-23 to 1 in size"
    for name, out in outside.items():
        row = ("kernels", f"a node's {name}, corners outside", tried)
        ledger.record(*row, cases=count, worst=max((out - rounding).max(), 0.0), bound=0.0, unit="")
    assert (sphere >= radius * (1.0 - 1e-7)).all()
    boxes = boxes.astype(np.float64)
    turn = np.rint(boxes[:, 3] / TURN_STEP)
    assert np.isin(turn, np.arange(TURNS)).all()
    c, s = np.cos(0.5 * np.pi * turn / TURNS)[:, None], np.sin(0.5 * np.pi * turn / TURNS)[:, None]
    some = radius > 0.0
    scale = np.where(some, radius, 1.0)[:, None]
    across, up = (c * u + s * v) / scale, (c * v - s * u) / scale
    left, right, low, high = boxes.T
    high = high - TURN_STEP * turn
    out = np.stack([left - across.min(1), across.max(1) - right, low - up.min(1), up.max(1) - high]).max(axis=0)
    out = np.where(some, out - rounding / scale[:, 0], 0.0)
    ledger.record(
        "kernels", "a node's rectangle, corners outside", tried, cases=count, worst=max(out.max(), 0.0), bound=0.0
    )
    # No larger than the optimum either, where storing the centre does not matter.
    wider = 0.0
    for k in np.flatnonzero(radius > 1e-3 * np.abs(centres).max(axis=1))[: amount(100, 2_000)]:
        _, smallest = minimum_circle(np.stack([u[k], v[k]], axis=1))
        moved = 1e-7 * np.abs(centres[k]).sum()
        wider = max(wider, (radius[k] - moved) / smallest - 1.0)
    row = ("kernels", "a node's disc, beyond the optimum", "the same, beyond the rounding of its stored centre")
    ledger.record(*row, cases=amount(100, 2_000), worst=max(wider, 0.0), bound=ROUNDED_UP, unit="of the radius")


@pytest.mark.parametrize("exponent", [-66, -40, -1, 1, 40, 66])
def test_kernels_do_not_depend_on_the_scale_of_a_model(rng, exponent):
    """2^-66 is 1.4e-20: squares of such lengths do not fit into float32."""
    scale = np.float32(2.0**exponent)
    # None of its triangles is big enough to be split into base surfels, which takes its time.
    model = beside_a_far_triangle(bumpy_sphere(6))
    scaled = mesh_of(model.positions * scale, model.faces, normals=model.normals)
    for first, second in ((model, scaled), (surfels_of_mesh(model), surfels_of_mesh(scaled))):
        shapes, other = sorted_leaves(first)[1], sorted_leaves(second)[1]
        np.testing.assert_array_equal(other.normals, shapes.normals)
        np.testing.assert_array_equal(other.areas, shapes.areas * np.float64(scale) ** 2)
        np.testing.assert_array_equal(other.extents, shapes.extents * scale)
        size = len(shapes.areas) // 8
        expected, found = discs_of(shapes, size)[:4], discs_of(other, size)[:4]
        np.testing.assert_array_equal(found[0], expected[0] * scale)
        np.testing.assert_array_equal(found[1], expected[1])
        np.testing.assert_array_equal(found[2], expected[2] * scale)
        np.testing.assert_array_equal(found[3], expected[3])


def test_base_surfels_cover_needles_far_from_the_origin(ledger, amount, rng):
    count = amount(2_000, 60_000)
    mesh = leaves_of(rng, count // 4)
    # One triangle far out, so that none is split.
    far = np.array([[1e4, 0, 0], [1e4, 0.01, 0], [1e4, 0, 0.01]], np.float32)
    positions = np.concatenate([mesh.positions, far])
    faces = np.arange(len(positions), dtype=np.int32).reshape(-1, 3)
    normals = rng.normal(size=(len(positions), 3))
    normals[::5] = -normals[::5]
    cloud = surfels_of_mesh(mesh_of(positions, faces, normals=normals / np.linalg.norm(normals, axis=1)[:, None]))
    for array in (cloud.positions, cloud.normals, cloud.radii):
        assert np.isfinite(array).all()
    assert np.abs(np.linalg.norm(cloud.normals, axis=1) - 1.0).max() < 1e-6
    corners = positions[faces].astype(np.float64)
    reach = np.linalg.norm(corners - cloud.positions[:, None].astype(np.float64), axis=2).max(axis=1)
    ledger.record(
        "kernels",
        "base surfels, corners outside",
        "needles and triangles of no area, 1e-23 to 1 in size, beside the origin and far from it",
        cases=len(faces),
        worst=max((reach - cloud.radii).max(), 0.0),
        bound=0.0,
    )


def test_a_triangle_of_no_area_whose_normals_cancel_has_a_surfel():
    flat = mesh_of([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], normals=[[0, 1, 0], [0, 0, 1], [0, -1, 0]])
    cloud = surfels_of_mesh(flat)
    assert np.linalg.norm(cloud.normals, axis=1) == pytest.approx(1.0)
    shapes = sorted_leaves(cloud)[1]
    assert np.isfinite(discs_of(shapes, len(shapes.areas))[2]).all()


def test_the_last_end_of_a_rectangle_keeps_its_digits(ledger, amount, rng):
    """It is stored with the turn added: float32 then has steps of 1.9e-6 of the radius."""
    worst, count = 0.0, amount(1_000, 30_000)
    for _ in range(count):
        points = rng.uniform(-0.7, 0.7, (3, 2)) * 10.0 ** rng.uniform(-3.0, 0.0, 2)
        box = np.empty(4, np.float32)
        tight_box(*np.ascontiguousarray(points.T), 3, 0.0, 0.0, 1.0, box, np.empty((TURNS, 4)))
        turn = np.rint(box[3] / TURN_STEP)
        angle = 0.5 * math.pi * turn / TURNS
        up = points @ [-math.sin(angle), math.cos(angle)]
        worst = max(worst, up.max() - (np.float64(box[3]) - TURN_STEP * turn))
    row = ("kernels", "rectangles, corners outside", "three points anywhere in a disc")
    ledger.record(*row, cases=count, worst=max(worst, 0.0), bound=1e-15, unit="of the radius")
