"""The GPU's pictures against a float64 numpy renderer of the same equations, on models and views that are hard."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import moderngl
import numpy as np
import pytest
from frame_in_numpy import DEPTH_RELATIVE, Tiles, compare
from ledger import Ledger
from scan_targets import scan_frame
from scene_models import CLOUDS, MESHES, assemble

from hierarchy.build import build_hierarchy
from hierarchy.hierarchy import Hierarchy
from hierarchy.lod import Cut, select_cut
from hierarchy.normal_tiles import TileBaker, bake_tiles
from hierarchy.view import View, look_at
from renderer.renderer import Renderer
from renderer.settings import Settings

Amount = Callable[[int, int], int]

NORMAL_DEGREES = 0.5
# Primitives of a cut that numpy is made to draw, five times.
MOST = 500
FAST = ("needles", "one triangle", "sheets a hair apart", "one point", "equal points", "normals flipped here and there")
NAMES = [("mesh", name) for name in MESHES] + [("cloud", name) for name in CLOUDS]


@dataclass
class Found:
    """The worst of some pictures; compared : pixels that were, of `drawn`."""

    degrees: float = 0.0
    depth: float = 0.0
    miscovered: int = 0
    drawn: int = 0
    compared: int = 0


def random_view(rng: np.random.Generator, hierarchy: Hierarchy) -> tuple[str, View]:
    """Return a view and what is special about it."""
    size = (int(rng.integers(40, 64)), int(rng.integers(40, 64)))
    kind = str(rng.choice(["outside", "outside", "parallel", "wide", "narrow", "inside", "on a surfel", "far away"]))
    radius = hierarchy.radius if hierarchy.radius > 0.0 else 1.0
    direction, up = rng.normal(size=(2, 3))
    direction /= np.linalg.norm(direction)
    focal_point, angle, distance = 0.2 * radius * rng.normal(size=3), 45.0, rng.uniform(1.5, 6.0)
    if kind == "wide":
        angle, distance = float(rng.choice([100.0, 150.0, 170.0])), rng.uniform(0.8, 2.0)
    elif kind == "narrow":
        angle, distance = 1.0, rng.uniform(60.0, 200.0)
    elif kind == "inside":
        angle, distance = 90.0, rng.uniform(0.05, 0.6)
    elif kind == "far away":
        angle, distance = float(rng.choice([1.0, 45.0])), 2e6
    position = focal_point + distance * radius * direction
    if kind == "on a surfel":
        leaves = hierarchy.leaves.positions
        position = leaves[rng.integers(len(leaves))].astype(np.float64)
        focal_point = position - radius * direction
    scale = rng.uniform(0.3, 2.0) * radius if kind == "parallel" else None
    bounds = hierarchy.bounds
    return kind, look_at(position, focal_point, up, math.radians(angle), size, bounds=bounds, parallel_scale=scale)


def small_cut(rng: np.random.Generator, hierarchy: Hierarchy, view: View) -> Cut | None:
    """Return a cut of MOST primitives or less; None where there is none."""
    r_sil = float(rng.choice([0.0, 0.5, 1.0, 2.0, 5.0]))
    r_inner = r_sil * float(rng.choice([1.0, 3.0, 10.0]))
    for _ in range(8):
        cut = select_cut(hierarchy, view, r_sil, r_inner, two_sided=bool(rng.random() < 0.3))
        if cut.splat_count + cut.triangle_count <= MOST:
            return cut
        r_sil, r_inner = 2.0 * r_sil + 0.5, 2.0 * r_inner + 0.5
    return None


def compare_random(
    ctx: moderngl.Context, renderer: Renderer, rng: np.random.Generator, hierarchy: Hierarchy, tiled: bool, count: int
) -> tuple[int, dict[str, Found]]:
    """Draw a model from `count` random views; return how many were compared, and the worst by kind of view."""
    same = bake_tiles(hierarchy, int(rng.choice([1, 2, 8]))) if tiled else None
    baker = TileBaker(hierarchy, int(rng.choice([4, 16])))
    renderer.set_hierarchy(hierarchy)
    cases, worst = 0, {}
    for _ in range(count):
        kind, view = random_view(rng, hierarchy)
        cut = small_cut(rng, hierarchy, view)
        if cut is None:
            continue
        # All of one size, or as few texels each as will do.
        tiles: Tiles | None = same
        if tiled and rng.random() < 0.5:
            pages = renderer.make_pages(baker.texels)
            tiles = baker.fitted(*pages.begin(cut.splats, view, hierarchy))
            assert pages.add(tiles)
            renderer.set_tiles(pages)
        else:
            renderer.set_tiles(same)
        framebuffer = ctx.simple_framebuffer((view.width, view.height))
        renderer.draw(cut, view, Settings(), framebuffer)
        assert scan_frame(renderer) == []
        frame = renderer.read_arrays()
        ctx.detect_framebuffer(0).use()
        framebuffer.release()
        found = compare(frame, hierarchy, tiles, cut, view, wary=True)
        here = worst.setdefault(kind, Found())
        here.degrees = max(here.degrees, float(found.degrees.max()))
        here.depth = max(here.depth, float(found.depth_excess.max()))
        here.miscovered += int(found.miscovered.sum())
        here.drawn += int(found.drawn.sum())
        here.compared += int((found.drawn & found.stable).sum())
        cases += 1
    return cases, worst


@pytest.mark.parametrize(("kind", "name"), NAMES, ids=[f"{kind}-{name}" for kind, name in NAMES])
def test_pictures(
    ctx: moderngl.Context,
    renderer: Renderer,
    ledger: Ledger,
    amount: Amount,
    rng: np.random.Generator,
    kind: str,
    name: str,
) -> None:
    if amount(0, 1) == 0 and name not in FAST:
        pytest.skip("only with --stress")
    hierarchy = build_hierarchy(assemble((MESHES if kind == "mesh" else CLOUDS)[name](rng)))
    for tiled in (False, True):
        count, worst = compare_random(ctx, renderer, rng, hierarchy, tiled, amount(1, 3))
        print(name, tiled, worst)
        found = worst.values()
        tried = "outside, inside, on a surfel, 1e6 diagonals away, fov 1 to 170 degrees, parallel; random radii"
        suffix = ", tiles" if tiled else ""
        record = f"{len(MESHES)} meshes{suffix}" if kind == "mesh" else f"{len(CLOUDS)} clouds{suffix}"
        degrees, depth = (max((getattr(f, what) for f in found), default=0.0) for what in ("degrees", "depth"))
        ledger.record(
            "agreement",
            f"normals of {record}",
            tried,
            cases=count,
            worst=degrees,
            bound=NORMAL_DEGREES,
            unit="degrees",
        )
        ledger.record("agreement", f"depths of {record}", tried, cases=count, worst=depth, bound=DEPTH_RELATIVE)
        assert sum(f.miscovered for f in found) == 0
