"""Lines through the surface: tiles without cracks, along walls and through edges and corners, and winding numbers.

Two triangles work out their shared edge by expressions that are exactly opposite, so a line through it meets one of the
two, and what is interpolated stays between a triangle's corners. A winding number counts crossings in the same way; it
can only be wrong for a place that is nearer to the surface than its coordinates are rounded.
"""

import math

import numpy as np
import pytest
from brute_tile import Disc, texel_positions, tile_of_surfels, tile_of_triangles
from small_models import bumpy_sphere, cloud_of, grid, mesh_of, surfel_sphere, turned

from hierarchy.build import build_hierarchy
from hierarchy.encoding import decode_hemisphere
from hierarchy.frames import tangents
from hierarchy.kernel import SHARPNESS
from hierarchy.leaves import Triangles
from hierarchy.normal_tiles import bake_tiles
from hierarchy.winding import signed_crossing, turn, winding_numbers

ENCODING = 0.5526


@pytest.fixture(autouse=True)
def no_float_errors():
    with np.errstate(all="raise", under="ignore"):
        yield


def disc_of(hierarchy, node):
    splat = hierarchy.splats[node]
    normal = splat["normal"].astype(float)
    o1, o2 = np.array(tangents(*normal)).reshape(2, 3)
    return Disc(splat["centre"].astype(float), normal, float(splat["radius"]), o1, o2)


def decoded(hierarchy, tiles, node):
    """Return a tile's normals (w, w, 3) in model space, and which texels are the disc's own normal."""
    disc, codes = disc_of(hierarchy, node), tiles.normal_codes(node)
    return decode_hemisphere(codes) @ np.stack([disc.o1, disc.o2, disc.normal]), (codes == 128).all(axis=-1)


def degrees(a, b):
    return np.degrees(2.0 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1)))


LEAN = np.array([0.48, 0.36, 0.8])


def lattice(n, rng, kind):
    """Return a square surface over [-1, 1]^2 with its vertices under texels: flat, in steps, with walls, or slivers."""
    positions, faces = grid(n)
    if kind == "steps":
        positions[:, 2] = 0.1 * (np.arange(len(positions)) % 2)
    if kind == "walls":
        # Every second column is moved onto the one before, but for a last place or none: walls seen edge-on.
        column = np.rint((positions[:, 0] + 1.0) * n / 2.0).astype(int)
        wall = (column % 2 == 1) & (column < n)
        positions[wall, 0] = 2.0 * (column[wall] - 1) / n - 1.0 + rng.choice([0.0, 1e-16, 1e-12, 1e-7])
        positions[column % 4 >= 2, 2] = 0.05
    if kind == "slivers":
        positions[:, 1] = np.sign(positions[:, 1]) * np.abs(positions[:, 1]) ** 9
    return positions, faces


@pytest.mark.parametrize("kind", ["flat", "steps", "walls", "slivers"])
def test_no_texel_falls_between_two_triangles(ledger, amount, rng, kind):
    """All normals lean alike, so a texel that hits nothing, or what is beyond a triangle's corners, shows."""
    cracks, worst, cases = 0, 0.0, 0
    for n, w in [(8, 9), (16, 16), (4, 5)] + [
        (int(rng.integers(2, 20)), int(rng.integers(2, 34))) for _ in range(amount(0, 60))
    ]:
        positions, faces = lattice(n, rng, kind)
        if rng.random() < 0.5:
            positions = positions * 2.0 ** rng.integers(-40, 40)
        size = np.abs(positions).max()
        hierarchy = build_hierarchy(mesh_of(positions, faces, normals=np.tile(LEAN, (len(positions), 1))))
        tiles = bake_tiles(hierarchy, w)
        for node in range(hierarchy.node_count):
            disc = disc_of(hierarchy, node)
            if disc.normal[2] < 0.5:
                continue
            normals, own = decoded(hierarchy, tiles, node)
            at = texel_positions(disc, w)
            # Only along +z it is known what a line meets; others lean by the steps.
            inside = np.abs(at[..., :2]).max(axis=-1) < (1.0 - 1e-5) * size if disc.normal[2] > 1.0 - 1e-9 else ~own
            # What no lookup inside the disc touches need not be baked.
            inside &= np.linalg.norm(at - disc.centre, axis=-1) <= disc.radius
            cracks += (inside & own).sum()
            worst = max(worst, np.where(own, 0.0, degrees(normals, LEAN)).max())
            cases += inside.sum()
    tried = (
        "lattices whose corners and edges lie under texels; walls seen edge-on, steps, slivers; 2^-40 to 2^40 in size"
    )
    ledger.record("kernels", "tiles, texels that fall through", tried, cases=cases, worst=cracks, bound=0)
    row = ("kernels", "tiles, where all normals are the same", tried)
    ledger.record(*row, cases=cases, worst=worst, bound=ENCODING, unit="degrees")


def rough(rng):
    # Higher lobes, or flatter in float32, would pass through each other.
    model = bumpy_sphere(int(rng.integers(2, 4)), float(rng.uniform(0.0, 0.35)))
    squeezed = turned(model.positions, int(rng.integers(1000))) * [1.0, 1.0, 10.0 ** rng.uniform(-2.0, 0.0)]
    return mesh_of(squeezed + rng.choice([0.0, 1.0]) * rng.normal(size=3), model.faces, closed=True)


def grazing(rng):
    """Return surfels of which many are seen nearly edge-on by others."""
    sphere = surfel_sphere(80, int(rng.integers(1000)))
    normals = sphere.normals + 10.0 ** rng.uniform(-3.0, 1.0) * rng.normal(size=sphere.normals.shape)
    return cloud_of(sphere.positions * [1.0, 1.0, 10.0 ** rng.uniform(-4.0, 0.0)], normals, sphere.radii)


def reach_of(hierarchy, node, texels):
    me = hierarchy.nodes[node]
    beyond = min(math.sqrt(2.0), 1.0 + 2.0 * math.sqrt(2.0) / max(texels - 1, 1))
    return max(float(me["sphere"]), float(me["radius"]) * beyond)


@pytest.mark.parametrize("make", [rough, grazing])
def test_tiles_are_those_of_the_papers_sums(ledger, amount, rng, make):
    """Texel by texel in doubles, moved by 1e-9 of the disc either way: where that matters, either is right."""
    worst, cases, texels = 0.0, 0, 6
    for _ in range(amount(2, 40)):
        hierarchy = build_hierarchy(make(rng))
        tiles, leaves = bake_tiles(hierarchy, texels), hierarchy.leaves
        for node in rng.permutation(hierarchy.node_count)[:4]:
            disc = disc_of(hierarchy, node)
            found, own = decoded(hierarchy, tiles, node)
            off = np.full((texels, texels), np.inf)
            for step in (0.0, 1e-9, -1e-9):
                near = Disc(
                    disc.centre + step * disc.radius * (disc.o1 + 0.7 * disc.o2), *list(vars(disc).values())[1:]
                )
                for reach in (reach_of(hierarchy, node, texels), np.inf):
                    if isinstance(leaves, Triangles):
                        corners, normals = leaves.positions[leaves.indices], leaves.normals[leaves.indices]
                        exact, hit = tile_of_triangles(
                            near, texels, corners.astype(float), normals.astype(float), reach=reach
                        )
                    else:
                        arrays = (
                            leaves.positions.astype(float),
                            leaves.normals.astype(float),
                            leaves.radii.astype(float),
                        )
                        kernel = lambda distance, radius: np.exp(-SHARPNESS * (distance / radius) ** 2)  # noqa: E731
                        exact, hit = tile_of_surfels(near, texels, *arrays, kernel, reach=reach)
                    # What leans below the disc is kept on its rim.
                    local = exact @ np.stack([disc.o1, disc.o2, disc.normal], axis=1)
                    local[..., 2] = np.maximum(local[..., 2], 0.0)
                    local /= np.maximum(np.linalg.norm(local, axis=-1, keepdims=True), 1e-30)
                    exact = local @ np.stack([disc.o1, disc.o2, disc.normal])
                    off = np.minimum(off, np.where(hit | own, degrees(found, exact), np.inf))
            worst, cases = max(worst, off.max()), cases + texels**2
    tried = "squeezed rough spheres and surfels at grazing angles, texel by texel in doubles"
    row = ("kernels", "tiles against the papers' sums", tried)
    ledger.record(*row, cases=cases, worst=worst, bound=ENCODING, unit="degrees")


def test_winding_numbers_beside_the_surface(ledger, amount, rng):
    """Just outside and just inside a closed surface, beside its faces, edges and corners."""
    wrong, cases = 0, 0
    for _ in range(amount(3, 60)):
        model = rough(rng)
        points, faces = turn(model.positions), model.faces
        corners = points[faces]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        weights = rng.dirichlet(np.full(3, 0.2), len(faces))
        weights[weights < 1e-3] = 0.0
        weights /= weights.sum(axis=1, keepdims=True)
        on = np.einsum("nk,nkx->nx", weights, corners)
        # Only in the middle of a face its own plane alone says which side is out.
        middle = weights.min(axis=1) > 1e-2
        distance = 1e-13 * np.abs(points).max() * 10.0 ** rng.uniform(0.0, 3.0, (len(faces), 1))
        outside = winding_numbers(points, faces, np.ascontiguousarray(on + distance * normal))
        inside = winding_numbers(points, faces, np.ascontiguousarray(on - distance * normal))
        wrong += (outside[middle] != 0).sum() + (inside[middle] != 1).sum()
        # Beside edges and corners it is one or the other, never a crossing lost or counted twice.
        wrong += (~np.isin(np.concatenate([outside, inside]), [0, 1])).sum()
        cases += 2 * len(faces)
    tried = "1e-13 to 1e-10 of a model beside faces, edges and corners, on both sides; squeezed to 1e-2: wrong numbers"
    ledger.record("kernels", "winding numbers", tried, cases=cases, worst=wrong, bound=0)


def test_triangles_along_a_ray_are_crossed_between_their_corners(ledger, amount, rng):
    """Of a triangle seen edge-on the crossing could lie anywhere: the ratio of two small areas."""
    worst, crossed, count = 0.0, 0, amount(30_000, 600_000)
    width = 10.0 ** rng.uniform(-30.0, 0.0, count)
    angle, share = rng.uniform(0.0, math.pi, count), rng.normal(size=(3, count))
    across = np.stack([-np.sin(angle), np.cos(angle)])
    at = (
        share[:, None] * np.stack([np.cos(angle), np.sin(angle)])
        + (width * rng.normal(size=(3, count)))[:, None] * across
    )
    z = rng.normal(size=(3, count))
    for k in range(count):
        corner = [float(value) for j in range(3) for value in (at[j, 0, k], at[j, 1, k], z[j, k])]
        sign, depth = signed_crossing(*corner)
        back, same = signed_crossing(*corner[6:], *corner[3:6], *corner[:3])
        assert (sign, depth) == (-back, pytest.approx(same, abs=4.0)) if sign else back == 0
        if sign:
            crossed += 1
            worst = max(worst, z[:, k].min() - depth, depth - z[:, k].max())
    assert crossed > count // 20
    row = (
        "kernels",
        "crossings of rays and triangles",
        "triangles down to 1e-30 wide as the ray sees them: beyond their corners",
    )
    ledger.record(*row, cases=count, worst=max(worst, 0.0), bound=0.0)
