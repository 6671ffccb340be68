"""The reconstruction kernel is a Gaussian of the squared distance."""

import math

import numpy as np
import pytest

from hierarchy.kernel import SHARPNESS, gaussian


def test_the_centre_has_weight_one_and_the_rim_five_percent():
    assert gaussian(0.0) == 1.0
    assert gaussian(1.0) == pytest.approx(0.05, abs=0.005)


def test_it_is_a_gaussian():
    # The product of two Gaussians at two distances is the one at the root of the sum of their squares.
    for a in np.linspace(0.0, 1.0, 7):
        for b in np.linspace(0.0, 1.0, 7):
            assert gaussian(a) * gaussian(b) == pytest.approx(gaussian(a + b), rel=1e-12)
    assert gaussian(0.5) == pytest.approx(math.exp(-0.5 * SHARPNESS))


def test_it_falls_towards_the_rim():
    weights = [gaussian(rho * rho) for rho in np.linspace(0.0, 1.0, 50)]
    assert (np.diff(weights) < 0.0).all()
