"""How a surfel's weight falls from its centre to its rim, and the least of a picture that it covers."""

from __future__ import annotations

import math

import numba as nb

# exp(-3) = 5% is left at the rim: enough that a pixel under rims alone is still well normalised.
SHARPNESS = 3.0
# The least radius in pixels of a disc that faces the eye: it shows in one pixel at least. From the centre of a pixel to
# its corner it is the root of 1/2; the rest is for the grid of 1/256 pixel that rasterisers place corners on.
SMALLEST = 0.72


@nb.njit(cache=True, nogil=True, inline="always")
def gaussian(rho2):  # type: ignore[no-untyped-def]
    """Return the weight at squared distance rho2, in units of the squared radius, from the centre (eq. 14)."""
    return math.exp(-SHARPNESS * rho2)
