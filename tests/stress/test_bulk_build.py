"""Very many primitives at one place: the work stays in proportion to their number, and the hierarchy is sound."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from small_models import cloud_of, grid, mesh_of

from hierarchy.build import build_hierarchy
from hierarchy.model import Float64Array, Mesh, Model
from hierarchy.normal_tiles import bake_tiles
from hierarchy.openings import border_caps

# What any arrangement may cost, in terms of an open sheet of as many triangles or points: the promise.
MOST_OF_ORDINARY = 3.0
# Where thousands of large triangles overlap under every disc, every tile takes all the work that it may take, and most
# of it twice: then a sample is taken instead (normal_tiles.py). Discs that all lie over one another are near the above,
# too. Proportional to their number, but more than the above.
MOST_OF_CROWDED = 12.0
CROWDED = (
    "a fan around one vertex",
    "coincident triangles",
    "concentric triangles",
    "needles through one point",
    "discs a thousand times wider than apart",
)
TEXELS = 8


def soup(corners: Float64Array) -> Mesh:
    """Return an open mesh of triangles (N, 3, 3) that share no vertex."""
    return mesh_of(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))


def unit(rng: np.random.Generator, count: int) -> Float64Array:
    vectors = rng.normal(size=(count, 3))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True), np.float64)


def sheet(rng: np.random.Generator, count: int) -> Mesh:
    side = int((count / 2) ** 0.5) + 1
    x = np.linspace(-1.0, 1.0, side + 1)
    positions, faces = grid(side, (0.1 * np.sin(5.0 * x)[:, None] * np.cos(4.0 * x)).ravel())
    return mesh_of(positions, faces[:count])


def ordinary_cloud(rng: np.random.Generator, count: int) -> Model:
    x, y = rng.uniform(-1.0, 1.0, (2, count))
    height = 0.1 * np.sin(5.0 * x) * np.cos(4.0 * y)
    slopes = 0.5 * np.cos(5.0 * x) * np.cos(4.0 * y), -0.4 * np.sin(5.0 * x) * np.sin(4.0 * y)
    return cloud_of(np.stack([x, y, height], 1), np.stack([-slopes[0], -slopes[1], 1 + 0 * x], 1), 4.0 / count**0.5)


def one_cell(rng: np.random.Generator, count: int) -> Mesh:
    middle = sheet(rng, count)
    far = [[-1, -1, -1], [-1, -0.9, -1], [-0.9, -1, -1], [2, 2, 2], [2, 1.9, 2], [1.9, 2, 2]]
    positions = np.concatenate([1e-9 * middle.positions, far])
    last = len(middle.positions) + np.arange(6).reshape(2, 3)
    return mesh_of(positions, np.concatenate([middle.faces, last]))


def fan(rng: np.random.Generator, count: int) -> Mesh:
    angle = 2.0 * np.pi * np.arange(count) / count
    rim = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], 1)
    corners = np.arange(count)
    faces = np.stack([corners, np.roll(corners, -1), np.full(count, count)], 1)
    return mesh_of(np.concatenate([rim, [[0.0, 0.0, 0.5]]]), faces)


def concentric(rng: np.random.Generator, count: int) -> Mesh:
    a, b = unit(rng, count), unit(rng, count)
    return soup(np.stack([a, b, -a - b], 1) * rng.uniform(0.1, 1.0, (count, 1, 1)))


def needles(rng: np.random.Generator, count: int) -> Mesh:
    along, across = unit(rng, count), 1e-3 * unit(rng, count)
    return soup(np.stack([along, across - along, -across], 1))


def two_sheets(rng: np.random.Generator, count: int) -> Model:
    side = np.arange(count) % 2
    flat = rng.uniform(-1.0, 1.0, (count, 2))
    normals = np.stack([0 * side, 0 * side, 1 - 2 * side], 1)
    return cloud_of(np.column_stack([flat, 1e-7 * side]), normals, 2.0 / count**0.5)


def few_places(rng: np.random.Generator, count: int) -> Model:
    return cloud_of(np.tile(rng.uniform(-1.0, 1.0, (10, 3)), (count // 10, 1)), unit(rng, count // 10 * 10), 0.01)


Maker = Callable[[np.random.Generator, int], Model]
SCENES: dict[str, Maker] = {
    "coincident triangles": lambda rng, n: soup(np.tile([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]], (n, 1, 1))),
    "a fan around one vertex": fan,
    "concentric triangles": concentric,
    "needles through one point": needles,
    "all in one Morton cell between outliers": one_cell,
    "equal points": lambda rng, n: cloud_of(np.zeros((n, 3)), unit(rng, n), 0.1),
    "few places with many points each": few_places,
    "discs a thousand times wider than apart": lambda rng, n: cloud_of(1e-3 * unit(rng, n), unit(rng, n), 1.0),
    "points on a line": lambda rng, n: cloud_of(np.linspace(-1, 1, n)[:, None] * [1, 2, 3], unit(rng, n), 1.0 / n),
    "two coincident sheets": two_sheets,
}
FAST = ("coincident triangles", "a fan around one vertex", "equal points")


def seconds(model: Model) -> tuple[float, float]:
    """Return the processor time of the build and of its tiles, all threads together, so that load does not count."""
    before = time.process_time()
    hierarchy = build_hierarchy(model)
    built = time.process_time()
    bake_tiles(hierarchy, TEXELS)
    baked = time.process_time()
    nodes = hierarchy.nodes
    for name in nodes.dtype.names:
        assert np.isfinite(nodes[name]).all(), name
    assert (nodes["radius"] >= 0.0).all()
    assert (nodes["relief"] >= hierarchy.splats["thickness"][: len(nodes)]).all()
    return built - before, baked - built


@pytest.mark.parametrize("name", SCENES)
def test_bulk_costs_no_more_than_some_ordinary_surfaces(name, ledger, amount, rng):
    if name not in FAST and amount(0, 1) == 0:
        pytest.skip("tried by make stress")
    count = amount(20_000, 60_000)
    model = SCENES[name](rng, count)
    ordinary = sheet(rng, count) if isinstance(model, Mesh) else ordinary_cloud(rng, count)
    # Compile, or load what is compiled.
    seconds(sheet(rng, 50))
    seconds(ordinary_cloud(rng, 50))
    seconds(SCENES[name](rng, 50))
    spent, usual = np.array(seconds(model)), np.array(seconds(ordinary))
    bound = MOST_OF_CROWDED if name in CROWDED else MOST_OF_ORDINARY
    ledger.record(
        "scenes", f"bulk: {name}", f"{count:,} of them, built and baked; processor time, an ordinary sheet's is 1",
        cases=1, worst=float(spent.sum() / usual.sum()), bound=bound, unit="times",
    )  # fmt: skip


def test_the_border_of_a_fan_takes_time_in_proportion_to_its_edges(rng):
    def spent(count: int) -> float:
        model = fan(rng, count)
        # The middle first: all of its edges then are in one bucket, in the order that quicksort likes least.
        positions, faces = model.positions[::-1].copy(), (count - model.faces).astype(np.int32)
        before = time.process_time()
        border_caps(positions, faces)
        return time.process_time() - before

    spent(50)
    # Quadratic work would take 64 times as long.
    assert spent(160_000) < 24.0 * max(spent(20_000), 0.01)


def test_twenty_million_leaves_in_one_cell(ledger, amount):
    """The cell between two outliers that are a billion times farther apart; in a process whose memory is its own."""
    count = amount(50_000, 20_000_000)
    child = Path(__file__).with_name("bulk_child.py")
    ended = subprocess.run([sys.executable, child, str(count)], check=True, capture_output=True, text=True, timeout=500)
    said = json.loads(ended.stdout)
    assert said["finite"]
    assert count <= said["leaves"] <= count + 2
    assert 0.3 * count < said["nodes"] < 0.5 * count
    if count < 1_000_000:
        # Threads and compiled kernels take more than that.
        return
    ledger.record(
        "scenes", "bulk: twenty million in one Morton cell", "built; memory at the peak beyond the model's", cases=1,
        worst=said["bytes"] / said["leaves"], bound=300.0, unit="bytes a leaf",
    )  # fmt: skip
