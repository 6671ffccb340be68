import numpy as np
import pytest

from hierarchy.model import Cancelled
from hierarchy.neighbours import nearest_neighbours


@pytest.mark.parametrize("scale", [1e-20, 1.0, 1e20])
def test_neighbours_are_those_of_all_distances(scale):
    points = (np.random.default_rng(1).random((300, 3)) * scale).astype(np.float32)
    distances, indices = nearest_neighbours(points, 9)
    exact = np.linalg.norm(points[:, None].astype(float) - points[None], axis=2)
    np.fill_diagonal(exact, np.inf)
    np.testing.assert_allclose(distances, np.sort(exact, axis=1)[:, :9], rtol=1e-5)
    np.testing.assert_array_equal(indices, np.argsort(exact, axis=1)[:, :9])


@pytest.mark.parametrize(("points", "expected"), [(1, 0), (2, 1), (9, 8), (10, 9), (11, 9)])
def test_few_points(points, expected):
    positions = np.arange(3 * points, dtype=np.float32).reshape(-1, 3)
    distances, indices = nearest_neighbours(positions, 9)
    assert distances.shape == indices.shape == (points, expected)


def test_progress_can_cancel():
    def cancel(stage, fraction):
        assert stage == "normals"
        raise Cancelled

    with pytest.raises(Cancelled):
        nearest_neighbours(np.eye(3, dtype=np.float32), 2, cancel)
