"""Where on screen a cut can be: the span of columns that it reaches in every strip of rows.

Bounds, not exact: what is drawn of a splat lies in the sphere around its disc, and of a triangle in the box of its
corners. Passes over the picture need not look elsewhere.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from hierarchy.leaves import Leaves, Triangles
from hierarchy.model import Float32Array, UInt32Array
from hierarchy.view import View

# Rows of a strip.
STRIP = 16


@nb.njit(cache=True, nogil=True, inline="always")
def _reach(spans, left, right, low, high, margin):  # type: ignore[no-untyped-def]
    """Widen the spans of the strips that rows low .. high meet, by columns left .. right; both from the lower left."""
    first = max(int(max(low - margin, 0.0)) // STRIP, 0)
    last = min(int(max(min(high + margin, 1e9), -1.0)) // STRIP, len(spans) - 1)
    for strip in range(first, last + 1):
        spans[strip, 0] = min(spans[strip, 0], left - margin)
        spans[strip, 1] = max(spans[strip, 1], right + margin)


@nb.njit(cache=True, nogil=True, inline="always")
def _ends(middle, radius, nearest, farthest):  # type: ignore[no-untyped-def]
    """Return the least and the most that middle -+ radius can be over a depth between nearest and farthest."""
    low, high = middle - radius, middle + radius
    return low / (farthest if low > 0.0 else nearest), high / (nearest if high > 0.0 else farthest)


@nb.njit(cache=True, nogil=True)
def _spans(splats, positions, indices, camera, margin, spans):  # type: ignore[no-untyped-def]
    """Fill the spans; return whether something reaches the near plane, before which nothing bounds what it covers."""
    eye, focal, width, height, near, parallel = camera
    centre_x, centre_y = 0.5 * width, 0.5 * height
    for k in range(len(splats)):
        splat = splats[k]
        p = splat["centre"]
        x = eye[0, 0] * p[0] + eye[0, 1] * p[1] + eye[0, 2] * p[2] + eye[0, 3]
        y = eye[1, 0] * p[0] + eye[1, 1] * p[1] + eye[1, 2] * p[2] + eye[1, 3]
        depth = -(eye[2, 0] * p[0] + eye[2, 1] * p[1] + eye[2, 2] * p[2] + eye[2, 3])
        radius = np.float64(splat["radius"]) + np.float64(splat["thickness"])
        nearest, farthest = (1.0, 1.0) if parallel else (depth - radius, depth + radius)
        if nearest <= near and not parallel:
            return True
        left, right = _ends(x, radius, nearest, farthest)
        low, high = _ends(y, radius, nearest, farthest)
        left, right, low, high = left * focal, right * focal, low * focal, high * focal
        _reach(spans, centre_x + left, centre_x + right, centre_y + low, centre_y + high, margin)
    for k in range(len(indices)):
        left, right, low, high = np.inf, -np.inf, np.inf, -np.inf
        for corner in range(3):
            p = positions[indices[k, corner]]
            x = eye[0, 0] * p[0] + eye[0, 1] * p[1] + eye[0, 2] * p[2] + eye[0, 3]
            y = eye[1, 0] * p[0] + eye[1, 1] * p[1] + eye[1, 2] * p[2] + eye[1, 3]
            depth = -(eye[2, 0] * p[0] + eye[2, 1] * p[1] + eye[2, 2] * p[2] + eye[2, 3])
            if depth <= near and not parallel:
                return True
            scale = focal if parallel else focal / depth
            left, right = min(left, x * scale), max(right, x * scale)
            low, high = min(low, y * scale), max(high, y * scale)
        _reach(spans, centre_x + left, centre_x + right, centre_y + low, centre_y + high, margin)
    return False


def reached_spans(splats: np.ndarray, leaves: Leaves, indices: UInt32Array, view: View, margin: float) -> Float32Array:
    """Return the columns that a cut can reach in every strip of STRIP rows, from the bottom up: float32 (S, 2).

    splats : SPLAT (K,), the records of the cut's splats
    leaves : of the hierarchy
    indices : uint32 (T, 3), of the cut's leaf triangles
    margin : pixels by which more is drawn than the model's discs and triangles, or is to be looked at

    Pixels lie between the two, counted from the left; where nothing can be the first is not below the second.
    """
    strips = -(-view.height // STRIP)
    spans = np.empty((strips, 2))
    spans[:, 0], spans[:, 1] = view.width, 0.0
    positions = leaves.positions if isinstance(leaves, Triangles) else np.empty((0, 3), np.float32)
    camera = (view.eye_from_model, view.focal_pixels, view.width, view.height, view.near, view.is_parallel)
    if _spans(splats, positions, indices, camera, float(margin), spans):
        spans[:, 0], spans[:, 1] = 0.0, view.width
    return np.clip(spans, 0.0, view.width).astype(np.float32)
