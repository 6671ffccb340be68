"""Matcaps: pictures of a sphere in a fixed lighting, looked up by the eye-space normal.

Made here from a few soft lights each, so that no file has to be shipped or read.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

# Texels along a side; a normal is looked up with bilinear filtering, and no material has detail below a degree.
SIZE = 256


@dataclass(frozen=True)
class Light:
    """direction : towards the light, eye space; color : linear RGB; sharpness : of the highlight, 0: diffuse."""

    direction: tuple[float, float, float]
    color: tuple[float, float, float]
    sharpness: float = 0.0


MATCAPS: dict[str, tuple[Light, ...]] = {
    "pearl": (
        Light((0.0, 0.3, 1.0), (0.20, 0.20, 0.205)),
        Light((-0.65, 0.75, 0.3), (0.46, 0.425, 0.39)),
        Light((0.9, -0.3, 0.1), (0.06, 0.06, 0.10)),
        Light((0.2, -0.9, 0.2), (0.07, 0.06, 0.05)),
        Light((-0.45, 0.6, 0.66), (0.34, 0.33, 0.32), 34.0),
        Light((0.75, 0.35, 0.1), (0.10, 0.13, 0.20), 10.0),
    ),
    "bronze": (
        Light((0.1, 0.3, 1.0), (0.16, 0.085, 0.035)),
        Light((-0.6, 0.7, 0.5), (0.20, 0.10, 0.035)),
        Light((-0.4, 0.6, 0.7), (0.95, 0.62, 0.32), 26.0),
        Light((0.6, 0.5, 0.6), (0.35, 0.18, 0.08), 9.0),
        Light((0.5, -0.8, 0.3), (0.10, 0.06, 0.05), 4.0),
    ),
    "jade": (
        Light((0.0, 0.2, 1.0), (0.014, 0.090, 0.046)),
        Light((-0.5, 0.8, 0.35), (0.045, 0.22, 0.115)),
        Light((0.75, -0.6, 0.1), (0.018, 0.105, 0.075)),
        Light((-0.38, 0.62, 0.69), (0.52, 0.60, 0.53), 70.0),
        Light((-0.38, 0.62, 0.69), (0.06, 0.14, 0.09), 8.0),
        Light((0.65, 0.3, 0.5), (0.05, 0.11, 0.09), 14.0),
    ),
}


def make_matcap(name: str) -> npt.NDArray[np.float32]:
    """Return a matcap, float32 (SIZE, SIZE, 4): linear colour, and the brightness of the highlights in it.

    Row 0 is at the bottom; the sphere fills the square.
    Raises KeyError where there is no such material.
    """
    axis = (np.arange(SIZE) + 0.5) / SIZE * 2.0 - 1.0
    x, y = np.meshgrid(axis, axis)
    inside = np.maximum(1.0 - x * x - y * y, 0.0)
    normal = np.stack([x, y, np.sqrt(inside)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    matcap = np.zeros((SIZE, SIZE, 4))
    for light in MATCAPS[name]:
        direction = np.asarray(light.direction) / np.linalg.norm(light.direction)
        if light.sharpness == 0.0:
            # Wrapped: half of the light reaches around the terminator, as from a wide source.
            amount = np.maximum(0.65 * (normal @ direction) + 0.35, 0.0)
        else:
            half = direction + np.array([0.0, 0.0, 1.0])
            amount = np.maximum(normal @ (half / np.linalg.norm(half)), 0.0) ** light.sharpness
            matcap[..., 3] += amount * np.mean(light.color)
        matcap[..., :3] += amount[..., None] * np.asarray(light.color)
    return matcap.astype(np.float32)
