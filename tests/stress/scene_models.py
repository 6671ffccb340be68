"""Models that break viewers, as the parts that a reader hands on: of extreme sizes and places, degenerate, damaged."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from small_models import box, bumpy_sphere, grid, icosphere, terrain, turned

from hierarchy.assemble import assemble_mesh
from hierarchy.assemble_cloud import assemble_cloud
from hierarchy.geodesic_sphere import geodesic_sphere
from hierarchy.model import Mesh, Model
from hierarchy.part import Part

Rng = np.random.Generator
Maker = Callable[[Rng], list[Part]]


def assemble(parts: list[Part]) -> Model:
    """Do what the loader does with the parts that a reader returns."""
    parts = [part for part in parts if part.faces is not None] or parts
    if parts[0].faces is not None:
        return assemble_mesh("model", parts, [])
    return assemble_cloud("model", parts, [])


def part_of(mesh: Mesh, scale: float = 1.0, offset: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Part:
    """Return a mesh without its normals, scaled and moved in doubles."""
    return Part(mesh.positions.astype(np.float64) * scale + offset, mesh.faces.astype(np.int64))


def with_normals(normals: Callable[[np.ndarray, Rng], np.ndarray]) -> Maker:
    """Return a maker of a sphere whose file has these normals."""

    def make(rng: Rng) -> list[Part]:
        part = part_of(icosphere(6))
        part.normals = normals(part.positions.copy(), rng)
        return [part]

    return make


def cloud(positions: np.ndarray, normals: np.ndarray | None = None) -> list[Part]:
    return [Part(np.asarray(positions, np.float64), normals=normals)]


def _zero_area(rng: Rng) -> list[Part]:
    part = part_of(icosphere(6))
    some = rng.integers(0, len(part.positions), (200, 2))
    folded = np.stack([some[:, 0], some[:, 1], some[:, 0]], 1)
    # A corner in the middle of an edge, on a line with its ends.
    a, b = part.faces[:50, 0], part.faces[:50, 1]
    middles = 0.5 * (part.positions[a] + part.positions[b])
    flat = np.stack([a, b, len(part.positions) + np.arange(50)], 1)
    part.positions = np.concatenate([part.positions, middles])
    part.faces = np.concatenate([part.faces, folded, flat])
    return [part]


def _needles(rng: Rng) -> list[Part]:
    start, way = rng.normal(size=(300, 3)), rng.normal(size=(300, 3))
    across = 10.0 ** rng.uniform(-9, -2, (300, 1)) * rng.normal(size=(300, 3))
    corners = np.stack([start, start + way, start + 0.3 * way + across], 1).reshape(-1, 3)
    return [Part(corners, np.arange(900).reshape(-1, 3))]


def _sheets(gap: float) -> Maker:
    def make(_: Rng) -> list[Part]:
        positions, faces = grid(12)
        lower = positions - [0.0, 0.0, gap]
        both = np.concatenate([faces, faces[:, ::-1] + len(positions)]).astype(np.int64)
        return [Part(np.concatenate([positions, lower]), both)]

    return make


def _three_leaves(_: Rng) -> list[Part]:
    """Three half planes that share one edge, and a fourth that touches in one vertex."""
    positions, faces = grid(6)
    parts = []
    for angle in (0.0, 2.1, 4.2):
        c, s = np.cos(angle), np.sin(angle)
        shifted = positions + np.array([1.0, 0.0, 0.0])
        placed = np.stack([c * shifted[:, 0], shifted[:, 1], s * shifted[:, 0]], 1)
        parts.append(Part(placed, faces.astype(np.int64)))
    parts.append(Part(positions + np.array([-1.0, 2.0, 0.0]), faces.astype(np.int64)))
    return parts


def _moebius(_: Rng) -> list[Part]:
    u, v = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 61)[:-1], np.linspace(-0.3, 0.3, 6))
    ring = 1.0 + v * np.cos(0.5 * u)
    positions = np.stack([ring * np.cos(u), ring * np.sin(u), v * np.sin(0.5 * u)], -1).reshape(-1, 3)
    index = np.arange(360).reshape(6, 60)
    # The strip meets itself turned over.
    index = np.concatenate([index, index[::-1, :1]], axis=1)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return [Part(positions, faces)]


def _half(mesh: Mesh) -> Part:
    part = part_of(mesh)
    part.faces = part.faces[mesh.positions[mesh.faces].mean(axis=1)[:, 2] > 0.1]
    return part


def _inside_out(_: Rng) -> list[Part]:
    part = part_of(icosphere(6))
    part.faces = part.faces[:, ::-1].copy()
    return [part]


def _mixed_sides(rng: Rng) -> list[Part]:
    part = part_of(bumpy_sphere(8))
    turn = rng.random(len(part.faces)) < 0.3
    part.faces[turn] = part.faces[turn][:, ::-1]
    return [part]


def _coincident(_: Rng) -> list[Part]:
    part = part_of(icosphere(3))
    part.faces = np.repeat(part.faces, 30, axis=0)
    return [part]


def _soup(rng: Rng) -> list[Part]:
    corners = rng.normal(size=(500, 1, 3)) + 0.3 * rng.normal(size=(500, 3, 3))
    return [Part(corners.reshape(-1, 3), np.arange(1500).reshape(-1, 3))]


def _colored_cloud(rng: Rng) -> list[Part]:
    parts = cloud(turned(geodesic_sphere(8)[0]))
    parts[0].colors = rng.integers(0, 256, (len(parts[0].positions), 4), np.uint8)
    return parts


def _colored_mesh(rng: Rng) -> list[Part]:
    part = part_of(bumpy_sphere(8))
    part.colors = rng.integers(0, 256, (len(part.positions), 4), np.uint8)
    return [part]


def _clusters(rng: Rng) -> list[Part]:
    """Points that are equal in float32 or nearly so, and some far away from all others."""
    places = rng.normal(size=(20, 3))
    near = places[rng.integers(0, 20, 3000)] + 1e-7 * rng.normal(size=(3000, 3))
    return cloud(np.concatenate([near, 1e3 * rng.normal(size=(3, 3))]))


def _sphere_points(count: int) -> np.ndarray:
    step = np.arange(count) + 0.5
    z, phi = 1.0 - 2.0 * step / count, step * np.pi * (3.0 - np.sqrt(5.0))
    ring = np.sqrt(1.0 - z * z)
    return np.stack([ring * np.cos(phi), ring * np.sin(phi), z], 1)


SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])

MESHES: dict[str, Maker] = {
    "scale 1e-20": lambda _: [part_of(bumpy_sphere(8), 1e-20)],
    "scale 1e-10": lambda _: [part_of(bumpy_sphere(8), 1e-10)],
    "scale 1e10": lambda _: [part_of(bumpy_sphere(8), 1e10)],
    "scale 1e20": lambda _: [part_of(bumpy_sphere(8), 1e20)],
    "offset 1e7": lambda _: [part_of(bumpy_sphere(8), 1.0, (1e7, -1e7, 3e6))],
    "offset 1e7, millimetres": lambda _: [part_of(bumpy_sphere(8), 1e-3, (1e7, -1e7, 3e6))],
    "needles": _needles,
    "faces of zero area": _zero_area,
    "cube of 12 triangles": lambda _: [part_of(box((1.0, 1.0, 1.0)))],
    "plate of 12 triangles": lambda _: [part_of(box((1.0, 1.0, 1e-6)))],
    "one triangle": lambda _: [Part(SQUARE, np.array([[0, 1, 2]]))],
    "two triangles, a square": lambda _: [Part(SQUARE, np.array([[0, 1, 2], [0, 2, 3]]))],
    "sheets a hair apart": _sheets(1e-4),
    "sheets in one place": _sheets(0.0),
    "normals zero": with_normals(lambda p, _: 0.0 * p),
    "normals tiny": with_normals(lambda p, _: 1e-30 * p),
    "normals huge": with_normals(lambda p, _: 1e30 * p),
    "normals not finite": with_normals(lambda p, rng: np.where(rng.random((len(p), 1)) < 0.5, np.nan, p)),
    "normals infinite": with_normals(lambda p, rng: np.where(rng.random((len(p), 1)) < 0.5, np.inf, p)),
    "normals flipped": with_normals(lambda p, _: -p),
    "normals flipped here and there": with_normals(lambda p, rng: p * rng.choice([-1.0, 1.0], (len(p), 1))),
    "normals random": with_normals(lambda p, rng: rng.normal(size=p.shape)),
    "three leaves of an edge": _three_leaves,
    "Moebius strip": _moebius,
    "open half": lambda _: [_half(bumpy_sphere(8))],
    "inside out": _inside_out,
    "sides mixed": _mixed_sides,
    "through itself": lambda _: [part_of(icosphere(6)), part_of(icosphere(6), 1.0, (0.7, 0.2, 0.1))],
    "sphere in a sphere": lambda _: [part_of(icosphere(6)), part_of(icosphere(6), 0.5)],
    "coincident triangles": _coincident,
    "soup of triangles": _soup,
    "landscape": lambda _: [part_of(terrain(16))],
    "fine beside coarse": lambda _: [part_of(icosphere(8), 1e-4), part_of(terrain(4))],
    "colours without normals": _colored_mesh,
}

CLOUDS: dict[str, Maker] = {
    "one point": lambda _: cloud([[5.0, 6.0, 7.0]]),
    "two points": lambda _: cloud([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]]),
    "three points": lambda _: cloud([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0], [1.0, 2.0, 3.1]]),
    "equal points": lambda _: cloud(np.tile([[1.0, 2.0, 3.0]], (1000, 1))),
    "points on a line": lambda rng: cloud(rng.random((300, 1)) * [1.0, 2.0, -3.0]),
    "points in a plane": lambda rng: cloud(rng.random((500, 3)) * [1.0, 1.0, 0.0]),
    "points in a tilted plane": lambda rng: cloud(turned(rng.random((500, 3)) * [1.0, 1.0, 0.0])),
    "points in a ball": lambda rng: cloud(rng.normal(size=(800, 3))),
    "sphere of points": lambda _: cloud(_sphere_points(1500)),
    "sphere of points, scale 1e-20": lambda _: cloud(1e-20 * _sphere_points(800)),
    "sphere of points, scale 1e20": lambda _: cloud(1e20 * _sphere_points(800)),
    "sphere of points, offset 1e7": lambda _: cloud(_sphere_points(800) + np.array([1e7, 1e7, -1e7])),
    "two sheets of points": lambda rng: cloud(
        rng.random((900, 3)) * [1, 1, 0] + rng.choice([0, 1e-3], (900, 1)) * [0, 0, 1]
    ),
    "clusters and far points": _clusters,
    "colours without normals": _colored_cloud,
    "normals without colours": lambda _: cloud(_sphere_points(800), _sphere_points(800)),
    "normals zero": lambda _: cloud(_sphere_points(800), 0.0 * _sphere_points(800)),
    "normals not finite": lambda rng: cloud(
        _sphere_points(800), np.where(rng.random((800, 1)) < 0.5, np.nan, 1.0) * _sphere_points(800)
    ),
    "normals flipped here and there": lambda rng: cloud(
        _sphere_points(800), rng.choice([-1.0, 1.0], (800, 1)) * _sphere_points(800)
    ),
}  # fmt: skip
