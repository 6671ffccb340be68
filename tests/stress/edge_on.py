"""How much of its front a triangle shows that is seen from next to its plane, and how much rounding may take away."""

from __future__ import annotations

import math

import numpy as np
from exact import cross, rational

from hierarchy.view import NEAR_OVER_FAR

# The side of the largest picture.
PIXELS = 16_384
# The height of an eye before a triangle's plane is off by 8 units in the last place of the product of two edges and the
# distance of the corner between them. Where the two other corners are as near as the near plane, that shows
# 1 / NEAR_OVER_FAR squared times as thick. (As the nearest corner has it, it would not: but a tenth of the selection's
# time is too much for what no pixel shows.)
EDGE_ON = 8 * 2.0**-53 * PIXELS * (1.0 + 1.0 / NEAR_OVER_FAR) ** 2


def visible_thickness(corners: np.ndarray, eye: np.ndarray) -> float:
    """Return how thick the front of a triangle (3, 3) is for an eye (homogeneous), in pixels; 0, exactly, for a back.

    The picture is the largest, and as narrow as holds the triangle, but not less than 1 degree, or a ten-thousandth of
    the model where rays are parallel.
    """
    a, b, c = rational(corners)
    e, w = rational(eye[:3]), rational(eye[3:])[0]
    height = -(cross(b - a, c - a) * (w * a - e)).sum()
    if height <= 0:
        return 0.0
    if eye[3] == 0.0:
        lengths = [np.linalg.norm(np.cross(edge, eye[:3])) for edge in np.diff(corners[[0, 1, 2, 0]], axis=0)]
        area, narrowest = float(height), 1e-4
    else:
        distances = np.linalg.norm(corners - eye[:3], axis=1)
        distances = np.maximum(distances, NEAR_OVER_FAR * distances.max())
        directions = (corners - eye[:3]) / distances[:, None]
        lengths = [np.linalg.norm(np.cross(directions[i], directions[i - 1])) for i in range(3)]
        area, narrowest = float(height) / float(np.prod(distances)), math.radians(1.0)
    longest = max(lengths)
    return area / longest * PIXELS / max(longest, narrowest) if longest > 0.0 else 0.0
