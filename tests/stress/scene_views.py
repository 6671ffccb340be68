"""Cameras that break viewers: inside, on the surface, far away, as narrow and as wide as can be, along the axes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from hierarchy.hierarchy import Hierarchy
from hierarchy.leaves import Surfels
from hierarchy.view import View, look_at

Point = np.ndarray

OBLIQUE = np.array([0.48, 0.36, 0.8])


def _look(hierarchy: Hierarchy, eye: Point, focus: Point, size: tuple[int, int], degrees: float = 45.0, **more) -> View:
    """Make a view from places in units of the model's radius."""
    centre, radius = hierarchy.bounds
    radius = radius or 1.0
    return look_at(
        centre + radius * np.asarray(eye, np.float64),
        centre + radius * np.asarray(focus, np.float64),
        (0.0, 1.0, 0.0),
        math.radians(degrees),
        size,
        bounds=hierarchy.bounds,
        **more,
    )


def _parallel(hierarchy: Hierarchy, distance: float, size: tuple[int, int], half_height: float) -> View:
    return _look(hierarchy, distance * OBLIQUE, (0, 0, 0), size, parallel_scale=half_height * (hierarchy.radius or 1.0))


def _on_surface(hierarchy: Hierarchy, size: tuple[int, int], along: float) -> View:
    """Stand in a leaf, exactly: look along its normal (1), against it (-1) or across it (0)."""
    leaves, middle = hierarchy.leaves, hierarchy.leaf_count // 2
    if isinstance(leaves, Surfels):
        eye, normal = leaves.positions[middle], leaves.normals[middle]
    else:
        corners = leaves.indices[middle]
        eye, normal = leaves.positions[corners].mean(axis=0), leaves.normals[corners[0]]
    normal = normal.astype(np.float64)
    across = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    direction = along * normal if along else across
    eye = eye.astype(np.float64)
    return look_at(eye, eye + hierarchy.radius * direction, (0, 1, 0), 1.0, size, bounds=hierarchy.bounds)


def _fitting(degrees: float) -> float:
    return 1.05 / math.sin(math.radians(0.5 * degrees))


VIEWS: dict[str, Callable[[Hierarchy, tuple[int, int]], View]] = {
    "front": lambda h, size: _look(h, (0, 0, 2.8), (0, 0, 0), size),
    "oblique": lambda h, size: _look(h, 2.8 * OBLIQUE, (0, 0, 0), size),
    "from below, along view-up": lambda h, size: _look(h, (0, -2.8, 0), (0, 0, 0), size),
    "in the centre": lambda h, size: _look(h, (0, 0, 0), (0, 0, -1), size, 90.0),
    "beside the centre": lambda h, size: _look(h, (0.01, 0.02, 0.03), (1, 0.3, 0), size, 90.0),
    "on the surface, outwards": lambda h, size: _on_surface(h, size, 1.0),
    "on the surface, inwards": lambda h, size: _on_surface(h, size, -1.0),
    "on the surface, across": lambda h, size: _on_surface(h, size, 0.0),
    "a million diagonals away": lambda h, size: _look(h, 2e6 * OBLIQUE, (0, 0, 0), size),
    "a million diagonals away, 1 degree": lambda h, size: _look(h, 2e6 * OBLIQUE, (0, 0, 0), size, 1.0),
    "1 degree": lambda h, size: _look(h, _fitting(1.0) * OBLIQUE, (0, 0, 0), size, 1.0),
    "170 degrees": lambda h, size: _look(h, _fitting(170.0) * OBLIQUE, (0, 0, 0), size, 170.0),
    "170 degrees, close": lambda h, size: _look(h, 0.6 * OBLIQUE, (0, 0, 0), size, 170.0),
    "a thousandth away from the surface": lambda h, size: _look(h, (0, 0, 1.001), (0.3, 0.1, 0.9), size),
    "looking past": lambda h, size: _look(h, (0, 0, 3), (9, 0, 3), size),
    "looking away": lambda h, size: _look(h, (0, 0, 3), (0, 0, 9), size),
    "parallel rays": lambda h, size: _parallel(h, 2.8, size, 1.1),
    "parallel rays, close": lambda h, size: _parallel(h, 0.1, size, 1e-3),
    "parallel rays, from afar": lambda h, size: _parallel(h, 2e6, size, 1e3),
}  # fmt: skip

# Views from outside the model that show all of it.
OUTSIDE = ("front", "oblique", "from below, along view-up", "1 degree", "170 degrees", "parallel rays")


def views_of(hierarchy: Hierarchy, size: tuple[int, int]) -> Iterator[tuple[str, View]]:
    """Yield all views of a hierarchy by name."""
    for name, make in VIEWS.items():
        yield name, make(hierarchy, size)
