"""The views that a model is measured from: the same for the same model, whoever asks.

| name | where the eye is |
|---|---|
| front | 1.1 diagonals of the bounding box from its centre, along +z |
| front 0.165 | Igea only: at 0, 0, 0.165 of the file, where its figures of record are from |
| orbit 0 ... orbit 11 | at that distance, every 30 degrees around y, 20 degrees above and 10 below the middle in turn |
| close-up | a quarter of a diagonal from what the eye in front sees first |
| far | 8 diagonals away |
| inside | in the bounding box, outside of the surface, before its nearest part |
| grazing | half a diagonal from a part of the surface that it sees at 82 degrees from the normal |

All have a view angle of 45 degrees. "inside" and "grazing" are left out where the surface leaves no place for them,
as a box in its own bounding box does.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from benchmarks.first_hits import Sight
from hierarchy.model import Float64Array, Mesh
from hierarchy.view import View, look_at

VIEW_ANGLE_DEGREES = 45.0
DISTANCE, CLOSE, FAR = 1.1, 0.25, 8.0
ORBIT = 12
ORBIT_ELEVATIONS = (20.0, -10.0)
VIEW_UP = (0.0, 1.0, 0.0)

# Eye and focal point of single models, in the file's own space.
OF_RECORD = {"igea.ply": {"front 0.165": ((0.0, 0.0, 0.165), (0.0, 0.0, 0.0))}}

# Triangles, spread evenly over the file, that "grazing" and "inside" are tried with.
SURFACE_SAMPLES = 512
# Places in the bounding box that are tried for "inside", and the share of the diagonal that must be free around them.
# The near plane stands at 1e-4 of the far one, so nothing near is cut off.
PLACES = 256
CLEARANCE = 0.05
# The box of the places, as a share of the bounding box.
WITHIN = 0.9
# "grazing": distance in diagonals, angle between the line of sight and the surface.
GRAZING_DISTANCE, GRAZING_DEGREES = 0.5, 8.0


# Indices of triangles.
Samples = npt.NDArray[np.intp]
# Eye and focal point, float64 (3,) each, model space.
Pose = tuple[Float64Array, Float64Array]


def views_of(mesh: Mesh, resolution: tuple[int, int]) -> dict[str, View]:
    """Return the views of a mesh by name; raises UsageError without embreex."""
    low, high = mesh.positions.min(axis=0).astype(np.float64), mesh.positions.max(axis=0).astype(np.float64)
    centre, diagonal = 0.5 * (low + high), float(np.linalg.norm(high - low))
    sight = Sight(mesh)
    samples = np.unique(np.linspace(0, len(mesh.faces) - 1, SURFACE_SAMPLES).astype(np.intp))
    front = centre + DISTANCE * diagonal * np.array([0.0, 0.0, 1.0])
    poses = {"front": (front, centre)}
    for name, (eye, focus) in OF_RECORD.get(mesh.name, {}).items():
        poses[name] = (eye - mesh.origin) / mesh.scale, (focus - mesh.origin) / mesh.scale
    for k in range(ORBIT):
        direction = _direction(360.0 * k / ORBIT, ORBIT_ELEVATIONS[k % len(ORBIT_ELEVATIONS)])
        poses[f"orbit {k}"] = centre + DISTANCE * diagonal * direction, centre
    poses["close-up"] = _close_up(sight, samples, front, centre, diagonal)
    poses["far"] = centre + FAR * diagonal * _direction(35.0, 20.0), centre
    found = {"inside": _inside(sight, samples, low, high), "grazing": _grazing(sight, samples, diagonal)}
    poses |= {name: pose for name, pose in found.items() if pose is not None}

    radius = float(np.sqrt((mesh.positions.astype(np.float64) ** 2).sum(axis=1).max()))
    angle = math.radians(VIEW_ANGLE_DEGREES)
    bounds = (np.zeros(3), radius)
    return {
        name: look_at(eye, focus, VIEW_UP, angle, resolution, bounds=bounds) for name, (eye, focus) in poses.items()
    }


def _direction(azimuth: float, elevation: float) -> Float64Array:
    """Return the unit vector at an azimuth from +z towards +x and an elevation towards +y, both in degrees."""
    a, e = math.radians(azimuth), math.radians(elevation)
    return np.array([math.cos(e) * math.sin(a), math.sin(e), math.cos(e) * math.cos(a)])


def _close_up(sight: Sight, samples: Samples, front: Float64Array, centre: Float64Array, diagonal: float) -> Pose:
    """Go from the front towards the centre, or towards a part of the surface where the centre is not hidden."""
    targets = np.concatenate([centre[None], sight.centroids[samples]])
    triangle, distance = sight.first_hits(front, targets)
    k = int(np.argmax(triangle >= 0))
    towards = targets[k] - front
    towards /= np.linalg.norm(towards)
    seen = front + towards * distance[k]
    return seen - CLOSE * diagonal * towards, seen


def _inside(sight: Sight, samples: Samples, low: Float64Array, high: Float64Array) -> Pose | None:
    """Return the place nearest to the middle of the bounding box that has room and sees an outer side."""
    points = sight.centroids[samples]
    centre, half = 0.5 * (low + high), 0.5 * WITHIN * (high - low)
    places = centre + half * (2.0 * _halton(PLACES) - 1.0)
    places = places[np.argsort(np.linalg.norm(places - centre, axis=1), kind="stable")]
    for place in places:
        nearest = points[np.argmin(((points - place) ** 2).sum(axis=1))]
        # The nearest of all samples, not only the one that is looked at, decides on the room.
        triangle, distance = sight.first_hits(place, points)
        hit = triangle >= 0
        if not hit.any() or distance[hit].min() < CLEARANCE * np.linalg.norm(high - low):
            continue
        # From outside of a closed surface every ray meets a front side first. An open one has no outside: there the
        # place must see mostly front sides.
        towards = points[hit] - place
        front = np.einsum("ij,ij->i", sight.normals[triangle[hit]], towards) < 0.0
        if front.mean() > 0.99:
            return place, nearest
    return None


def _grazing(sight: Sight, samples: Samples, diagonal: float) -> Pose | None:
    """Return the first place from which a sample of the surface is seen from the side, and unhidden."""
    angle = math.radians(GRAZING_DEGREES)
    for point, normal in zip(sight.centroids[samples], sight.normals[samples], strict=True):
        for axis in np.eye(3)[np.argsort(np.abs(normal))[:2]]:
            tangent = np.cross(normal, axis)
            tangent /= np.linalg.norm(tangent)
            for side in (tangent, -tangent):
                eye = point + GRAZING_DISTANCE * diagonal * (math.sin(angle) * normal + math.cos(angle) * side)
                _, distance = sight.first_hits(eye, point[None])
                if abs(distance[0] - GRAZING_DISTANCE * diagonal) < 1e-3 * diagonal:
                    return eye, point
    return None


def _halton(count: int) -> Float64Array:
    """Return the first points of the Halton sequence in bases 2, 3 and 5, float64 (count, 3) in 0..1."""
    result = np.zeros((count, 3))
    for column, base in enumerate((2, 3, 5)):
        index, weight = np.arange(1, count + 1), 1.0 / base
        while index.any():
            result[:, column] += weight * (index % base)
            index, weight = index // base, weight / base
    return result
