"""A coarse stand-in for a large model, to be looked at while the hierarchy of the model itself is built.

It is a random sample of the base primitives as surfels, wide enough to leave hardly a gap: with discs of MEAN_COVER
times the area that each has to stand for exp(-MEAN_COVER) of the surface stays bare, less than one part in a hundred.
"""

from __future__ import annotations

import math

import numpy as np

from hierarchy.model import Float32Array, Mesh, Model, PointCloud

# Surfels of a stand-in: a hierarchy of so many takes a third of a second.
SURFELS = 60_000
MEAN_COVER = 5.0
# No disc is wider than this share of the model's radius over the root of their number: large triangles among small ones
# would hide all others. Discs that are all alike have 4.5 on a sphere.
WIDEST = 12.0


def stand_in(model: Model, surfels: int = SURFELS) -> PointCloud:
    """Return at most `surfels` of a model's primitives, drawn at random, as a point cloud in the same model space."""
    count = len(model.faces) if isinstance(model, Mesh) else len(model.positions)
    chosen = np.sort(np.random.default_rng(1).integers(0, count, min(surfels, count)))
    # What has been drawn twice is one.
    chosen = chosen[np.concatenate([[True], chosen[1:] != chosen[:-1]])]
    widened = math.sqrt(MEAN_COVER * count / len(chosen))
    if isinstance(model, Mesh):
        corners = model.positions[model.faces[chosen]]
        centres, normals, radii = _discs(corners, widened)
        colors = None if model.colors is None else model.colors[model.faces[chosen, 0]]
        good = np.isfinite(normals).all(axis=1) & (radii > 0.0)
    else:
        centres, normals, colors = model.positions[chosen], model.normals[chosen], model.colors
        # Those of a cloud overlap as they are.
        radii = model.radii[chosen] * np.float32(math.sqrt(count / len(chosen)))
        colors = None if colors is None else colors[chosen]
        good = np.ones(len(chosen), bool)
    size = float(np.abs(model.positions[chosen if isinstance(model, PointCloud) else model.faces[chosen, 0]]).max())
    radii = np.minimum(radii, np.float32(WIDEST * size / math.sqrt(len(chosen))))
    return PointCloud(
        model.name,
        model.origin,
        centres[good],
        normals[good],
        radii[good],
        None if colors is None else colors[good],
        scale=model.scale,
    )


def _discs(corners: Float32Array, widened: float) -> tuple[Float32Array, Float32Array, Float32Array]:
    """Return centres, normals and radii of discs of the area of triangles (N, 3, 3), times widened^2.

    Normals of triangles without an area are not finite.
    """
    wide = corners.astype(np.float64)
    across = np.cross(wide[:, 1] - wide[:, 0], wide[:, 2] - wide[:, 0])
    doubled = np.linalg.norm(across, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        normals = across / doubled[:, None]
    radii = widened * np.sqrt(0.5 / math.pi * doubled)
    return wide.mean(axis=1).astype(np.float32), normals.astype(np.float32), radii.astype(np.float32)
