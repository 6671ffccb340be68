"""The ways to draw a model that are measured beside each other, each with what it takes from the papers.

All share the renderer's passes and the context; only the selection, the hierarchy and the settings differ. "triangles"
and "triangles, culled" are drawn by `TriangleBaseline` instead, and have no cut.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numba as nb
import numpy as np

from hierarchy.hierarchy import Hierarchy
from hierarchy.lod import Cut, select_cut
from hierarchy.model import UInt32Array
from hierarchy.view import View
from renderer.settings import Settings

DEFAULT = Settings()
FLAT = Settings(normal_mapping=False)

Select = Callable[[Hierarchy, View, float, float], Cut]


@dataclass(frozen=True)
class Method:
    """One way to draw.

    text : what it is, one line
    select : chooses the cut; None: the mesh itself is drawn as triangles
    points : it draws a point hierarchy, its leaves surfels instead of triangles
    radii, tiles : r_sil and r_inner, w_s mean something to it
    fitted : its tiles have no more texels than the normals below a node and the view need; else w_s x w_s each
    cull : triangles that face away are left out (closed meshes only)
    """

    text: str
    select: Select | None
    settings: Settings = DEFAULT
    points: bool = False
    radii: bool = True
    tiles: bool = True
    fitted: bool = True
    cull: bool = False


def _select(hierarchy: Hierarchy, view: View, r_sil: float, r_inner: float) -> Cut:
    return select_cut(hierarchy, view, r_sil, r_inner)


def _select_printed(hierarchy: Hierarchy, view: View, r_sil: float, r_inner: float) -> Cut:
    return select_cut(hierarchy, view, r_sil, r_inner, printed_cone_test=True)


def select_base(hierarchy: Hierarchy, view: View, r_sil: float = 0.0, r_inner: float = 0.0) -> Cut:
    """Return all leaf surfels of a point hierarchy; of a closed model those whose discs face away are left out.

    What a renderer without a hierarchy would draw: it tests each surfel for itself, and no group of them, not even
    against the frustum.
    """
    count = hierarchy.node_count
    if not hierarchy.closed:
        splats = np.arange(count, count + hierarchy.leaf_count, dtype=np.uint32)
    else:
        leaves = hierarchy.splats[count:]
        splats = _facing(leaves["centre"], leaves["normal"], view.homogeneous_eye, count)
    return Cut(splats, np.empty((0, 3), np.uint32), 0, 0, 0)


@nb.njit(cache=True, nogil=True)
def _facing(centres, normals, eye, first) -> UInt32Array:  # type: ignore[no-untyped-def]
    """Return `first` + i for every disc i that the eye (homogeneous) lies before."""
    result = np.empty(len(centres), np.uint32)
    count = 0
    for i in range(len(centres)):
        facing = 0.0
        for k in range(3):
            facing += (eye[k] - eye[3] * centres[i, k]) * normals[i, k]
        result[count] = first + i
        count += facing > 0.0
    return result[:count].copy()


METHODS = {
    "surfelscope": Method("silhouette-refined selection, normal tiles, blended quads", _select),
    "tiles of one size": Method(
        "the same with w_s x w_s texels a tile (Holst and Schumann 2007)", _select, fitted=False
    ),
    "not blended": Method("the same in one pass: the nearest splat shows", _select, Settings(blending=False)),
    "no tiles": Method("the same without normal mapping", _select, FLAT, tiles=False),
    "one radius": Method(
        "selection by one radius as in QSplat (Rusinkiewicz and Levoy 2000) over surfels only, no tiles",
        _select, FLAT, points=True, tiles=False,
    ),
    "base surfels flat": Method(
        "every base surfel, the nearest one shows", select_base, Settings(normal_mapping=False, blending=False),
        points=True, radii=False, tiles=False,
    ),
    "base surfels blended": Method(
        "every base surfel, blended (Botsch and Kobbelt 2003)", select_base, FLAT,
        points=True, radii=False, tiles=False,
    ),
    "point sprites": Method(
        "one point sprite a splat (Holst and Schumann 2007, eq. 4-7 and 10)", _select, Settings(splat="sprite")
    ),
    "printed cone test": Method("selection by the cone test as printed (Holst and Schumann 2007)", _select_printed),
    "triangles": Method("the mesh as plain indexed triangles", None, radii=False, tiles=False),
    "triangles, culled": Method(
        "the same, those that face away left out by OpenGL", None, radii=False, tiles=False, cull=True
    ),
}  # fmt: skip
