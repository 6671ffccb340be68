"""Scenes, cameras and settings that break viewers: every number that is drawn is one, twice the same, and nothing has
holes that its triangles have not."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest
from scene_models import CLOUDS, MESHES, assemble
from scene_views import OUTSIDE, VIEWS, views_of
from scipy import ndimage
from stage import Stage, faults_of_frame, same_frame

from benchmarks.rays import RayCaster
from benchmarks.reference import cast
from hierarchy.build import build_hierarchy
from hierarchy.hierarchy import Hierarchy
from hierarchy.leaves import Triangles
from hierarchy.model import Mesh, Model
from hierarchy.normal_tiles import NormalTiles, bake_tiles
from hierarchy.view import View
from renderer.frame import Frame
from renderer.settings import Settings

Amount = Callable[[int, int], int]

# How much of a picture may be holes where meshes are drawn as surfels, which have no plane but their normals': of one
# with random normals, which is no surface any more, and of one of a few large triangles, whose interpolated normals
# leave their planes by 20 degrees, so that discs lie on it like shingles (0.0007 found, at the outline seen edge on).
HOLES_OF_SURFELS = {
    "normals random": ("surfels with random normals", 0.02),
    "fine beside coarse": ("surfels askew", 1e-3),
}
# The ends of the window's sliders, and what is usual.
RADII = ((2.0, 16.0), (0.0, 0.0), (32.0, 64.0), (0.0, 64.0), (32.0, 0.0), (0.5, 1.0))
TEXELS = (2, 1, 16, None, 32)
MOST_NODES = 10_000
SETTINGS = (
    Settings(),
    Settings(two_sided=True, ground=True, material="jade"),
    Settings(splat="sprite", silhouette_overlay=True),
    Settings(blending=False, lod_colors=True),
    Settings(two_sided=True, splat_outlines=True, lod_colors=True, silhouette_overlay=True),
)
SIZE = (72, 56)
# The fast share sees every scene through some of the views.
FAST_VIEWS = ("oblique", "in the centre", "on the surface, across", "a million diagonals away", "170 degrees, close")


def make(name: str, rng: np.random.Generator) -> Model:
    maker = {**MESHES, **{f"cloud: {key}": value for key, value in CLOUDS.items()}}[name]
    return assemble(maker(rng))


def built(name: str, rng: np.random.Generator) -> tuple[Model, Hierarchy]:
    """Build a scene with numpy's floating-point errors raised."""
    with np.errstate(all="raise"):
        model = make(name, rng)
        return model, build_hierarchy(model)


ALL = [*MESHES, *(f"cloud: {name}" for name in CLOUDS)]


@pytest.mark.parametrize("name", ALL)
def test_every_number_of_a_scene_is_one(name: str, stage: Stage, rng, ledger, amount: Amount) -> None:
    model, hierarchy = built(name, rng)
    shared = [hierarchy]
    if amount(0, 1) and isinstance(model, Mesh):
        with np.errstate(all="raise"):
            shared.append(build_hierarchy(model, points=True))
    wrong, pictures = [], 0
    for each in shared:
        # A few large triangles become 100,000 surfels.
        texels = TEXELS if each.node_count < MOST_NODES else TEXELS[::3]
        with np.errstate(all="raise"):
            tiles: dict[int | None, NormalTiles | None] = {
                t: None if t is None else bake_tiles(each, t) for t in texels
            }
        views = [(key, view) for key, view in views_of(each, SIZE) if amount(0, 1) or key in FAST_VIEWS]
        choices = list(itertools.product(RADII, texels, SETTINGS))
        for view_name, view in views:
            # A share of all combinations of settings, another for every view.
            for k in rng.permutation(len(choices))[: amount(1, 6)]:
                radii, w_s, settings = choices[k]
                frame, _ = stage.draw(each, tiles[w_s], view, settings, radii)
                faults = faults_of_frame(frame, view)
                wrong += [f"{view_name}, {radii}, w_s {w_s}, {settings}: {fault}" for fault in faults]
                pictures += 1
    assert not wrong, wrong[:3]
    ledger.record(
        "scenes", "numbers", f"{len(ALL)} scenes, {len(VIEWS)} cameras, sliders at both ends, every switch",
        cases=pictures, worst=len(wrong), bound=0, unit="pictures with one that is not finite or not unit",
    )  # fmt: skip


def holes(frame: Frame, truth: np.ndarray, border: int = 1) -> int:
    """Count uncovered pixels whose surroundings, of `border` pixels, the triangles cover wholly."""
    inside = ndimage.binary_erosion(truth >= 1.0, np.ones((3, 3)), iterations=border, border_value=1)
    return int((inside & (frame.coverage == 0.0)).sum())


@pytest.mark.parametrize("name", MESHES)
def test_nothing_has_holes_that_its_triangles_have_not(name: str, stage: Stage, rng, ledger, amount: Amount) -> None:
    if ALL.index(name) % amount(3, 1):
        pytest.skip("not in the fast share")
    model, hierarchy = built(name, rng)
    assert isinstance(model, Mesh)
    caster = RayCaster(model)
    found, torn = {}, 0.0
    pictures = {True: 0, False: 0}
    # What the window and the command line do.
    settings = Settings(two_sided=not hierarchy.closed)
    for each in (hierarchy, *(build_hierarchy(model, points=True) for _ in range(amount(0, 1)))):
        tiles = bake_tiles(each, 16)
        for view_name in OUTSIDE[: amount(2, len(OUTSIDE))]:
            view = VIEWS[view_name](each, (160, 128))
            truth = cast(caster, view, 3).coverage
            for radii in ((2.0, 16.0), (0.5, 1.0)):
                frame, _ = stage.draw(each, tiles, view, settings, radii)
                is_mesh = isinstance(each.leaves, Triangles)
                pictures[is_mesh] += 1
                # Where a thin wall is made of surfels as wide as those of its sides the outline moves by some r_sil.
                border = 1 if is_mesh else 2 * math.ceil(radii[0])
                count = holes(frame, truth, border)
                if not is_mesh:
                    torn = max(torn, count / frame.coverage.size)
                elif count:
                    found[view_name, radii] = count
    assert not found, found
    ledger.record(
        "scenes", "holes", f"{len(MESHES)} meshes against rays, from outside, usual and fine detail",
        cases=pictures[True], worst=sum(found.values()), bound=0, unit="pixels",
    )  # fmt: skip
    if not pictures[False]:
        return
    what, bound = HOLES_OF_SURFELS.get(name, ("surfels", 4e-4))
    ledger.record(
        "scenes", f"holes, {what}", "the same meshes as point hierarchies, twice r_sil inside the outline",
        cases=pictures[False], worst=torn, bound=bound, unit="of the picture",
    )  # fmt: skip


@pytest.mark.parametrize("name", ALL)
def test_the_same_scene_gives_the_same_bytes_twice(name: str, stage: Stage, ledger, amount: Amount) -> None:
    if ALL.index(name) % amount(6, 1):
        pytest.skip("not in the fast share")

    def rng() -> np.random.Generator:
        return np.random.default_rng(7)

    hierarchies = [built(name, rng())[1] for _ in range(2)]
    arrays = [(h.nodes, h.splats, h.spreads, h.leaves.positions) for h in hierarchies]
    assert all(a.tobytes() == b.tobytes() for a, b in zip(*arrays, strict=True))
    tiles = [bake_tiles(h, 8) for h in hierarchies]
    differing, pictures = 0, 0
    for view_name in ("oblique", "on the surface, inwards", "1 degree")[: amount(1, 3)]:
        frames = [
            stage.draw(h, t, VIEWS[view_name](h, SIZE), Settings(), (2.0, 8.0))[0]
            for h, t in zip(hierarchies, tiles, strict=True)
        ]
        differing += not same_frame(*frames)
        pictures += 1
    ledger.record(
        "scenes", "the same twice", f"{len(ALL)} scenes, built, baked and drawn two times", cases=pictures,
        worst=differing, bound=0, unit="pictures that differ in a bit",
    )  # fmt: skip


def greys(a: Frame, b: Frame) -> int:
    """Return the largest difference of two pictures in grey levels."""
    return int(np.abs(a.color.astype(int) - b.color.astype(int)).max())


def scaled_view(hierarchy: Hierarchy, name: str) -> View:
    return VIEWS[name](hierarchy, (160, 128))


@pytest.mark.parametrize("scale", [1e-20, 2.0**-40, 1e-3, 1e3, 2.0**40, 1e20])
def test_a_model_of_any_size_gives_the_same_picture(scale: float, stage: Stage, rng, ledger, amount: Amount) -> None:
    _compare_pictures("size", f"scales {1e-20:g} to {1e20:g}", scale, (0, 0, 0), stage, ledger, amount)


@pytest.mark.parametrize("offset", [(1e7, 0, 0), (1e7, -1e7, 1e7), (4512345.678, 5512345.678, 912.345)])
@pytest.mark.parametrize("scale", [1.0, 0.05])
def test_millimetres_far_from_the_origin(offset, scale: float, stage: Stage, ledger, amount: Amount) -> None:
    _compare_pictures("place", "offsets of 1e7, detail of millimetres", scale, offset, stage, ledger, amount)


def _compare_pictures(what, tried, scale, offset, stage: Stage, ledger, amount: Amount) -> None:
    """Draw a model at the origin, about as large as 1, and elsewhere; both as they come out of a file."""
    from scene_models import part_of
    from small_models import bumpy_sphere

    mesh = bumpy_sphere(amount(12, 24))
    hierarchies = [build_hierarchy(assemble([part_of(mesh, *place)])) for place in ((1.0,), (scale, offset))]
    tiles = [bake_tiles(each, 16) for each in hierarchies]
    for view_name in OUTSIDE[: amount(2, len(OUTSIDE))]:
        frames = [
            stage.draw(h, t, VIEWS[view_name](h, (160, 128)), Settings(), (2.0, 16.0))[0]
            for h, t in zip(hierarchies, tiles, strict=True)
        ]
        ledger.record(
            "scenes",
            f"the same picture at any {what}",
            tried,
            cases=1,
            worst=greys(*frames),
            bound=1,
            unit="grey levels",
        )


@pytest.mark.parametrize("size", [(1, 1), (1, 4000), (4000, 1), (2, 3), (4096, 7)])
def test_windows_of_any_shape(size: tuple[int, int], stage: Stage, rng, ledger) -> None:
    _, hierarchy = built("through itself", rng)
    tiles = bake_tiles(hierarchy, 8)
    wrong = 0
    for name, view in views_of(hierarchy, size):
        frame, _ = stage.draw(hierarchy, tiles, view, Settings(ground=True), (2.0, 16.0))
        assert frame.color.shape == (size[1], size[0], 4)
        wrong += bool(faults_of_frame(frame, view))
        if name == "front":
            assert (frame.coverage > 0.0).any()
    ledger.record(
        "scenes", "shapes of the window", "1 x 1, 1 x 4000, 4000 x 1, 4096 x 7", cases=len(VIEWS), worst=wrong, bound=0,
        unit="pictures with a number that is none",
    )  # fmt: skip
