"""What a cut's picture will be wrong by, predicted from the spreads and the relief that the hierarchy holds.

At a pixel the drawn normal differs from the true one by about what the normals vary over the distance between two
texels, over a part of the pixel itself, or over the distance by which relief, seen at an angle, displaces the lookup in
the tile (spreads.py). To that come pixels on outlines and edges, where the truth is a mixture and a pixel has one
sample: a share that falls with the root of the model's area on screen. The outline is displaced by a share of the
relief of the splats on it, by those that are widened to show in a pixel at all, and by that one sample.

The factors are fitted: they bound the means that were measured on Igea, the meteoroid, the bunny, fandisk and spot,
from orbit, close up, far away, inside the bounding box and grazing, with r_sil from 1 to 6, r_inner from 4 to 64 and
tiles of 2 to 32 texels. docs/benchmarks.md says how tight they are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numba as nb
import numpy as np

from hierarchy.boxes import TURN_STEP
from hierarchy.hierarchy import Hierarchy
from hierarchy.kernel import SMALLEST
from hierarchy.leaves import Triangles
from hierarchy.lod import Cut
from hierarchy.spreads import SCALES, UNIT
from hierarchy.tile_sizes import COARSER, side_seen
from hierarchy.view import View

# Shares of the texels' spacing, of the displacement by relief, and of a pixel, at which the spread counts. Of w_s
# texels a side w_s - 1.5 count: two texels alone hold nothing of what varies inside the disc.
TEXEL_SHARE, RELIEF_SHARE, PIXEL_SHARE = 0.5, 0.5, 0.25
SHARED_TEXELS = 1.5
# Relief at grazing angles: beyond this tangent the neighbours hide what would be displaced.
MAX_TANGENT = 2.0
# Degrees a degree of spread; degrees times the root of the area in pixels; degrees.
SPREAD_FACTOR, EDGE_DEGREES, LEAST_DEGREES = 1.40, 160.0, 0.02
# Pixels a pixel of relief on the outline; pixels.
RELIEF_FACTOR, LEAST_PIXELS = 0.24, 0.20
# Discs below SMALLEST are drawn as large as that (renderer/splat_passes.py) and stick out by it, and since they overlap
# on the outline they make more of it grow than their share of it. Measured with Igea 10 to 180 pixels high and radii of
# a pixel or more; below, the outline may grow by 0.7 pixels, whatever is promised.
OVERLAP = 3.0
# The mean width of a triangle over the root of its area.
TRIANGLE_WIDTH = 1.5


@nb.njit(cache=True, nogil=True, inline="always")
def _spread(spreads, node, scale):  # type: ignore[no-untyped-def]
    """Return a node's spread in radians for patches of `scale` times its radius, interpolated in the logarithm."""
    level = min(max(-math.log2(max(scale, 1e-9)), 0.0), SCALES - 1.0)
    low = min(int(level), SCALES - 2)
    share = level - low
    return UNIT * ((1.0 - share) * spreads[node, low] + share * spreads[node, low + 1])


@nb.njit(cache=True, nogil=True)
def _sum_splats(nodes, records, spreads, splats, silhouette, view, sides, texels, sums, reliefs):  # type: ignore[no-untyped-def]
    """Add to sums the area of the splats and, for each w_s, area * spread; to reliefs length and length * relief.

    view : eye, direction of the axis, focal length in pixels, whether the view rays are parallel
    sides : texels along one side that smaller tiles may have; what fitting them leaves out is within the factors
    sums : float64 (1 + W,), pixels and pixels * radians; reliefs : float64 (3,), pixels, pixels^2, and pixels of those
        that are smaller than SMALLEST
    """
    eye, axis, focal, parallel = view
    for i in range(len(splats)):
        index = splats[i]
        record = records[index]
        centre, normal, box = record["centre"], record["normal"], record["box"]
        x, y, z = centre[0] - eye[0], centre[1] - eye[1], centre[2] - eye[2]
        depth = x * axis[0] + y * axis[1] + z * axis[2]
        if depth <= 0.0:
            continue
        pixels = focal if parallel else focal / depth
        if parallel:
            x, y, z = axis[0], axis[1], axis[2]
        distance = math.sqrt(x * x + y * y + z * z)
        cosine = min(abs(normal[0] * x + normal[1] * y + normal[2] * z) / distance, 1.0)
        radius = max(record["radius"] * pixels, 1e-6)
        height = box[3] - TURN_STEP * round(box[3] / TURN_STEP) - box[2]
        area = (box[1] - box[0]) * height * radius * radius * cosine
        sums[0] += area
        relief = nodes[index]["relief"] * pixels if index < len(nodes) else 0.0
        if i < silhouette:
            reliefs[0] += 2.0 * radius
            reliefs[1] += 2.0 * radius * relief
            if radius < SMALLEST:
                reliefs[2] += 2.0 * radius
        if index >= len(nodes):
            continue
        sine = math.sqrt(1.0 - cosine * cosine)
        shift = RELIEF_SHARE * relief / radius * min(sine / max(cosine, 1e-6), MAX_TANGENT)
        pixel = PIXEL_SHARE / radius
        for k in range(len(texels)):
            side = side_seen(sides, texels[k], 2.0 * radius)
            spacing = TEXEL_SHARE / max(side - SHARED_TEXELS, TEXEL_SHARE)
            scale = min(math.sqrt(spacing * spacing + shift * shift + pixel * pixel), 1.0)
            sums[1 + k] += area * _spread(spreads, index, scale)


@nb.njit(cache=True, nogil=True)
def _sum_triangles(positions, indices, silhouette, view, sums, reliefs):  # type: ignore[no-untyped-def]
    """Add the area of the leaf triangles to sums, and the length of those on the silhouette to reliefs."""
    eye, axis, focal, parallel = view
    for i in range(len(indices)):
        a, b, c = indices[i, 0], indices[i, 1], indices[i, 2]
        px, py, pz = positions[a, 0] - eye[0], positions[a, 1] - eye[1], positions[a, 2] - eye[2]
        ux, uy, uz = positions[b, 0] - eye[0] - px, positions[b, 1] - eye[1] - py, positions[b, 2] - eye[2] - pz
        vx, vy, vz = positions[c, 0] - eye[0] - px, positions[c, 1] - eye[1] - py, positions[c, 2] - eye[2] - pz
        depth = px * axis[0] + py * axis[1] + pz * axis[2]
        if depth <= 0.0:
            continue
        pixels = focal if parallel else focal / depth
        if parallel:
            px, py, pz = axis[0], axis[1], axis[2]
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        distance = math.sqrt(px * px + py * py + pz * pz)
        sums[0] += 0.5 * abs(nx * px + ny * py + nz * pz) / distance * pixels * pixels
        if i < silhouette:
            area = 0.5 * math.sqrt(nx * nx + ny * ny + nz * nz)
            reliefs[0] += TRIANGLE_WIDTH * math.sqrt(area) * pixels


def _sums(hierarchy: Hierarchy, view: View, cut: Cut, texels: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    sums, reliefs = np.zeros(1 + len(texels)), np.zeros(3)
    eye_and_rays = (view.eye, -view.eye_from_model[2, :3], view.focal_pixels, view.is_parallel)
    arrays = (hierarchy.nodes, hierarchy.splats, hierarchy.spreads, cut.splats, cut.silhouette_splats)
    sides = np.array(COARSER, np.int32)
    _sum_splats(*arrays, eye_and_rays, sides, np.asarray(texels, np.int64), sums, reliefs)
    leaves = hierarchy.leaves
    if isinstance(leaves, Triangles) and len(cut.indices):
        triangles = (leaves.positions, cut.indices, cut.silhouette_triangles)
        _sum_triangles(*triangles, eye_and_rays, sums, reliefs)
    return sums, reliefs


def promised_errors(
    hierarchy: Hierarchy, view: View, cut: Cut, texels: Sequence[int]
) -> tuple[tuple[float, ...], float]:
    """Predict bounds of a cut's mean errors.

    texels : sizes of tiles (w_s) that it might be drawn with
    Returns for each of them the angle between drawn and true normals, degrees, and the displacement of the outline,
    pixels. A cut that draws nothing promises 0 for both.
    """
    sums, (length, relief, small) = _sums(hierarchy, view, cut, texels)
    area = float(sums[0])
    if area <= 0.0:
        return (0.0,) * len(texels), 0.0
    least = LEAST_DEGREES + EDGE_DEGREES / math.sqrt(area)
    degrees = tuple(SPREAD_FACTOR * math.degrees(float(spread) / area) + least for spread in sums[1:])
    if length <= 0.0:
        return degrees, 0.0
    widened = SMALLEST * min(OVERLAP * small / length, 1.0)
    return degrees, float(LEAST_PIXELS + RELIEF_FACTOR * relief / length + widened)
