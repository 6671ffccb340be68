import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_models import turned

from hierarchy.openings import find_openings
from hierarchy.triangle_overlap import pass_through

TRIANGLE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def through(p, q, tolerance=1e-9):
    face = np.array([[0, 1, 2]], np.int32)
    return bool(pass_through(np.asarray(p, float), face, np.asarray(q, float), face, tolerance)[0])


def edge_crosses(p, q):
    """Tell whether an edge of p crosses q, by the signs of volumes."""

    def volume(a, b, c, d):
        return np.sign(np.dot(b - a, np.cross(c - a, d - a)))

    for k in range(3):
        a, b = p[k], p[(k + 1) % 3]
        if volume(a, *q) == volume(b, *q):
            continue
        sides = {volume(a, b, q[i], q[(i + 1) % 3]) for i in range(3)}
        if len(sides) == 1:
            return True
    return False


@settings(derandomize=True, deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_triangles_pass_through_where_an_edge_crosses(seed):
    rng = np.random.default_rng(seed)
    p = rng.normal(size=(30, 3, 3))
    q = 0.3 * rng.normal(size=(40, 1, 3)) + rng.choice([0.2, 1.0], (40, 1, 1)) * rng.normal(size=(40, 3, 3))
    faces = [np.arange(3 * len(x), dtype=np.int32).reshape(-1, 3) for x in (p, q)]
    found = pass_through(p.reshape(-1, 3), faces[0], q.reshape(-1, 3), faces[1], 0.0)
    expected = [any(edge_crosses(a, b) or edge_crosses(b, a) for b in q) for a in p]
    assert found.tolist() == expected


@pytest.mark.parametrize(
    ("name", "other", "expected"),
    [
        ("shared edge", [[1, 0, 0], [0, 0, 0], [0.5, -1, 0.5]], False),
        ("shared edge, in one plane", [[1, 0, 0], [0, 0, 0], [0.5, -1, 0]], False),
        ("folded onto itself", [[1, 0, 0], [0, 0, 0], [0.2, 0.3, 0]], False),
        ("shared corner", [[0, 0, 0], [-1, 0, 1], [0, -1, 1]], False),
        ("shared corner, through it", [[0, 0, 0], [0.3, 0.3, 1], [0.3, 0.3, -1]], True),
        ("corner on it", [[0.2, 0.2, 0], [0.3, 0.3, 1], [0.2, 0.6, 1]], False),
        ("through the middle", [[0.2, 0.2, -1], [0.3, 0.2, 1], [0.2, 0.3, 1]], True),
        ("above it", [[0.2, 0.2, 0.1], [0.3, 0.2, 1], [0.2, 0.3, 1]], False),
    ],
)
def test_named_cases(name, other, expected):
    for points in ([TRIANGLE, other], turned([*TRIANGLE, *other]).reshape(2, 3, 3)):
        assert through(*points) == expected
        assert through(*points[::-1]) == expected


def test_the_tolerance_is_a_depth():
    deep = TRIANGLE[[0, 2, 1]] * 0.1 + [0.2, 0.2, 0.0]
    deep[:, 2] = -0.001, 1.0, 1.0
    assert through(TRIANGLE, deep, 0.0005)
    assert not through(TRIANGLE, deep, 0.002)


def test_a_triangle_that_a_cap_passes_through_is_bare():
    """A tent without its floor, and a sheet that hangs half above and half below where the floor was."""
    tent = np.array([[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0], [0, 0, 3]], np.float32)
    sides = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]], np.int32)
    sheet = np.array([[0.9, 0.2, 0.6], [1.0, 0.4, 0.6], [0.95, 0.3, -0.4]], np.float32)
    positions, faces = np.concatenate([tent, sheet]), np.concatenate([sides, [[5, 6, 7]]]).astype(np.int32)
    corners = positions[faces].astype(float)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    centres = corners.mean(axis=1).astype(np.float32)
    openings = find_openings(positions, faces, centres, normals.astype(np.float32), leaves_are_faces=True)
    assert np.diff(openings.bare_before).tolist() == [0, 0, 0, 0, 1]
