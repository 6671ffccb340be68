import numpy as np

from hierarchy.noise import noise

POINTS = np.random.default_rng(5).uniform(-20, 20, (4000, 3))


def test_zero_at_whole_numbers_and_bounded():
    assert noise(3.0, -7.0, 0.0, 1) == 0.0
    values = np.array([noise(*p, 1) for p in POINTS])
    assert np.abs(values).max() <= 1.1
    assert 0.15 < values.std() < 0.4
    assert abs(values.mean()) < 0.02


def test_smooth_across_cells():
    # Value and slope on both sides of a cell's face: the quintic fade joins both.
    step = 1e-5
    for y, z in POINTS[:50, 1:]:
        below, at, above = (noise(4.0 + d, y, z, 2) for d in (-step, 0.0, step))
        assert abs((at - below) - (above - at)) < 1e-8


def test_seeds_differ_and_repeat():
    first = [noise(*p, 1) for p in POINTS[:100]]
    assert first == [noise(*p, 1) for p in POINTS[:100]]
    assert abs(np.corrcoef(first, [noise(*p, 2) for p in POINTS[:100]])[0, 1]) < 0.4
