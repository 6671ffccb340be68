"""Which sides normals and triangles turn to the eye.

Based on: Holst and Schumann 2007, section 5, whose test widens a cone by the field of view; here it is widened by the
angle that the sphere around what has the normals subtends.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from hierarchy.area_vector import area_vector
from hierarchy.cones import EVERYTHING

FRONT, SILHOUETTE, BACK = 0, 1, 2

# What nodes store is rounded to float32: an axis may be 5.2e-8 longer or shorter than 1, and a sine smaller by a share
# of 6e-8 than its cosine has it. Beside a right angle that would be an angle of 4e-4; with a share of 2.5e-7 off what
# faces the eye, or away, whatever is called one side is on it.
CERTAIN = 1.0 - 2.5e-7


@nb.njit(cache=True, nogil=True, inline="always")
def classify_cone(facing, distance2, sphere, cone_sin, cone_cos):  # type: ignore[no-untyped-def]
    """Tell whether the normals of a cone, anywhere in a sphere, face the eye, face away, or both.

    facing : dot product of the cone's axis with the vector from the eye to the sphere's centre
    distance2 : squared distance of that centre from the eye
    sphere : radius of the sphere

    With sin(gamma) = sphere / distance, all face away where the axis is within 90 - beta - gamma degrees of the
    line of sight, so that facing >= sin(beta) tangent + cos(beta) sphere, the tangent from the eye to the sphere.
    Multiplied by the distance no division is left, and squared no root: roots were a tenth of a selection's time.
    """
    tangent2 = distance2 - sphere * sphere
    beyond = CERTAIN * abs(facing) - cone_cos * sphere
    # Without branches: none could be foreseen.
    outside = (cone_cos > 0.0) & (tangent2 > 0.0)
    narrow = cone_cos * cone_cos * tangent2 > cone_sin * cone_sin * sphere * sphere
    one_side = (beyond >= 0.0) & (beyond * beyond >= cone_sin * cone_sin * tangent2)
    side = BACK if facing >= 0.0 else FRONT
    return side if outside & narrow & one_side else SILHOUETTE


@nb.njit(cache=True, nogil=True, inline="always")
def classify_cone_printed(facing, cone_sin, cone_cos, sin_view, cos_view):  # type: ignore[no-untyped-def]
    """The test as printed in section 5, for comparison.

    facing : dot product of the cone's axis with the normalised viewing vector
    sin_view, cos_view : of the field-of-view angle alpha
    """
    if cone_cos == EVERYTHING or cone_cos * cos_view <= cone_sin * sin_view:
        return SILHOUETTE
    limit = cone_sin * cos_view + cone_cos * sin_view
    if facing > limit:
        return BACK
    if facing <= -limit:
        return FRONT
    return SILHOUETTE


@nb.njit(cache=True, nogil=True, inline="always")
def faces_away(positions, a, b, c, eye):  # type: ignore[no-untyped-def]
    """Tell whether the eye (homogeneous) lies behind the plane of a triangle, or in it."""
    nx, ny, nz = area_vector(positions, a, b, c)
    px, py, pz = np.float64(positions[a, 0]), np.float64(positions[a, 1]), np.float64(positions[a, 2])
    return nx * (eye[3] * px - eye[0]) + ny * (eye[3] * py - eye[1]) + nz * (eye[3] * pz - eye[2]) >= 0.0
