"""How many texels along one side a tile may have, and how many of them a view can show."""

from __future__ import annotations

import numba as nb
import numpy as np

from hierarchy.hierarchy import Hierarchy
from hierarchy.model import Int32Array, UInt32Array
from hierarchy.view import View

# Tiles are fitted by tiles of these texels a side; a fit takes the square of the square of it.
COARSER = (2, 4, 8, 16)
# Texels that are no further apart than this, in pixels, are enough.
TEXEL_PIXELS = 1.6


def sides_of(texels: int) -> tuple[int, ...]:
    """Return the texels along one side that tiles of at most `texels` may have, ascending."""
    return (*(side for side in COARSER if side < texels), texels)


@nb.njit(cache=True, nogil=True, inline="always")
def side_seen(sides, texels, across):  # type: ignore[no-untyped-def]
    """Return how many texels a side a picture shows of a tile.

    sides : texels that tiles may have, ascending; of those below `texels` the first that is enough is taken
    texels : it has at most
    across : pixels that it is wide
    """
    for side in sides:
        if side >= texels:
            break
        if (side - 1) * TEXEL_PIXELS >= across:
            return side
    return texels


@nb.njit(cache=True, nogil=True)
def _texels_seen(splats, wanted, eye, axis, focal, parallel, sides, texels, most):  # type: ignore[no-untyped-def]
    for i in range(len(wanted)):
        splat = splats[wanted[i]]
        x, y, z = splat["centre"][0] - eye[0], splat["centre"][1] - eye[1], splat["centre"][2] - eye[2]
        depth = x * axis[0] + y * axis[1] + z * axis[2]
        across = 2.0 * focal * splat["radius"]
        if not parallel:
            across = across / depth if depth > 0.0 else np.inf
        most[i] = side_seen(sides, texels, across)


def texels_seen(hierarchy: Hierarchy, view: View, nodes: UInt32Array, texels: int) -> Int32Array:
    """Return how many texels along one side of their tiles a view can show of nodes, int32 (K,).

    nodes : uint32 (K,)
    texels : along one side at most
    """
    most = np.empty(len(nodes), np.int32)
    sides = np.array(COARSER, np.int32)
    axis = -view.eye_from_model[2, :3]
    _texels_seen(hierarchy.splats, nodes, view.eye, axis, view.focal_pixels, view.is_parallel, sides, texels, most)
    return most


def tiles_seen(hierarchy: Hierarchy, view: View, splats: UInt32Array, texels: int) -> tuple[UInt32Array, Int32Array]:
    """Return the nodes among a cut's splats, uint32 (N,), the largest first, and what `texels_seen` says of them.

    splats : uint32 (K,)
    """
    nodes = np.sort(splats[splats < hierarchy.node_count])
    return nodes, texels_seen(hierarchy, view, nodes, texels)
