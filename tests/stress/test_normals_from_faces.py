"""Area vectors, angle-weighted normals, volumes, spreads, and normals in files that are none.

Differences of float32 coordinates and their products are exact in doubles as long as a difference has 26 digits, so an
area vector is rounded once; beyond that it is off by four roundings of the product of its sides at most.
"""

import math

import numpy as np
import pytest
from exact import angle_weighted_normal, cross, face_vectors, rational, six_volumes
from small_models import bumpy_sphere, mesh_of

from hierarchy.area_vector import area_vector
from hierarchy.build import build_hierarchy
from hierarchy.creases import smooth_groups
from hierarchy.mesh_normals import NEGLIGIBLE, SHORTEST_NORMAL, unit_or_bad
from hierarchy.noise import noise
from hierarchy.sides import most_area_disagrees, signed_volume
from hierarchy.spreads import UNIT
from hierarchy.vertex_normals import vertex_normals

EPSILON = 2.0**-53


@pytest.fixture(autouse=True)
def no_float_errors():
    with np.errstate(all="raise"):
        yield


def slivers(rng, count, digits):
    """Return corners (N, 3, 3) of triangles that nearly are lines, with coordinates of so many binary digits."""
    start, end = rng.integers(-(2**digits), 2**digits, (2, count, 3))
    share = rng.uniform(-0.5, 1.5, (count, 1))
    third = np.rint(start + share * (end - start)) + rng.integers(-1, 2, (count, 3))
    return np.stack([start, end, third], axis=1)


def test_area_vectors_of_slivers(ledger, amount, rng):
    count = amount(1_500, 40_000)
    close = slivers(rng, count, 23)
    spread = close * 2.0 ** rng.integers(-20, 1, (count, 1, 1))
    spread[:, 0] = close[:, 0]
    for name, corners, bound in (("as exact as float32", close, 1.0), ("over 2^20 in size", spread, 4.0)):
        positions = corners.reshape(-1, 3).astype(np.float32)
        faces = np.arange(len(positions)).reshape(-1, 3)
        found = np.array([area_vector(positions, *face) for face in faces])
        exact = face_vectors(positions, faces)
        sides = positions.astype(np.float64)[faces]
        lengths = np.linalg.norm(sides[:, 1] - sides[:, 0], axis=1) * np.linalg.norm(sides[:, 2] - sides[:, 0], axis=1)
        off = np.abs((rational(found) - exact).astype(np.float64)).max(axis=1) / np.maximum(lengths, 1e-300)
        tried = "triangles that nearly are lines, against exact rationals; relative to the product of two sides"
        row = ("kernels", f"area vectors {name}", tried)
        ledger.record(*row, cases=count, worst=off.max() / EPSILON, bound=bound, unit="of 1.1e-16")
        if name == "as exact as float32":
            # Not a single sign is wrong where differences have up to 25 digits.
            assert (np.sign(found) == np.sign(exact.astype(np.float64))).all()


def fan(rng, count, height):
    """Return positions and faces of needles with tips of the same angle around vertex 0."""
    angle = np.sort(rng.uniform(0.0, 0.5 * math.pi, count))
    first = np.stack([np.cos(angle), np.sin(angle), rng.normal(size=count)], axis=1)
    second = first + height * rng.normal(size=(count, 3))
    positions = np.concatenate([np.zeros((1, 3)), first, second])
    faces = np.stack([np.zeros(count), np.arange(count) + 1, np.arange(count) + 1 + count], axis=1)
    return positions, faces.astype(np.int32)


def test_vertex_normals_at_the_tips_of_needles(ledger, amount, rng):
    """Below 1e-9 radians a tip counted for nothing, or for the rounding of pi."""
    count, worst = amount(60, 2_000), 0.0
    for _ in range(count):
        positions, faces = fan(rng, int(rng.integers(1, 5)), 10.0 ** rng.uniform(-11.0, 0.0))
        exact = angle_weighted_normal(positions, faces, 0)
        total = np.abs([angle_weighted_normal(positions, face[None], 0)[3] for face in faces]).sum()
        if exact[3] < 1e-3 * total:
            continue
        found = vertex_normals(positions, faces)[0].astype(np.float64)
        # What the normal of one needle is off by, in radians: the rounding of its area over the area.
        worst = max(worst, np.linalg.norm(found - exact[:3]) - 1e-12)
    row = (
        "kernels",
        "vertex normals of needles",
        "fans of 1 to 4 needles with tips from 1e-11 to 1, against 60 digits",
    )
    # A float32 direction is off by 3^0.5 halves of a last place, and a sum that is 1e-3 of its parts by 1e3 roundings.
    ledger.record(*row, cases=count, worst=worst, bound=1.1e-7, unit="radians")


def test_vertex_normals_of_the_tip_of_one_needle(rng):
    for digits in range(1, 12):
        positions = np.array([[0, 0, 0], [1, 0, 0], [1, 10.0**-digits, 0]])
        np.testing.assert_allclose(vertex_normals(positions, np.array([[0, 1, 2]])), [[0, 0, 1]] * 3, atol=1e-7)
        bent = np.concatenate([positions, [[0, 1, 0], [0, 1, 10.0**-digits]]])
        tips = vertex_normals(bent, np.array([[0, 1, 2], [0, 3, 4]]))
        np.testing.assert_allclose(tips[0], [0.5**0.5, 0, 0.5**0.5], atol=1e-7)


def test_vertex_normals_are_unit_whatever_the_faces(ledger, amount, rng):
    count = amount(2_000, 60_000)
    positions = rng.normal(size=(count, 3)) * 10.0 ** rng.uniform(-20, 20, (count, 1))
    positions[::3] = positions[::3].round()
    faces = rng.integers(0, count, (2 * count, 3)).astype(np.int32)
    # Opposite faces, repeated ones, some without an area.
    faces = np.concatenate([faces, faces[::2, ::-1], faces[:9], np.repeat(faces[:50, :1], 3, axis=1)])
    normals = vertex_normals(positions.astype(np.float32), faces)
    off = np.abs(np.linalg.norm(normals.astype(np.float64), axis=1) - 1.0).max()
    tried = "any faces over vertices of 1e-20 to 1e20; opposite, repeated and without an area"
    row = ("kernels", "vertex normals, length", tried)
    ledger.record(*row, cases=count, worst=off, bound=1.2e-7, unit="off 1")


def closed_mesh(rng, frequency, flatness):
    model = bumpy_sphere(frequency)
    turned = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    moved = (model.positions * [1.0, 1.0, flatness]) @ turned + rng.choice([0.0, 1.0, 100.0]) * rng.normal(size=3)
    return moved.astype(np.float32), model.faces


def test_volumes_of_flat_and_of_distant_solids(ledger, amount, rng):
    count, worst = amount(20, 400), 0.0
    for _ in range(count):
        positions, faces = closed_mesh(rng, int(rng.integers(1, 4)), 10.0 ** rng.uniform(-9.0, 0.0))
        exact = six_volumes(positions, faces)
        a, b, c = np.moveaxis(positions.astype(np.float64)[faces] - positions[0].astype(np.float64), 1, 0)
        a, b, c = np.abs(a), np.abs(b), np.abs(c)
        terms = a * (b[:, [1, 2, 0]] * c[:, [2, 0, 1]] + b[:, [2, 0, 1]] * c[:, [1, 2, 0]])
        allowed = EPSILON * (len(faces) + 4) * terms.sum()
        found = signed_volume(positions, faces)
        worst = max(worst, abs(float(rational([found])[0] - exact)) / allowed)
        if abs(exact) > 2 * allowed:
            assert (found > 0.0) == (exact > 0)
    tried = "closed meshes 1e-9 to 1 thick, to 100 sizes off, against exact rationals; the sign is right beyond this"
    row = ("kernels", "signed volumes", tried)
    ledger.record(*row, cases=count, worst=worst, bound=1.0, unit="of N + 4 roundings of its terms")


def test_small_nodes_beside_large_primitives_keep_their_spreads(ledger, amount, rng):
    """As differences of running sums they were off by up to 81 degrees."""
    worst, count = 0.0, 0
    for exponent in (0, 6, 8, 10, 12):
        small = bumpy_sphere(int(rng.integers(2, 5)))
        first = len(small.positions)
        positions = np.concatenate([small.positions * 10.0**-exponent, [[-1, -1, 0], [1, -1, 0], [0, 1, 0]]])
        faces = np.concatenate([small.faces, [[first, first + 1, first + 2]]])
        normals = np.concatenate([small.normals, [[0.0, 0.0, 1.0]] * 3])
        hierarchy = build_hierarchy(mesh_of(positions, faces, normals=normals))
        leaves = hierarchy.leaves
        for node in range(hierarchy.node_count):
            begin, end = hierarchy.nodes["leaf_begin"][node], hierarchy.nodes["leaf_end"][node]
            corners = leaves.positions[leaves.indices[begin:end]].astype(np.float64)
            area = np.linalg.norm(cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
            mean = leaves.normals[leaves.indices[begin:end]].astype(np.float64).mean(axis=1)
            length = np.linalg.norm((mean * area[:, None]).sum(axis=0)) / area.sum()
            spread = math.sqrt(max(2.0 * (1.0 - length), 0.0))
            worst, count = max(worst, abs(spread - UNIT * hierarchy.spreads[node, 0])), count + 1
    # Half a unit, and 1 - length rounded: 1e-15 where it is smallest.
    row = ("kernels", "spreads of normals", "nodes of a rough sphere 1 to 1e-12 in size beside one large triangle")
    ledger.record(*row, cases=count, worst=worst, bound=0.51 * UNIT + 3e-7, unit="radians")


ODD = [
    [0.0, 0.0, 0.0],
    [math.nan, 0.0, 1.0],
    [math.inf, 1.0, 0.0],
    [-math.inf, math.nan, 0.0],
    [SHORTEST_NORMAL, 0.0, 0.0],
    [1e-300, 0.0, 0.0],
]


def test_normals_in_files_are_unit_or_bad(ledger, amount, rng):
    count = amount(20_000, 500_000)
    normals = rng.normal(size=(count, 3)) * 10.0 ** rng.uniform(-5.0, 307.0, (count, 1))
    with np.errstate(under="ignore"):
        normals[::2] *= 10.0 ** rng.uniform(-320.0, 0.0, (len(normals[::2]), 3))
    normals = np.concatenate([ODD, normals])
    unit, bad = unit_or_bad(normals)
    largest = np.abs(normals).max(axis=1)
    np.testing.assert_array_equal(bad, ~(np.isfinite(largest) & (largest > SHORTEST_NORMAL)))
    assert bad[: len(ODD)].all()
    assert np.isfinite(unit).all()
    good = ~bad
    off = np.abs(np.linalg.norm(unit[good].astype(np.float64), axis=1) - 1.0).max()
    row = ("kernels", "normals in files", "zero, not finite, components from 5e-324 to 1e307: off unit length")
    ledger.record(*row, cases=count, worst=off, bound=1.2e-7, unit="")
    leading = np.take_along_axis(normals, np.abs(np.where(good[:, None], normals, 0.0)).argmax(axis=1)[:, None], axis=1)
    kept = np.take_along_axis(unit, np.abs(np.where(good[:, None], normals, 0.0)).argmax(axis=1)[:, None], axis=1)
    assert (np.sign(leading[good]) == np.sign(kept[good])).all()
    assert (np.abs(unit[unit != 0.0]) > 0.5 * NEGLIGIBLE).all()


def test_normals_that_are_none_do_not_turn_a_mesh_round(rng):
    model = bumpy_sphere(3)
    normals = model.normals.copy()
    bad = rng.random(len(normals)) < 0.5
    normals[bad] = -normals[bad]
    assert not most_area_disagrees(model.positions, model.faces, normals, bad)
    for scale in (1e-20, 1e20):
        assert most_area_disagrees((model.positions * scale).astype(np.float32), model.faces, -normals, bad)


@pytest.mark.parametrize("exponent", [-66, -1, 66])
def test_creases_do_not_depend_on_the_scale(exponent):
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], np.float32)
    faces = np.array(
        [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4], [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6],
         [1, 3, 5], [3, 7, 5]], np.int32)  # fmt: skip
    groups, count = smooth_groups(corners, faces)
    scaled, scaled_count = smooth_groups(corners * np.float32(2.0**exponent), faces)
    assert count == scaled_count == 24
    np.testing.assert_array_equal(groups, scaled)


def test_noise_is_continuous_over_the_lattice(ledger, amount, rng):
    count = amount(2_000, 40_000)
    at = rng.integers(-1000, 1000, (count, 3)) + np.where(rng.random((count, 3)) < 0.5, 0.0, rng.random((count, 3)))
    step = 10.0 ** rng.uniform(-18.0, -3.0, (count, 1)) * rng.choice([-1.0, 1.0], (count, 3))
    here = np.array([noise(*p, 3) for p in at.tolist()])
    there = np.array([noise(*p, 3) for p in (at + step).tolist()])
    moved = np.linalg.norm((at + step) - at, axis=1)
    # The fade has a slope of 15/8 and the gradients a length of 2^0.5: no more than 7 along any axis.
    slope = np.abs(there - here) / np.maximum(moved, 1e-14)
    row = ("kernels", "noise of the built-in model", "on and beside the lattice's planes, edges and points: its slope")
    ledger.record(*row, cases=count, worst=slope.max(), bound=7.0, unit="")
    assert np.abs(here).max() <= 1.1
