"""Two bytes for a normal: every code there is, errors over the hemisphere and at its rim, and what filtering does.

A code stands for a square of side 1/127, so what is encoded moves by (1, 1)/254 at most, which is 2^0.5/254 on a face
of the octahedron; nearest to the centre, where a face is 3^-0.5 away, that is atan(6^0.5/254) = 0.5525 degrees.
"""

import math

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hierarchy.encoding import decode_hemisphere, encode_hemisphere
from hierarchy.kernel import SHARPNESS, gaussian

LARGEST = math.degrees(math.atan(math.sqrt(6.0) / 254.0)) + 1e-9
# Of the angle between two normals: half of it at the rim, where the way between them leads over the hemisphere, and
# the uneven pace of the flat faces.
BENT = 0.51


@pytest.fixture(autouse=True)
def no_float_errors():
    with np.errstate(all="raise"):
        yield


def encode(normals):
    return np.array([encode_hemisphere(*n) for n in normals.tolist()])


def angles(a, b):
    """Return angles in radians that are accurate when small as when near pi."""
    return 2.0 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))


def hemisphere(rng, count):
    normals = rng.normal(size=(count, 3))
    normals[:, 2] = np.abs(normals[:, 2])
    # A third of them near the rim or the pole, on a logarithmic scale.
    tilt = 10.0 ** rng.uniform(-12.0, 0.0, count // 3)
    normals[: count // 6, 2] *= tilt[: count // 6]
    normals[count // 6 : count // 3, :2] *= tilt[count // 6 : count // 3, None]
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def test_every_code_decodes_to_a_unit_vector_of_the_hemisphere_and_back(ledger):
    first, second = np.meshgrid(np.arange(1, 256), np.arange(1, 256))
    codes = np.stack([first.ravel(), second.ravel()], axis=1).astype(np.uint8)
    normals = decode_hemisphere(codes)
    assert (normals[:, 2] >= 0.0).all()
    ledger.record(
        "kernels",
        "decoding of tile normals",
        "all 65,025 pairs of bytes: length off 1; in the hemisphere, encoded again the same",
        cases=len(codes),
        worst=np.abs(np.linalg.norm(normals, axis=1) - 1.0).max() / 2.0**-52,
        bound=3.0,
        unit="of 2.2e-16",
    )
    np.testing.assert_array_equal(encode(normals), codes)


def test_errors_over_the_hemisphere(ledger, amount, rng):
    normals = hemisphere(rng, amount(40_000, 600_000))
    errors = np.degrees(angles(normals, decode_hemisphere(encode(normals).astype(np.uint8))))
    tried = "random normals, a third of them within 1e-12 to 1 of the rim or the pole"
    row = ("kernels", "encoding of tile normals, largest error", tried)
    ledger.record(*row, cases=len(normals), worst=errors.max(), bound=LARGEST, unit="degrees")
    even = len(normals) // 3
    row = ("kernels", "encoding of tile normals, mean error", "random normals, evenly over the hemisphere")
    ledger.record(*row, cases=len(normals) - even, worst=errors[even:].mean(), bound=0.25, unit="degrees")


@pytest.mark.parametrize("scale", [1e-290, 1e-30, 1.0, 1e30, 1e300])
def test_sums_of_any_length_have_the_code_of_their_direction(rng, scale):
    normals = hemisphere(rng, 3_000)
    power = 2.0 ** round(math.log2(scale))
    np.testing.assert_array_equal(encode(normals * power), encode(normals))


def test_filtering_between_texels_stays_between_the_normals(ledger, amount, rng):
    """Bilinear filtering is linear filtering of linearly filtered codes: here along one line between any two codes."""
    count = amount(60_000, 2_000_000)
    first = rng.integers(1, 256, (count, 2))
    first[::4, 0] = rng.choice([1, 255], len(first[::4]))
    apart = 2.0 ** rng.uniform(0.0, 8.0, (count, 1)) * rng.normal(size=(count, 2))
    second = np.clip(np.rint(first + apart), 1, 255)
    second[::8, 0] = first[::8, 0]
    share = rng.uniform(size=(count, 1))
    a, b = decode_hemisphere(first), decode_hemisphere(second)
    between = angles(a, b)
    # Of normals that are opposite, on the rim, there is no middle.
    kept = (between > 0.0) & (between < math.pi - 1e-6)
    a, b, between, share = a[kept], b[kept], between[kept], share[kept]
    codes = (1.0 - share) * first[kept] + share * second[kept]
    # Before it is normalised a filtered code has |x| + |y| + z = 1: it is no shorter than 3^-0.5.
    filtered = decode_hemisphere(codes)
    true = np.sin((1.0 - share) * between[:, None]) * a + np.sin(share * between[:, None]) * b
    true /= np.linalg.norm(true, axis=1, keepdims=True)
    assert filtered[:, 2].min() >= -1e-15
    tried = "between all kinds of codes, many on the rim: off the true way between, by the angle between"
    worst = (angles(filtered, true) / between).max()
    row = ("kernels", "filtering of tile normals", tried)
    ledger.record(*row, cases=len(codes), worst=worst, bound=BENT, unit="of the angle")
    farthest = np.maximum(angles(filtered, a), angles(filtered, b)) / between
    tried = "the same: the farther of the two, by the angle between them"
    row = ("kernels", "filtering of tile normals, from its ends", tried)
    ledger.record(*row, cases=len(codes), worst=farthest.max(), bound=1.0 + 1e-9, unit="of the angle")
    # A little farther on the way is no nearer to its beginning.
    step = np.minimum(share + 1e-3, 1.0)
    ahead = decode_hemisphere((1.0 - step) * first[kept] + step * second[kept])
    assert (angles(ahead, a) - angles(filtered, a)).min() > -1e-12


def test_codes_of_any_vector_are_whole_bytes(laws):
    numbers = st.floats(-1e300, 1e300)

    @laws
    @given(numbers, numbers, numbers)
    def law(x, y, z):
        code = np.array(encode_hemisphere(x, y, z))
        assert ((code >= 1.0) & (code <= 255.0) & (code == np.rint(code))).all()

    law()


def test_weights_of_the_kernel(ledger, amount, rng):
    """Inside a disc no weight is below exp(-3), so no sum of weights that hit anything is zero."""
    squares = np.concatenate([rng.uniform(0.0, 1.0, amount(2_000, 50_000)), [0.0, 5e-324, 2.0**-53, 1.0 - 2.0**-53]])
    squares.sort()
    weights = np.array([gaussian(square) for square in squares.tolist()])
    assert (np.diff(weights) <= 0.0).all()
    assert weights.min() >= math.exp(-SHARPNESS)
    with mpmath.workdps(30):
        exact = [mpmath.exp(-SHARPNESS * mpmath.mpf(square)) for square in squares.tolist()]
        worst = max(abs(mpmath.mpf(w) / e - 1) for w, e in zip(weights.tolist(), exact, strict=True))
    ledger.record(
        "kernels",
        "weights of the kernel",
        "squared distances from 0 to 1 against 30 digits; falling, never below exp(-3)",
        cases=len(squares),
        worst=float(worst) / 2.0**-53,
        bound=6.0,
        unit="of 1.1e-16",
    )
