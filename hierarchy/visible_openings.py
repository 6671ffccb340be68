"""Which part of a picture shows the inside of an open surface: where the front of a cap is (openings.py).

The picture is divided into GRID x GRID cells, and sums over their rectangles answer at once whether a node lies beside
all caps. How deep the caps are does not count: it would cull little more, and where a cap lies in the surface itself
it could not be told.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from hierarchy.cells import row_span, span
from hierarchy.frames import tangents
from hierarchy.hierarchy import Hierarchy
from hierarchy.leaves import Triangles
from hierarchy.model import Float64Array, Int32Array
from hierarchy.view import View
from hierarchy.winding import signed_crossing

# Cells along each side of the picture: 16 pixels of 1024. Clearing and summing them takes 5 microseconds.
GRID = 64
# An eye nearer to a triangle than this share of the model's radius counts as being on either side of it.
ON_SURFACE = 1e-6

NO_CAP_IN_VIEW = np.empty((0, 0), np.int32)


def hidden_backs(hierarchy: Hierarchy, view: View) -> tuple[bool, Int32Array]:
    """Tell whether what faces away is hidden outside the caps in view, and where those are.

    Returns False where the eye may be inside the surface or its openings are not known; and sums int32
    (GRID + 1, GRID + 1) over all cells left of and below each corner of the grid, row 0 at the bottom, or (0, 0) where
    no cap is in view.
    """
    openings = hierarchy.openings
    # Parallel rays come from outside.
    if openings is None or (not view.is_parallel and _may_be_inside(hierarchy, view.eye)):
        return False, NO_CAP_IN_VIEW
    if len(openings.caps) == 0:
        return True, NO_CAP_IN_VIEW
    to_screen, tolerance = screen_rows(view), ON_SURFACE * hierarchy.radius
    eyes = view.eye, view.homogeneous_eye
    sums: Int32Array = _covered(openings.caps, *eyes, view.eye_from_model[2, :3], to_screen, tolerance)
    return True, sums


def screen_rows(view: View) -> Float64Array:
    """Return rows (x, y, z, length) for columns and rows of the grid, float64 (2, 4).

    The dot product of the first three with a vector from the eye, divided by its depth in perspective, is how many
    cells the picture's middle is left of it, or below it.
    """
    f = 0.5 * GRID / view.half_height
    scales = np.array([[f * view.height / view.width], [f]])
    return np.hstack([scales * view.eye_from_model[:2, :3], scales])


def _may_be_inside(hierarchy: Hierarchy, eye: Float64Array) -> bool:
    """Tell whether the winding number of the surface and its caps is positive at the eye, or at a place beside it."""
    assert hierarchy.openings is not None
    leaves, tolerance = hierarchy.leaves, ON_SURFACE * hierarchy.radius
    if not isinstance(leaves, Triangles):
        # Discs do not join up to a surface that has an inside.
        return bool(np.linalg.norm(eye) <= hierarchy.radius + tolerance)
    caps = hierarchy.openings.caps
    return bool(_largest_winding(hierarchy.nodes, leaves.positions, leaves.indices, caps, eye, tolerance) > 0)


@nb.njit(cache=True, nogil=True, inline="always")
def _crossing(a, b, c, eye, frame, tolerance):  # type: ignore[no-untyped-def]
    """Return what a triangle adds to the winding number of an eye; an eye on it takes the side with the larger one."""
    ux, uy, uz, vx, vy, vz, nx, ny, nz = frame
    px, py, pz = a[0] - eye[0], a[1] - eye[1], a[2] - eye[2]
    qx, qy, qz = b[0] - eye[0], b[1] - eye[1], b[2] - eye[2]
    rx, ry, rz = c[0] - eye[0], c[1] - eye[1], c[2] - eye[2]
    sign, depth = signed_crossing(
        ux * px + uy * py + uz * pz, vx * px + vy * py + vz * pz, nx * px + ny * py + nz * pz,
        ux * qx + uy * qy + uz * qz, vx * qx + vy * qy + vz * qz, nx * qx + ny * qy + nz * qz,
        ux * rx + uy * ry + uz * rz, vx * rx + vy * ry + vz * rz, nx * rx + ny * ry + nz * rz,
    )  # fmt: skip
    if depth > tolerance:
        return sign
    return max(sign, 0) if depth >= -tolerance else 0


@nb.njit(cache=True, nogil=True)
def _largest_winding(nodes, positions, indices, caps, eye, tolerance):  # type: ignore[no-untyped-def]
    """Follow a ray from the eye out of the model through the hierarchy, and look at every cap."""
    distance = math.sqrt(eye[0] * eye[0] + eye[1] * eye[1] + eye[2] * eye[2])
    dx, dy, dz = (eye[0] / distance, eye[1] / distance, eye[2] / distance) if distance > 0.0 else (0.0, 0.0, 1.0)
    ux, uy, uz, vx, vy, vz = tangents(dx, dy, dz)
    frame = (ux, uy, uz, vx, vy, vz, dx, dy, dz)
    number = 0
    for k in range(len(caps)):
        number += _crossing(caps[k, 0], caps[k, 1], caps[k, 2], eye, frame, tolerance)
    # A binary tree over 63-bit codes and 31-bit counts is at most 94 levels deep.
    stack = np.empty(128, np.int32)
    stack[0] = 0
    top = 1
    while top > 0:
        top -= 1
        node = nodes[stack[top]]
        x, y, z = node["x"] - eye[0], node["y"] - eye[1], node["z"] - eye[2]
        sphere = np.float64(node["sphere"]) + tolerance
        along = x * dx + y * dy + z * dz
        if along < -sphere or x * x + y * y + z * z - along * along > sphere * sphere:
            continue
        last = node["first_child"] + node["child_count"]
        begin = node["leaf_begin"]
        for child in range(node["first_child"], last + 1):
            end = nodes[child]["leaf_begin"] if child < last else node["leaf_end"]
            for leaf in range(begin, end):
                a, b, c = indices[leaf, 0], indices[leaf, 1], indices[leaf, 2]
                number += _crossing(positions[a], positions[b], positions[c], eye, frame, tolerance)
            if child < last:
                begin = nodes[child]["leaf_end"]
                stack[top] = child
                top += 1
    return number


@nb.njit(cache=True, nogil=True, inline="always")
def _faces(cap, eye, tolerance):  # type: ignore[no-untyped-def]
    """Tell whether the eye (homogeneous) is before a cap's plane, or in it."""
    ux, uy, uz = cap[1, 0] - cap[0, 0], cap[1, 1] - cap[0, 1], cap[1, 2] - cap[0, 2]
    vx, vy, vz = cap[2, 0] - cap[0, 0], cap[2, 1] - cap[0, 1], cap[2, 2] - cap[0, 2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    w = eye[3]
    height = nx * (eye[0] - w * cap[0, 0]) + ny * (eye[1] - w * cap[0, 1]) + nz * (eye[2] - w * cap[0, 2])
    return height >= -tolerance * math.sqrt(nx * nx + ny * ny + nz * nz)


@nb.njit(cache=True, nogil=True)
def _cover(cap, eye, parallel, back, screen, cells):  # type: ignore[no-untyped-def]
    """Mark the cells that a cap can be seen in; in perspective all of them where it reaches behind the eye."""
    at = np.empty((3, 2), np.float64)
    behind = 0
    for k in range(3):
        x, y, z = cap[k, 0] - eye[0], cap[k, 1] - eye[1], cap[k, 2] - eye[2]
        depth = 1.0 if parallel else -(back[0] * x + back[1] * y + back[2] * z)
        if depth <= 0.0:
            behind += 1
            continue
        for axis in range(2):
            at[k, axis] = 0.5 * GRID + (screen[axis, 0] * x + screen[axis, 1] * y + screen[axis, 2] * z) / depth
    if behind == 3:
        return
    if behind > 0:
        cells[:] = 1
        return
    ax, ay, bx, by, cx, cy = at[0, 0], at[0, 1], at[1, 0], at[1, 1], at[2, 0], at[2, 1]
    first, last = span(min(ay, by, cy), max(ay, by, cy), GRID)
    for row in range(first, last):
        left, right = row_span(ax, ay, bx, by, cx, cy, row)
        begin, end = span(left, right, GRID)
        for column in range(begin, end):
            cells[row, column] = 1


@nb.njit(cache=True, nogil=True)
def _covered(caps, eye, eye4, back, screen, tolerance):  # type: ignore[no-untyped-def]
    """Return the sums over the cells that show the front of a cap, or (0, 0) where there is none."""
    cells = np.zeros((GRID, GRID), np.int32)
    corners = np.empty((3, 3), np.float64)
    for k in range(len(caps)):
        corners[:] = caps[k]
        if _faces(corners, eye4, tolerance):
            _cover(corners, eye, eye4[3] == 0.0, back, screen, cells)
    sums = np.zeros((GRID + 1, GRID + 1), np.int32)
    for row in range(GRID):
        along = 0
        for column in range(GRID):
            along += cells[row, column]
            sums[row + 1, column + 1] = sums[row, column + 1] + along
    return sums if sums[GRID, GRID] > 0 else np.empty((0, 0), np.int32)


@nb.njit(cache=True, nogil=True, inline="always")
def _interval(middle, reach, near, far):  # type: ignore[no-untyped-def]
    """Return the first and the last cell of middle - reach .. middle + reach, divided by depths from near to far."""
    low, high = middle - reach, middle + reach
    low = low / far if low > 0.0 else low / near
    high = high / near if high > 0.0 else high / far
    first = math.floor(min(max(0.5 * GRID + low, 0.0), GRID - 1.0))
    last = math.floor(min(max(0.5 * GRID + high, 0.0), GRID - 1.0))
    return int(first), int(last)


@nb.njit(cache=True, nogil=True, inline="always")
def beside_caps(sums, screen, x, y, z, depth, sphere, reach):  # type: ignore[no-untyped-def]
    """Tell whether no cap is seen where a sphere is.

    sums : as `hidden_backs` returns them, not (0, 0)
    screen : as in `screen_rows`
    x, y, z, depth : the sphere's centre relative to the eye, and its depth; 1 where the view rays are parallel
    sphere, reach : its radius, and by how much depth differs in it: as much, or 0 where the view rays are parallel
    """
    near, far = depth - reach, depth + reach
    if near <= 0.0:
        return False
    across = screen[0, 0] * x + screen[0, 1] * y + screen[0, 2] * z
    above = screen[1, 0] * x + screen[1, 1] * y + screen[1, 2] * z
    left, right = _interval(across, screen[0, 3] * sphere, near, far)
    low, high = _interval(above, screen[1, 3] * sphere, near, far)
    inside = sums[high + 1, right + 1] - sums[low, right + 1] - sums[high + 1, left] + sums[low, left]
    return bool(inside == 0)
