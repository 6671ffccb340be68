"""Discs on the GPU, as rectangles and as sprites, against the ray-disc intersection in float64."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import moderngl
import numpy as np
import pytest
from frame_in_numpy import SHIFT, SHIFTS, numpy_discs
from glsl_harness import Stage, cut_of, hierarchy_of, splats_of
from ledger import Ledger
from numpy_renderer import Discs, Rays, pixel_rays
from scan_targets import scan_targets

from hierarchy.kernel import SMALLEST
from hierarchy.view import View, look_at
from renderer.renderer import Renderer
from renderer.settings import Settings

Amount = Callable[[int, int], int]

# Half the width in pixels below which corners that lie on a grid of 1/256 pixel hardly make a triangle.
SLIVER = 1.0 / 128.0
# One disc a cell of the picture, so that none hides another.
CELL, SIDE = 32, 8
SIZE = CELL * SIDE
TILTS = np.radians([0.0, 15, 45, 60, 75, 85, 88, 89, 89.5, 89.9, 89.99, 89.999, 89.9999, 89.99999, 90.0])
ANGLES = (1.0, 30.0, 60.0, 100.0, 150.0, 170.0)
KINDS = pytest.mark.parametrize("kind", ["rectangle", "sprite"])


def random_view(rng: np.random.Generator, angle: float, parallel: bool, size: int = SIZE) -> View:
    """Return a view from anywhere, in any direction, whose depths from 1 to 3 lie well between the clip planes."""
    position, focal_point, up = rng.normal(size=(3, 3)) * 0.3
    bounds = (np.zeros(3), 1.0)
    scale = 1.5 * math.tan(0.5 * math.radians(angle)) if parallel else None
    view = look_at(position, focal_point, up, math.radians(angle), (size, size), bounds=bounds, parallel_scale=scale)
    return replace(view, near=0.2, far=8.0)


@dataclass(frozen=True, eq=False)
class Wanted:
    """Discs in eye space by what they are to look like."""

    pixels: np.ndarray  # (N, 2), of their centres, from the top left
    radii: np.ndarray  # in pixels
    tilts: np.ndarray  # between normal and view ray; seen from behind where it is over 90 degrees


def discs_of(rng: np.random.Generator, view: View, wanted: Wanted) -> np.ndarray:
    """Return SPLAT (N,) of discs that look as wanted, at depths from 1 to 3."""
    count = len(wanted.radii)
    depth = rng.uniform(1.0, 3.0, count)
    across = (wanted.pixels - [0.5 * view.width, 0.5 * view.height]) * [1.0, -1.0] / view.focal_pixels
    ahead = np.column_stack([np.zeros((count, 2)), -np.ones(count)])
    rays = ahead if view.is_parallel else np.column_stack([across, ahead[:, 2]])
    centres = np.column_stack([across * (1.0 if view.is_parallel else depth[:, None]), -depth])
    towards = -rays / np.linalg.norm(rays, axis=1, keepdims=True)
    aside = np.cross(towards, rng.normal(size=(count, 3)))
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    # Of a tilt of 90 degrees the cosine shall be 0.
    cosine = np.where(wanted.tilts == 0.5 * np.pi, 0.0, np.cos(wanted.tilts))
    normals = towards * cosine[:, None] + aside * np.sin(wanted.tilts)[:, None]
    # Off the axis a disc that faces the eye looks larger than on it.
    radii = wanted.radii * towards[:, 2] ** 2 / view.pixels_of_unit(depth)
    rotation, translation = view.eye_from_model[:3, :3], view.eye_from_model[:3, 3]
    return splats_of((centres - translation) @ rotation, normals @ rotation, radii)


def cells(rng: np.random.Generator) -> np.ndarray:
    """Return pixels near the middles of all cells, (SIDE^2, 2)."""
    y, x = np.mgrid[0:SIDE, 0:SIDE]
    return np.stack([x.ravel(), y.ravel()], axis=1) * CELL + 0.5 * CELL + rng.uniform(-3.0, 3.0, (SIDE * SIDE, 2))


def intersect(view: View, rays: Rays, discs: Discs, i: int) -> tuple[np.ndarray, np.ndarray]:
    """Return where rays meet a disc's plane, in its frame (..., 2), and the depths; infinite where they do not."""
    rotation, translation = view.eye_from_model[:3, :3], view.eye_from_model[:3, 3]
    planes = discs.normals if discs.planes is None else discs.planes
    centre, plane = rotation @ discs.centres[i] + translation, rotation @ planes[i]
    slope = rays.directions @ plane
    along = np.divide((centre - rays.starts) @ plane, slope, out=np.full(slope.shape, np.inf), where=slope != 0.0)
    with np.errstate(invalid="ignore"):
        offset = rays.starts + rays.directions * along[..., None] - centre
        at = np.stack([offset @ (rotation @ discs.o1[i]), offset @ (rotation @ discs.o2[i])], axis=-1) / discs.radii[i]
    return np.where(np.isfinite(at), at, np.inf), along


def project(view: View, discs: Discs, index: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the pixels (K, 2), from the top left, and the depths of points (K, 2) in the frames of discs."""
    spanned = at[:, :1] * discs.o1[index] + at[:, 1:] * discs.o2[index]
    points = discs.centres[index] + discs.radii[index][:, None] * spanned
    eye = points @ view.eye_from_model[:3, :3].T + view.eye_from_model[:3, 3]
    depth = -eye[:, 2]
    pixels = eye[:, :2] * [1.0, -1.0] * view.pixels_of_unit(depth)[:, None]
    return pixels + np.array([0.5 * view.width, 0.5 * view.height]), depth


@dataclass(frozen=True, eq=False)
class Measured:
    """missed, extra : pixels that must be covered and are not, and the other way round
    pixels, slivers : the largest distance of a disc point, projected, from its pixel's centre; of discs that are seen
        so close to edge-on that they are thinner than `SLIVER`, apart
    depth, sliver_depth : the largest error of a disc point's depth in radii of the disc, and that of those
    """

    missed: int
    extra: int
    pixels: float
    slivers: float
    depth: float
    sliver_depth: float


def measure(view: View, discs: Discs, found: np.ndarray, reach: int = CELL) -> Measured:
    """Compare what `Stage.disc_points` gave of discs that do not overlap with the intersection in float64.

    reach : pixels around its centre in which a disc is looked for
    """
    shifted = [pixel_rays(view, offset) for offset in ((0.0, 0.0), *SHIFTS)]
    must, may = (np.zeros(found.shape[:2], bool) for _ in range(2))
    middles, _ = project(view, discs, np.arange(len(discs.radii)), np.zeros((len(discs.radii), 2)))
    for i, (x, y) in enumerate(middles.astype(int)):
        near = np.s_[max(y - reach, 0) : y + reach, max(x - reach, 0) : x + reach]
        covered = []
        for rays in shifted:
            at, along = intersect(view, Rays(rays.starts[near], rays.directions[near]), discs, i)
            covered.append(((at**2).sum(axis=-1) <= 1.0) & (along > view.near) & (along < view.far))
        must[near] |= np.all(covered, axis=0)
        # Slivers that pass between the shifts may show.
        may[near] |= np.any(covered, axis=0)
    drawn = found[..., 3] > 0.0
    assert np.isfinite(found).all()
    rows, columns = np.nonzero(drawn)
    index = np.rint(found[drawn][:, 3]).astype(int) - 1
    pixels, depth = project(view, discs, index, found[drawn][:, :2].astype(np.float64))
    distance = np.linalg.norm(pixels - np.stack([columns, rows], axis=1) - 0.5, axis=1)
    thin = half_widths(view, discs)[index] < SLIVER
    behind = np.abs(found[drawn][:, 2] - depth) / discs.radii[index]
    extra = drawn & ~may
    extra[rows, columns] &= distance > SHIFT * math.sqrt(2.0)
    return Measured(
        int((must & ~drawn).sum()),
        int(extra.sum()),
        float(distance[~thin].max(initial=0.0)),
        float(distance[thin].max(initial=0.0)),
        float(behind[~thin].max(initial=0.0)),
        float(behind[thin].max(initial=0.0)),
    )


def half_widths(view: View, discs: Discs) -> np.ndarray:
    """Return half of how wide discs are on the screen where they are thinnest, in pixels, at their centres' depth."""
    rotation, translation = view.eye_from_model[:3, :3], view.eye_from_model[:3, 3]
    centres = discs.centres @ rotation.T + translation
    planes = (discs.normals if discs.planes is None else discs.planes) @ rotation.T
    sight = np.broadcast_to([0.0, 0.0, 1.0], centres.shape) if view.is_parallel else centres
    cosines = np.abs(np.einsum("ij,ij->i", planes, sight)) / np.linalg.norm(sight, axis=1)
    widths: np.ndarray = cosines * discs.radii * view.pixels_of_unit(-centres[:, 2])
    return widths


@KINDS
def test_discs_of_every_tilt(
    ctx: moderngl.Context, renderer: Renderer, ledger: Ledger, amount: Amount, rng: np.random.Generator, kind: str
) -> None:
    worst, cases = Measured(0, 0, 0.0, 0.0, 0.0, 0.0), 0
    for turn in range(amount(3, 90)):
        view = random_view(rng, ANGLES[turn % len(ANGLES)], turn % 4 == 3)
        count = SIDE * SIDE
        tilts = np.where(rng.random(count) < 0.3, rng.uniform(0.0, 0.5 * np.pi, count), rng.choice(TILTS, count))
        tilts = np.where(rng.random(count) < 0.5, tilts, np.pi - tilts)
        splats = discs_of(rng, view, Wanted(cells(rng), rng.uniform(1.0, 12.0, count), tilts))
        hierarchy = hierarchy_of(splats)
        # On the silhouette, and without thickness, discs are drawn as they are.
        cut = cut_of(hierarchy, silhouette=count)
        stage = Stage(ctx, renderer, hierarchy, view, cut)
        discs = numpy_discs(hierarchy, None, cut, view, True)
        found = measure(view, discs, stage.disc_points(sprite=kind == "sprite"))
        worst = Measured(*(max(a, b) for a, b in zip(vars(worst).values(), vars(found).values(), strict=True)))
        cases += count
    tried = "tilts of 0 to 90 degrees exactly, from both sides, 1 to 12 pixels; fov 1 to 170 degrees, parallel"

    def record(what: str, worst: float, bound: float, unit: str) -> None:
        ledger.record("kernels", f"{what} ({kind}s)", tried, cases=cases, worst=worst, bound=bound, unit=unit)

    # Of pixels whose surroundings of 1/256 pixel the disc covers, or does not: corners lie on a grid of that.
    record("pixels that a disc covers", worst.missed + worst.extra, 0, "pixels")
    # A step of that grid for the corners, and one for slivers that are hardly wider.
    record("disc point of a pixel, seen on the screen", worst.pixels, 2.0 * SHIFT, "pixels")
    # Of a triangle that is hardly wider than the grid interpolation loses more along it: far less than what a texel is.
    record("the same of slivers below 1/128 pixel", worst.slivers, 0.125, "pixels")
    record("depth of a sliver's pixel", worst.sliver_depth, 1.0 / 32.0, "radii")
    # Slopes of interpolation are good to 2^-22 or so, and those of what is 1/64 pixel wide rise by 128 a pixel over 24
    # pixels: 0.001. A sprite's depth, and any, is a float32 number, at a radius of a pixel and 1 degree 1e-4 of it.
    record("depth of a disc's pixel", worst.depth, 1.0 / 128.0, "radii")


@KINDS
def test_discs_below_a_pixel_show(
    ctx: moderngl.Context, renderer: Renderer, ledger: Ledger, amount: Amount, rng: np.random.Generator, kind: str
) -> None:
    lost, cases = 0, 0
    for turn in range(amount(1, 60)):
        view = random_view(rng, ANGLES[turn % len(ANGLES)], turn % 4 == 3)
        count = 900
        y, x = np.mgrid[0:30, 0:30] * 8 + 5.0
        # Anywhere in a pixel, and in its middle, on its edges and its corners.
        inside = np.where(rng.random((count, 2)) < 0.3, rng.integers(0, 3, (count, 2)) / 2.0, rng.random((count, 2)))
        radii = np.where(rng.random(count) < 0.3, 0.0, rng.uniform(0.0, SMALLEST, count))
        wanted = Wanted(np.stack([x.ravel(), y.ravel()], axis=1) + inside, radii, rng.uniform(0.0, np.pi, count))
        hierarchy = hierarchy_of(discs_of(rng, view, wanted))
        cut = cut_of(hierarchy, silhouette=int(rng.integers(0, count)))
        found = Stage(ctx, renderer, hierarchy, view, cut).disc_points(sprite=kind == "sprite")
        shown = np.bincount(np.rint(found[..., 3]).astype(int).ravel(), minlength=count + 1)[1:]
        discs = numpy_discs(hierarchy, None, cut, view, True)
        pixels, _ = project(view, discs, np.arange(count), np.zeros((count, 2)))
        column, row = np.floor(pixels).astype(int).T
        at_centre = found[row, column, 3] == np.arange(count) + 1
        lost += int((~at_centre | (shown == 0)).sum())
        cases += count
    tried = "radii of 0 to 0.72 pixels, every tilt, centres on pixels' corners, edges and middles"
    ledger.record("kernels", f"discs below a pixel ({kind}s)", tried, cases=cases, worst=lost, bound=0, unit="lost")


@KINDS
@pytest.mark.parametrize("parallel", [False, True], ids=["perspective", "parallel"])
def test_discs_across_the_near_and_the_far_plane(
    ctx: moderngl.Context,
    renderer: Renderer,
    ledger: Ledger,
    amount: Amount,
    rng: np.random.Generator,
    kind: str,
    parallel: bool,
) -> None:
    wrong, cases = 0, 0
    for _ in range(amount(6, 150)):
        view = replace(random_view(rng, float(rng.choice(ANGLES[1:5])), parallel, 64), near=1.4, far=2.5)
        # OpenGL drops points whose centre is not in view.
        middle, lean = (rng.uniform(1.5, 2.4), 0.6) if kind == "sprite" else (rng.uniform(-0.5, 3.0), 3.0)
        eye = np.array([0.0, 0.0, -middle]) + rng.uniform(-0.1, 0.1, 3) * [1.0, 1.0, 0.0]
        rotation, translation = view.eye_from_model[:3, :3], view.eye_from_model[:3, 3]
        normal = rng.normal(size=3) * [lean, lean, 1.0]
        splats = splats_of((eye - translation)[None] @ rotation, normal[None] @ rotation, rng.uniform(0.3, 3.0))
        hierarchy = hierarchy_of(splats)
        cut = cut_of(hierarchy, silhouette=1)
        stage = Stage(ctx, renderer, hierarchy, view, cut)
        discs = numpy_discs(hierarchy, None, cut, view, True)
        if kind == "sprite" and sprite_pixels(view, discs) > 200.0:
            continue
        found = stage.disc_points(sprite=kind == "sprite")
        assert np.isfinite(found).all()
        at, along = zip(*(intersect(view, pixel_rays(view, o), discs, 0) for o in ((0.0, 0.0), *SHIFTS)), strict=True)
        inside = (np.square(at).sum(axis=-1) <= 1.0) & (np.array(along) > view.near) & (np.array(along) < view.far)
        drawn = found[..., 3] > 0.0
        thin = np.ptp(np.array(along), axis=0) > 0.05
        wrong += int((((inside.all(axis=0) & ~drawn) | (~inside.any(axis=0) & drawn)) & ~thin).sum())
        cases += 1
    tried = "discs from behind the eye to beyond the far plane, through both and through the eye"
    ledger.record("kernels", f"clipped discs ({kind}s)", tried, cases=cases, worst=wrong, bound=0, unit="pixels")


def sprite_pixels(view: View, discs: Discs) -> float:
    """Return no less than the width in pixels of the sprite of the first disc; drivers cut at some hundreds."""
    depth = -float(view.eye_from_model[2, :3] @ discs.centres[0] + view.eye_from_model[2, 3])
    nearest = max(depth - discs.radii[0], 0.02)
    return float(3.0 * discs.radii[0] * view.focal_pixels / (1.0 if view.is_parallel else nearest))


HOSTILE = {
    "at the eye, without a radius": ((0, 0, 0), (0, 0, 1), 0.0, 0.0),
    "at the eye": ((0, 0, 0), (0, 0, 1), 0.5, 0.1),
    "around the eye, edge-on": ((0, 0, 0), (1, 0, 0), 0.5, 0.0),
    "beside the eye": ((1, 0, 0), (0, 1, 0), 0.5, 0.0),
    "without a radius": ((0, 0, -2), (0, 0, 1), 0.0, 0.0),
    "without a radius, thick": ((0, 0, -2), (0, 0, 1), 0.0, 1.0),
    "without a normal": ((0, 0, -2), (0, 0, 0), 0.3, 0.1),
    "with a normal of denormals": ((0, 0, -2), (1e-40, -1e-41, -1e-40), 0.3, 0.1),
    "exactly edge-on": ((0, 0, -2), (0, 1, 0), 0.4, 0.0),
    "edge-on, off the axis": ((0.3, 0, -2), (2, 0, 0.3), 0.4, 0.0),
    "on the near plane": ((0, 0, -0.2), (0, 0, 1), 0.01, 0.0),
    "larger than all": ((0, -0.1, -2), (0, 1, 0), 1e6, 1.0),
    "smaller than float32": ((0, 0, -2), (0, 0, 1), 1e-38, 1e-38),
    "behind the eye": ((0, 0, 5), (0, 0, 1), 0.5, 0.0),
    "far behind the far plane": ((0, 0, -1e6), (0, 0, 1), 10.0, 10.0),
}
SHOWN = (
    "without a radius",
    "without a radius, thick",
    "without a normal",
    "with a normal of denormals",
    "smaller than float32",
)


@pytest.mark.parametrize("splat", ["quad", "sprite"])
@pytest.mark.parametrize("parallel", [False, True], ids=["perspective", "parallel"])
def test_hostile_surfels(ctx: moderngl.Context, renderer: Renderer, ledger: Ledger, parallel: bool, splat: str) -> None:
    centres, normals, radii, thickness = (
        np.array(column, np.float64) for column in zip(*HOSTILE.values(), strict=True)
    )
    splats = splats_of(centres, normals, radii, thickness)
    # Not scaled to unit length.
    splats["normal"] = normals
    hierarchy = hierarchy_of(splats)
    view = View(np.eye(4), 1.0, 24, 16, 0.2, 8.0, parallel_scale=1.0 if parallel else None)
    cut = cut_of(hierarchy)
    stage = Stage(ctx, renderer, hierarchy, view, cut)
    for visibility in (False, True):
        assert all(np.isfinite(values).all() for values in stage.corners(visibility=visibility))
    framebuffer = ctx.simple_framebuffer((24, 16))
    settings = Settings(splat=splat, splat_outlines=True, lod_colors=True, ground=True)
    wrong = []
    for i, case in enumerate(HOSTILE):
        renderer.draw(replace(cut, splats=cut.splats[i : i + 1]), view, settings, framebuffer)
        wrong += [f"{case}: {each}" for each in scan_targets(renderer)]
        if case in SHOWN and renderer.read_arrays().coverage.sum() < 1.0:
            wrong.append(f"{case}: is not drawn")
    ctx.detect_framebuffer(0).use()
    framebuffer.release()
    print(wrong)
    tried = "; ".join(HOSTILE)
    ledger.record("kernels", "hostile surfels", tried, cases=len(HOSTILE), worst=len(wrong), bound=0, unit="wrong")
