"""A hierarchy's cut, drawn by the plain numpy renderer with the equations of the shaders, and compared with a frame.

Rasterisers place corners on a grid of 1/256 pixel, so where a shift of the picture by that little changes what numpy
draws, or where a fragment is about as deep as the visible surface, rounding decides: those pixels are not compared.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from numpy_renderer import BoolArray, Discs, Float64Array, Picture, bilinear_tile, bounding_window, render
from numpy_renderer import Triangles as NumpyTriangles

from hierarchy.boxes import TURN_STEP, TURNS
from hierarchy.encoding import decode_hemisphere
from hierarchy.frames import tangents
from hierarchy.hierarchy import Hierarchy
from hierarchy.kernel import SHARPNESS, SMALLEST
from hierarchy.leaves import Triangles
from hierarchy.lod import Cut
from hierarchy.normal_tiles import FittedTiles, NormalTiles
from hierarchy.view import View
from renderer.frame import Frame
from renderer.splat_passes import EPSILON, FACING_AWAY, GROW, MARGIN, SINK

# Of the depth, besides what the shift by SHIFT changes.
DEPTH_RELATIVE = 2e-5
# Pixels; and share of the depth by which fragments must clear the visible surface.
SHIFT = 1.0 / 256.0
CLEAR = 1e-4
DIAGONALS = ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))
SHIFTS = tuple((SHIFT * x, SHIFT * y) for x, y in DIAGONALS)
# Where the near plane cuts primitives, their corners may be a hundred thousand pixels away, rounded to float32.
CUT_SHIFT = 0.25

Tiles = NormalTiles | FittedTiles


def tile_codes(tiles: Tiles, node: int) -> Float64Array | None:
    """Return the codes of a node's tile as encoding.py has them, (w, w, 2); None: the node has none."""
    if isinstance(tiles, NormalTiles):
        tile = int(tiles.tile_of_node[node])
        return None if tile < 0 else tiles.normal_codes(tile).astype(np.float64)
    (here,) = np.flatnonzero(tiles.nodes == node)
    side = int(tiles.sides[here])
    if side == 0:
        return None
    low, width = tiles.spreads[here].astype(np.float64).reshape(2, 2)
    return low + width / 255.0 * tiles.normals[side][np.count_nonzero(tiles.sides[:here] == side)]


def numpy_discs(hierarchy: Hierarchy, tiles: Tiles | None, cut: Cut, view: View, whole: bool) -> Discs:
    """Return the splats of a cut as the equations of the passes have them; `whole` discs or their rectangles."""
    splats = hierarchy.splats[cut.splats]
    normals, radii = splats["normal"].astype(np.float64), splats["radius"].astype(np.float64)
    thickness = splats["thickness"].astype(np.float64)
    silhouette = np.arange(len(splats)) < cut.silhouette_splats
    sink = np.where(silhouette, SINK * thickness, 0.0)
    centres = splats["centre"] - sink[:, None] * normals
    depths = -(centres @ view.eye_from_model[2, :3] + view.eye_from_model[2, 3])
    pixels = (1.0 if view.is_parallel else np.maximum(depths, 0.0)) / view.focal_pixels + 0.0 * depths

    # Below the size of a pixel a disc faces the eye, whole and without a tile; so does one without a normal.
    turned = (radii < SMALLEST * pixels) | ((normals**2).sum(axis=1) < 0.5)
    frames = np.array([tangents(*normal) for normal in normals]).reshape(-1, 6)
    o1, o2, planes = (
        np.where(turned[:, None], axis, usual)
        for axis, usual in zip(view.eye_from_model[:3, :3], (frames[:, :3], frames[:, 3:], normals), strict=True)
    )

    def tile_normals(i: int, u: Float64Array, v: Float64Array) -> Float64Array:
        node = int(cut.splats[i])
        is_plain = tiles is None or turned[i] or node >= hierarchy.node_count
        codes = None if is_plain or tiles is None else tile_codes(tiles, node)
        if codes is None:
            return np.broadcast_to(normals[i], (len(u), 3))
        local = decode_hemisphere(bilinear_tile(codes, u, v))
        mapped: Float64Array = local @ np.stack([o1[i], o2[i], normals[i]])
        return mapped

    boxes = splats["box"].astype(np.float64)
    turns = np.rint(boxes[:, 3] / TURN_STEP)
    boxes[:, 3] -= TURN_STEP * turns
    margins = ((MARGIN[0] * pixels + MARGIN[1] * thickness) / np.maximum(radii, 1e-30))[:, None] * [-1, 1, -1, 1]
    return Discs(
        centres,
        normals,
        np.maximum(radii + np.where(silhouette, 0.0, GROW * pixels), SMALLEST * pixels),
        EPSILON[0] * thickness + EPSILON[1] * np.maximum(radii, SMALLEST * pixels),
        o1,
        o2,
        tile_normals,
        None if whole else np.where(turned[:, None], [-1.0, 1.0, -1.0, 1.0], np.clip(boxes + margins, -1.0, 1.0)),
        0.5 * np.pi * turns / TURNS,
        planes,
    )


def numpy_picture(
    hierarchy: Hierarchy,
    tiles: Tiles | None,
    cut: Cut,
    view: View,
    offset: tuple[float, float] = (0.0, 0.0),
    whole: bool = False,
) -> Picture:
    """Draw a cut; offset : as of `numpy_renderer.render`."""
    triangles, leaves = None, hierarchy.leaves
    if isinstance(leaves, Triangles):
        corners, normals = (array[cut.indices].astype(np.float64) for array in (leaves.positions, leaves.normals))
        triangles = NumpyTriangles(corners, normals, np.full(len(corners), 1.0 / view.focal_pixels))
    return render(
        view,
        numpy_discs(hierarchy, tiles, cut, view, whole),
        triangles,
        lambda rho2: np.exp(-SHARPNESS * rho2),
        close_cracks=True,
        offset=offset,
        facing_away=FACING_AWAY,
    )


@dataclass(frozen=True, eq=False)
class Comparison:
    """A frame beside numpy's picture of the same cut; arrays (H, W).

    stable : rounding decides nothing here
    drawn : numpy draws something
    miscovered : stable, and only one of the two draws something
    degrees : between the normals; 0 where one of the two draws nothing, or where the pixel is not stable
    depth_excess : by how much the depths differ beyond what such a shift changes, as a share of the depth; ditto
    """

    picture: Picture
    stable: BoolArray
    drawn: BoolArray
    miscovered: BoolArray
    degrees: Float64Array
    depth_excess: Float64Array


def compare(
    frame: Frame,
    hierarchy: Hierarchy,
    tiles: Tiles | None,
    cut: Cut,
    view: View,
    *,
    whole: bool = False,
    wary: bool = False,
) -> Comparison:
    """Draw a cut with numpy, and compare a frame with that.

    wary : leave out `slivers` and `held_back`, too, and more where the near plane cuts primitives
    """
    draw = functools.partial(numpy_picture, hierarchy, tiles, cut, view, whole=whole)
    picture = draw()
    drawn = picture.coverage > 0.0
    depths = np.where(drawn, picture.depth, view.near)
    stable = np.where(drawn, picture.margin > clearance(view, depths), True)
    shift = SHIFT
    if wary:
        discs = numpy_discs(hierarchy, tiles, cut, view, whole)
        stable &= ~slivers(hierarchy, cut, view, discs) & ~held_back(view, discs)
        shift = CUT_SHIFT if are_cut(hierarchy, cut, view, discs) else SHIFT
    changed = np.zeros(drawn.shape)
    for x, y in DIAGONALS:
        shifted = draw((shift * x, shift * y))
        both = drawn & (shifted.coverage > 0.0)
        turned = both & (angles(shifted.normal, picture.normal) > 0.25)
        stable &= (drawn == (shifted.coverage > 0.0)) & ~turned
        changed[both] += np.abs(shifted.depth[both] - picture.depth[both])
    here = stable & drawn & (frame.coverage > 0.0)
    # Depths of a frame are counted from the camera's position.
    depth = frame.depth.astype(np.float64) - view.depth_of_eye
    excess = np.zeros(drawn.shape)
    excess[here] = np.abs(depth[here] - picture.depth[here]) - changed[here]
    excess[here] /= picture.depth[here]
    return Comparison(
        picture,
        stable,
        drawn,
        stable & ((frame.coverage > 0.0) != drawn),
        np.where(here, angles(frame.normal, picture.normal), 0.0),
        np.maximum(excess, 0.0),
    )


def clearance(view: View, depths: Float64Array) -> Float64Array:
    """Return by how much depths must differ for no rounding to decide which is less."""
    slab = view.far - view.near
    # Steps of a 24-bit depth buffer: of 1 / depth in perspective.
    step = 2.0**-24 * slab * (1.0 if view.is_parallel else depths * depths / (view.near * view.far))
    return 16.0 * step + CLEAR * np.minimum(depths, slab)


def angles(a: Float64Array, b: Float64Array) -> Float64Array:
    """Return the angles in degrees between unit vectors (..., 3)."""
    half = np.linalg.norm(a.astype(np.float64) - b.astype(np.float64), axis=-1)
    result: Float64Array = np.degrees(2.0 * np.arcsin(np.clip(0.5 * half, 0.0, 1.0)))
    return result


# Mean width in pixels, twice the area over the perimeter, below which a primitive is a sliver: a rasteriser's grid
# decides which pixels it meets, and no shift need show it.
SLIVER = 0.1


def slivers(hierarchy: Hierarchy, cut: Cut, view: View, discs: Discs) -> BoolArray:
    """Return the pixels, (H, W), that slivers pass so closely that a rasteriser may or may not take them."""
    polygons: list[Float64Array] = []
    turn = 2.0 * np.pi * np.arange(32)[:, None] / 32
    for i, radius in enumerate(discs.radii):
        polygons.append(discs.centres[i] + radius * (np.cos(turn) * discs.o1[i] + np.sin(turn) * discs.o2[i]))
    if isinstance(hierarchy.leaves, Triangles):
        polygons += list(hierarchy.leaves.positions[cut.indices].astype(np.float64))
    near = np.zeros((view.height, view.width), np.bool_)
    rows, columns = np.mgrid[0 : view.height, 0 : view.width] + 0.5
    pixels = np.stack([columns, rows], axis=-1)
    for polygon in polygons:
        eye = polygon @ view.eye_from_model[:3, :3].T + view.eye_from_model[:3, 3]
        outline = _outline(view, eye)
        # Positions in float32, close to the eye, where that is many pixels.
        nearest = 1.0 if view.is_parallel else max(float(-eye[:, 2].max()), 0.5 * view.near)
        blur = 2.0 * SHIFT + 2.0**-22 * float(view.pixels_of_unit(nearest)) * max(1.0, float(np.abs(eye).max()))
        following = np.roll(outline, -1, axis=0)
        area = abs(float((outline[:, 0] * following[:, 1] - outline[:, 1] * following[:, 0]).sum()))
        edges = following - outline
        # What reaches behind the eye is a wedge, and a sliver where it is far away.
        wide = area > (SLIVER + blur) * float(np.linalg.norm(edges, axis=1).sum())
        if len(outline) == 0 or (wide and -eye[:, 2].max() > view.near):
            continue
        for start, edge in zip(outline, edges, strict=True):
            offset = pixels - start
            share = np.clip((offset @ edge) / max(float(edge @ edge), 1e-30), 0.0, 1.0)
            near |= np.linalg.norm(offset - share[..., None] * edge, axis=-1) < blur
    return near


def are_cut(hierarchy: Hierarchy, cut: Cut, view: View, discs: Discs) -> bool:
    """Tell whether the near plane cuts anything of a cut."""
    axis, offset = -view.eye_from_model[2, :3], -view.eye_from_model[2, 3]
    nearest = (discs.centres @ axis + offset - discs.radii).min(initial=np.inf)
    if isinstance(hierarchy.leaves, Triangles):
        corners = hierarchy.leaves.positions[cut.indices].astype(np.float64)
        nearest = (corners @ axis + offset).min(initial=nearest)
    return bool(nearest < view.near)


def held_back(view: View, discs: Discs) -> BoolArray:
    """Return the pixels, (H, W), around discs of which a part would be pushed beyond the far plane.

    Corners stay before it, so that such a disc is pushed by less than epsilon, and hides more of its neighbours.
    """
    near = np.zeros((view.height, view.width), np.bool_)
    cube = np.indices((2, 2, 2)).reshape(3, 8).T * 2.0 - 1.0
    eye = discs.centres @ view.eye_from_model[:3, :3].T + view.eye_from_model[:3, 3]
    for centre, radius, epsilon in zip(eye, discs.radii, discs.epsilons, strict=True):
        deepest = -float(centre[2]) + 1.5 * float(radius)
        share = epsilon / max(float(np.linalg.norm(centre)), epsilon, 1e-30)
        if (deepest + epsilon if view.is_parallel else deepest * (1.0 + share)) > view.far:
            near[bounding_window(view, centre + radius * cube)] = True
    return near


def _outline(view: View, polygon: Float64Array) -> Float64Array:
    """Return in pixels what of a polygon, eye space (K, 3), lies beyond the near plane, (L, 2)."""
    kept: list[Float64Array] = []
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        # A little before it: the visibility pass sees more than the attribute pass.
        before, after = -a[2] - 0.5 * view.near, -b[2] - 0.5 * view.near
        kept += [a] if before >= 0.0 else []
        kept += [a + (b - a) * before / (before - after)] if (before < 0.0) != (after < 0.0) else []
    points = np.array(kept).reshape(-1, 3)
    across: Float64Array = points[:, :2] * np.array([1.0, -1.0]) * view.pixels_of_unit(-points[:, 2])[:, None]
    return across + np.array([0.5 * view.width, 0.5 * view.height])
