"""The reconstruction kernel: how a surfel's weight falls from its centre to its rim."""

from __future__ import annotations

import math

import numba as nb

# exp(-3) = 5% is left at the rim: enough that a pixel under rims alone is still well normalised.
SHARPNESS = 3.0


@nb.njit(cache=True, nogil=True, inline="always")
def gaussian(rho2):  # type: ignore[no-untyped-def]
    """Return the weight at squared distance rho2, in units of the squared radius, from the centre (eq. 14)."""
    return math.exp(-SHARPNESS * rho2)
