"""An eye inside a closed mesh: the crossings of one ray against the winding numbers of many."""

import numpy as np
import pytest

from hierarchy.build import build_hierarchy
from hierarchy.inside import eye_is_inside
from hierarchy.meteoroid import make_meteoroid
from hierarchy.view import look_at
from hierarchy.winding import turn, winding_numbers


@pytest.fixture(scope="module")
def meteoroid():
    return build_hierarchy(make_meteoroid(2_000))


def view_from(hierarchy, eye, **options):
    return look_at(eye, np.add(eye, (0.1, 0.2, 0.3)), (0, 1, 0), 0.8, (8, 8), bounds=hierarchy.bounds, **options)


def test_inside_is_where_the_winding_number_is_not_0(meteoroid):
    rng = np.random.default_rng(5)
    leaves = meteoroid.leaves
    eyes = rng.uniform(-1.1, 1.1, (400, 3)) * meteoroid.half_extents
    # One index for corners at one place.
    points, faces = np.unique(leaves.positions, axis=0, return_inverse=True)
    corners = faces.reshape(-1)[leaves.indices].astype(np.int32)
    expected = winding_numbers(turn(points), corners, turn(eyes)) != 0
    found = np.array([eye_is_inside(meteoroid, view_from(meteoroid, eye)) for eye in eyes])
    assert 50 < expected.sum() < 350
    assert np.array_equal(found, expected)


def test_parallel_rays_come_from_outside(meteoroid):
    assert eye_is_inside(meteoroid, view_from(meteoroid, (0.0, 0.0, 0.0)))
    assert not eye_is_inside(meteoroid, view_from(meteoroid, (0.0, 0.0, 0.0), parallel_scale=0.5))


def test_surfels_have_no_inside():
    hierarchy = build_hierarchy(make_meteoroid(500), points=True)
    assert not eye_is_inside(hierarchy, view_from(hierarchy, (0.0, 0.0, 0.0)))
