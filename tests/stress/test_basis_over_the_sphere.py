"""The orthonormal basis of a normal, all over the sphere and at its seams, in double and in single precision.

Written out with the printed formulas, all dot products of (o1, o2, n) differ from those of an orthonormal frame by
|n|^2 - 1 at most: what the normal itself is off unit length. Rounding adds some eight units in the last place.
"""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hierarchy.frames import SEAM, tangents

TINY = 5e-324
EPSILON = {np.float64: 2.0**-52, np.float32: 2.0**-23}
ROUNDINGS = 8.0


@pytest.fixture(autouse=True)
def no_float_errors():
    with np.errstate(all="raise"):
        yield


def frames(normals):
    """Return (N, 3, 3), rows o1, o2, n, of float64 normals (N, 3), by the kernel."""
    values = np.array([tangents(*n) for n in normals.tolist()])
    return np.concatenate([values, normals], axis=1).reshape(-1, 3, 3)


def single_frames(normals):
    """Return the same in single precision throughout, as a GPU works it out."""
    with np.errstate(under="ignore"):
        x, y, z = normals.T
        one = np.float32(1.0)
        sign = np.where(z > np.float32(SEAM), one, -one)
        a = -one / (sign + z)
        b = x * y * a
        rows = [one + sign * x * x * a, sign * b, -sign * x, b, sign + y * y * a, -y, x, y, z]
    return np.stack(rows, axis=1).reshape(-1, 3, 3)


def excess(matrices, kind):
    """Return by how much more than their normals' lengths the frames are off being orthonormal and right-handed."""
    matrices = matrices.astype(np.float64)
    with np.errstate(under="ignore"):
        off_unit = np.abs((matrices[:, 2] ** 2).sum(axis=1) - 1.0)
        products = np.abs(matrices @ matrices.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
        # Three vectors whose dot products are off by d span a volume off by 1.5 d.
        turned = np.abs(np.linalg.det(matrices) - 1.0) / 1.5
    return float((np.maximum(products, turned) - off_unit).max()) / EPSILON[kind]


def seams(rng, count):
    """Return unit normals around all that could be a seam: the poles, the equator, the axes, and tiny numbers."""
    steps = np.concatenate(
        [
            10.0 ** rng.uniform(-300.0, 0.0, count),
            [
                0.0,
                TINY,
                1e-315,
                -SEAM,
                -SEAM * (1.0 + 2.0**-20),
                -SEAM * (1.0 - 2.0**-20),
                2.0**-1022,
                2.0**-53,
                2.0**-24,
            ],
        ]
    )
    azimuth = rng.uniform(-math.pi, math.pi, len(steps))
    azimuth[::3] = rng.integers(-4, 5, len(steps[::3])) * math.pi / 4.0
    around = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1)
    with np.errstate(under="ignore"):
        flat = np.sqrt(np.maximum(1.0 - steps**2, 0.0))
        equator = [np.column_stack([flat[:, None] * around, side * steps]) for side in (1.0, -1.0)]
        poles = [np.column_stack([steps[:, None] * around, side * flat]) for side in (1.0, -1.0)]
        # The last numbers before -1 and 1.
        ulps = np.float64(1.0) - rng.integers(0, 64, len(steps)) * 2.0**-53
        rims = np.sqrt(np.maximum((1.0 - ulps) * (1.0 + ulps), 0.0))
        poles += [np.column_stack([rims[:, None] * around, side * ulps]) for side in (1.0, -1.0)]
    axes = np.concatenate([np.eye(3), -np.eye(3), [[1.0, 0.0, -0.0], [0.0, 1.0, -0.0], [-0.0, -0.0, -1.0]]])
    return np.concatenate([*equator, *poles, axes])


def test_frames_all_over_the_sphere_and_at_its_seams(ledger, amount, rng):
    count = amount(20_000, 160_000)
    random = rng.normal(size=(count, 3))
    random /= np.linalg.norm(random, axis=1, keepdims=True)
    for name, normals in (("all over the sphere", random), ("seams", seams(rng, count // 4))):
        ledger.record(
            "kernels",
            "orthonormal basis",
            "all over the sphere; z = 0, -0.0, -2^-100, +-1 and their neighbours, down to 5e-324; handedness",
            cases=len(normals),
            worst=excess(frames(normals), np.float64),
            bound=ROUNDINGS,
            unit="of 2.2e-16",
        )
        with np.errstate(under="ignore"):
            single = normals.astype(np.float32)
        ledger.record(
            "kernels",
            "orthonormal basis in single precision",
            "the same, normals and arithmetic rounded to float32; beyond what the normal is off unit length",
            cases=len(single),
            worst=excess(single_frames(single), np.float32),
            bound=ROUNDINGS,
            unit="of 1.2e-7",
        )
        # Baking has them in doubles, drawing in single precision. Six roundings at most are in a component.
        apart = np.abs(frames(single.astype(np.float64)) - single_frames(single)).max()
        ledger.record(
            "kernels",
            "bases of baking and drawing",
            "the same normals in float64 and in float32 arithmetic",
            cases=len(single),
            worst=apart / 2.0**-24,
            bound=6.0,
            unit="of 6e-8",
        )
        assert np.isfinite(frames(normals)).all(), name


def test_frames_of_any_direction(laws, ledger):
    @laws
    @given(st.floats(-1.0, 1.0), st.floats(-math.pi, math.pi))
    def law(z, phi):
        ring = math.sqrt((1.0 - z) * (1.0 + z))
        normal = np.array([[ring * math.cos(phi), ring * math.sin(phi), z]])
        assert excess(frames(normal), np.float64) <= ROUNDINGS

    law()


@pytest.mark.parametrize("scale", [1.0 - 1e-6, 1.0 + 1e-6, 0.999, 1.001])
def test_a_normal_that_is_not_quite_unit_bends_its_frame_by_no_more(rng, scale):
    normals = rng.normal(size=(2_000, 3))
    normals *= scale / np.linalg.norm(normals, axis=1, keepdims=True)
    assert excess(frames(normals), np.float64) <= ROUNDINGS
