"""Whether tiles are equal to the last bit."""

import numpy as np

from hierarchy.normal_tiles import FittedTiles


def assert_same_tiles(a: FittedTiles, b: FittedTiles) -> None:
    """Fail where the tiles of two batches differ, or their order, or their arrays' types."""
    for name in ("nodes", "most", "sides", "spreads"):
        one, other = getattr(a, name), getattr(b, name)
        assert one.dtype == other.dtype, name
        np.testing.assert_array_equal(one, other)
    for one, other in ((a.normals, b.normals), (a.colors, b.colors)):
        assert one.keys() == other.keys()
        for side in one:
            assert one[side].dtype == np.uint8
            np.testing.assert_array_equal(one[side], other[side])
