"""A hierarchy's cut, drawn by the plain numpy renderer with the equations of the shaders, and compared with a frame.

Rasterisers place corners on a grid of 1/256 pixel, so where a shift of the picture by that little changes what numpy
draws, or where a fragment is about as deep as the visible surface, rounding decides: those pixels are not compared.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from numpy_renderer import BoolArray, Discs, Float64Array, Picture, bilinear_tile, render
from numpy_renderer import Triangles as NumpyTriangles

from hierarchy.boxes import TURN_STEP, TURNS
from hierarchy.encoding import decode_hemisphere
from hierarchy.frames import tangents
from hierarchy.hierarchy import Hierarchy
from hierarchy.kernel import SHARPNESS
from hierarchy.leaves import Triangles
from hierarchy.lod import Cut
from hierarchy.normal_tiles import NormalTiles
from hierarchy.view import View
from renderer.frame import Frame
from renderer.splat_passes import EPSILON, FACING_AWAY, GROW, MARGIN, SINK, SMALLEST

# Of the depth, besides what the shift by SHIFT changes.
DEPTH_RELATIVE = 2e-5
# Pixels; and share of the depth by which fragments must clear the visible surface.
SHIFT = 1.0 / 256.0
CLEAR = 1e-4
SHIFTS = ((SHIFT, SHIFT), (SHIFT, -SHIFT), (-SHIFT, SHIFT), (-SHIFT, -SHIFT))


def numpy_discs(hierarchy: Hierarchy, tiles: NormalTiles | None, cut: Cut, view: View, whole: bool) -> Discs:
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
        if tiles is None or turned[i] or node >= len(tiles.tile_of_node) or tiles.tile_of_node[node] < 0:
            return np.broadcast_to(normals[i], (len(u), 3))
        codes = tiles.normal_codes(int(tiles.tile_of_node[node]))
        local = decode_hemisphere(bilinear_tile(codes.astype(np.float64), u, v))
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
    tiles: NormalTiles | None,
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
    depth_excess : by how much the depths differ beyond what a shift by SHIFT changes, as a share of the depth; ditto
    """

    picture: Picture
    stable: BoolArray
    drawn: BoolArray
    miscovered: BoolArray
    degrees: Float64Array
    depth_excess: Float64Array


def compare(
    frame: Frame, hierarchy: Hierarchy, tiles: NormalTiles | None, cut: Cut, view: View, *, whole: bool = False
) -> Comparison:
    """Draw a cut with numpy, and compare a frame with that."""
    draw = functools.partial(numpy_picture, hierarchy, tiles, cut, view, whole=whole)
    picture = draw()
    drawn = picture.coverage > 0.0
    stable = np.where(drawn, picture.margin > CLEAR * np.where(drawn, picture.depth, 1.0), True)
    changed = np.zeros(drawn.shape)
    for offset in SHIFTS:
        shifted = draw(offset)
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


def angles(a: Float64Array, b: Float64Array) -> Float64Array:
    """Return the angles in degrees between unit vectors (..., 3)."""
    half = np.linalg.norm(a.astype(np.float64) - b.astype(np.float64), axis=-1)
    result: Float64Array = np.degrees(2.0 * np.arcsin(np.clip(0.5 * half, 0.0, 1.0)))
    return result
