"""The steps between sorted Morton codes, with Python's integers."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from hierarchy.model import UInt16Array
from hierarchy.morton import BITS, SAME_PLACE


def steps_of(codes: Sequence[int]) -> UInt16Array:
    """Return the step to each of the codes: the number, from the highest down, of the bit in which it differs."""
    bits = [(int(a) ^ int(b)).bit_length() for a, b in itertools.pairwise(codes)]
    return np.array([0] + [3 * BITS - bit if bit else SAME_PLACE for bit in bits], np.uint16)
