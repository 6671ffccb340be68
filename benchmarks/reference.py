"""The picture that a model should give: its triangles cast with rays, several to a pixel.

The yardstick of the benchmarks and of the tests of the whole renderer. It needs embreex, which the viewer does not.
"""

from __future__ import annotations

import os
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit, prange

from benchmarks.rays import RayCaster, Sample
from hierarchy.model import Float32Array, Float64Array, Int32Array, Mesh, UInt8Array
from hierarchy.view import View


@dataclass(frozen=True, eq=False)
class Reference:
    """What rays through the pixels of a view meet first; row 0 at the top.

    normal : float32 (H, W, 3), unit mean of the interpolated vertex normals of the samples that hit, model space,
        as the mesh has them (not turned towards the eye); zero where nothing was hit
    depth : float32 (H, W), distance along the view axis, mean of the samples that hit; inf where nothing was hit
    coverage : float32 (H, W) in 0..1, share of a pixel's samples that hit
    focal_pixels : pixels that a unit length covers at unit depth, as in `View`
    parallel : it covers as many at any depth
    picture : uint8 (H, W, 3), sRGB, what the viewer would show (benchmarks/shading.py); None: it was not asked for
    """

    normal: Float32Array
    depth: Float32Array
    coverage: Float32Array
    focal_pixels: float
    picture: UInt8Array | None = None
    parallel: bool = False


def cast(
    mesh: Mesh | RayCaster, view: View, samples: int = 4, on_sample: Callable[[Sample], None] | None = None
) -> Reference:
    """Cast samples x samples rays through every pixel of `view` and average what they hit first.

    The samples form a regular grid at the centres of equal sub-pixels. Both sides of a triangle are hit. Rays start
    at the eye: the clip planes of the view do not cut the model.

    mesh : a `RayCaster` instead of its mesh saves building it again for every view
    samples : along one side of a pixel, at least 1
    on_sample : is shown the rays of all pixels through one point after the other
    Raises ValueError where samples < 1, UsageError without embreex.
    """
    if samples < 1:
        raise ValueError("a pixel needs at least one sample")
    caster = mesh if isinstance(mesh, RayCaster) else RayCaster(mesh)
    shape = (view.height, view.width)
    total, depth, hits = np.zeros((*shape, 3)), np.zeros(shape), np.zeros(shape, np.int32)
    steps = (np.arange(samples) + 0.5) / samples
    for sample in caster.samples(view, [(float(x), float(y)) for y in steps for x in steps]):
        _add(sample.normal, sample.depth, total, depth, hits)
        if on_sample is not None:
            on_sample(sample)
    normal, mean_depth, coverage = _mean(total, depth, hits, samples**2)
    return Reference(normal, mean_depth, coverage, view.focal_pixels, parallel=view.is_parallel)


@njit(cache=True, nogil=True, parallel=True)
def _add(
    normal: Float32Array, depth: Float32Array, total: Float64Array, total_depth: Float64Array, hits: Int32Array
) -> None:
    """Add the pixels that were hit to the sums."""
    for row in prange(len(depth)):
        for column in range(depth.shape[1]):
            if depth[row, column] < np.inf:
                hits[row, column] += 1
                total_depth[row, column] += depth[row, column]
                for axis in range(3):
                    total[row, column, axis] += normal[row, column, axis]


@njit(cache=True, nogil=True, parallel=True)
def _mean(
    total: Float64Array, total_depth: Float64Array, hits: Int32Array, samples: int
) -> tuple[Float32Array, Float32Array, Float32Array]:
    """Return unit normals, mean depths and coverage."""
    normal = np.zeros(total.shape, np.float32)
    depth = np.full(hits.shape, np.inf, np.float32)
    coverage = np.zeros(hits.shape, np.float32)
    for row in prange(len(hits)):
        for column in range(hits.shape[1]):
            if hits[row, column] == 0:
                continue
            coverage[row, column] = hits[row, column] / samples
            depth[row, column] = total_depth[row, column] / hits[row, column]
            length = np.sqrt((total[row, column] ** 2).sum())
            if length > 0.0:
                for axis in range(3):
                    normal[row, column, axis] = total[row, column, axis] / length
    return normal, depth, coverage


def save_reference(path: Path, reference: Reference) -> None:
    """Write a reference to an uncompressed .npz, whole or not at all.

    Raises OSError where it cannot be written.
    """
    arrays: dict[str, Any] = {
        "normal": reference.normal,
        "depth": reference.depth,
        "coverage": reference.coverage,
        "focal_pixels": np.float64(reference.focal_pixels),
        "parallel": np.bool_(reference.parallel),
    }
    if reference.picture is not None:
        arrays["picture"] = reference.picture
    # Of its own name, so that two processes that make the same reference do not write into each other's file.
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        with part.open("wb") as file:
            np.savez(file, **arrays)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def load_reference(path: Path) -> Reference | None:
    """Read what `save_reference` wrote; None where there is no file, or one that is damaged or something else."""
    try:
        # numpy leaves a damaged file open that it opened itself.
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        reference = Reference(
            arrays["normal"],
            arrays["depth"],
            arrays["coverage"],
            float(arrays["focal_pixels"]),
            arrays.get("picture"),
            bool(arrays["parallel"]),
        )
    except (OSError, EOFError, KeyError, TypeError, ValueError, AttributeError, zipfile.BadZipFile, zlib.error):
        return None
    return reference if _is_whole(reference) else None


def _is_whole(reference: Reference) -> bool:
    """Tell whether shapes and dtypes are those of a reference."""
    shape = reference.coverage.shape
    expected: list[tuple[Any, tuple[int, ...], type]] = [
        (reference.normal, (*shape, 3), np.float32),
        (reference.depth, shape, np.float32),
        (reference.coverage, shape, np.float32),
    ]
    if reference.picture is not None:
        expected.append((reference.picture, (*shape, 3), np.uint8))
    return len(shape) == 2 and all(array.shape == form and array.dtype == dtype for array, form, dtype in expected)
