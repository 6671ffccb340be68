import numpy as np
import pytest

from hierarchy.neighbours import nearest_neighbours
from hierarchy.spacing import cover_radii


def radii_of(points, normals):
    distances, neighbours = nearest_neighbours(points, 16)
    return cover_radii(points, normals.astype(np.float32), distances, neighbours)


def uncovered(samples, points, normals, radii, *, height=np.inf):
    """Return which of `samples` no disc covers, seen along the disc's own normal and not farther than `height`."""
    bare = np.ones(len(samples), bool)
    for point, normal, radius in zip(points.astype(float), normals, radii, strict=True):
        offset = samples - point
        along = offset @ normal
        bare &= ~((np.einsum("ij,ij->i", offset, offset) - along**2 <= radius**2) & (np.abs(along) < height))
    return bare


def plane(kind):
    rng = np.random.default_rng(1)
    if kind == "scan lines":
        x, y = np.meshgrid(np.arange(0, 30, 0.25), np.arange(0, 30, 1.0))
    elif kind == "random":
        x, y = rng.uniform(0, 30, (2, 900))
    else:
        x, y = np.meshgrid(np.arange(30.0), np.arange(30.0))
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    if kind == "jittered":
        points[:, :2] += rng.uniform(-0.35, 0.35, (len(points), 2))
    return points.astype(np.float32)


@pytest.mark.parametrize(("kind", "most"), [("grid", 1.0), ("jittered", 1.35), ("scan lines", 1.0)])
def test_a_plane_has_no_holes_and_no_giants(kind, most):
    points = plane(kind)
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    radii = radii_of(points, normals)
    x, y = np.meshgrid(np.linspace(2, 27, 120), np.linspace(2, 27, 120))
    samples = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    assert not uncovered(samples, points, normals, radii).any()
    assert radii.max() <= most
    # Half the diagonal of a cell is what a grid needs; not much more is spent.
    if kind == "grid":
        np.testing.assert_allclose(np.median(radii), 1.1 * np.sqrt(0.5), rtol=1e-4)


def test_random_points_leave_next_to_nothing_bare():
    points = plane("random")
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    x, y = np.meshgrid(np.linspace(3, 26, 120), np.linspace(3, 26, 120))
    samples = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    # Points without any order leave gaps that are wider than three times the spacing around them.
    assert uncovered(samples, points, normals, radii_of(points, normals)).mean() < 0.003


def test_a_sphere_has_no_holes():
    i = np.arange(1500)
    z = 1 - (2 * i + 1) / 1500
    angle = i * np.pi * (3 - 5**0.5)
    points = np.column_stack([np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle), z])
    samples = np.random.default_rng(1).normal(size=(20_000, 3))
    samples /= np.linalg.norm(samples, axis=1, keepdims=True)
    radii = radii_of(points.astype(np.float32), points)
    assert not uncovered(samples, points, points, radii, height=0.1).any()
    assert radii.max() < 3 * np.sqrt(4 / 1500)


def test_a_lonely_point_gets_a_disc_like_the_others():
    points = np.concatenate([plane("jittered"), [[500, 500, 0]]]).astype(np.float32)
    radii = radii_of(points, np.tile([0.0, 0.0, 1.0], (len(points), 1)))
    assert radii[-1] <= radii[:-1].max() + 1e-6
    assert radii[-1] > 0


def test_the_other_side_of_a_thin_sheet_is_no_neighbour():
    front = plane("grid")
    back = front + np.float32([0.5, 0.5, -0.01])
    points = np.concatenate([front, back])
    normals = np.repeat([[0.0, 0, 1], [0.0, 0, -1]], len(front), axis=0)
    radii = radii_of(points, normals)
    # Were both sides one, half of the points would do for each, with smaller discs.
    inner = (points[:, :2] > 3).all(axis=1) & (points[:, :2] < 26).all(axis=1)
    assert radii[inner].min() >= 0.99 * np.sqrt(0.5)


@pytest.mark.parametrize("scale", [1e-20, 1e20])
def test_radii_scale_with_the_model(scale):
    points = plane("jittered")
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    scaled = radii_of((points * scale).astype(np.float32), normals)
    np.testing.assert_allclose(scaled, radii_of(points, normals) * np.float32(scale), rtol=1e-3)


@pytest.mark.parametrize("count", [1, 2, 3, 30])
def test_few_points_or_a_line_touch_each_other(count):
    points = np.column_stack([np.arange(count), np.zeros(count), np.zeros(count)]).astype(np.float32)
    radii = radii_of(points, np.tile([0.0, 0.0, 1.0], (count, 1)))
    assert (radii >= 0.5).all()
    assert (radii <= 3.0).all()
