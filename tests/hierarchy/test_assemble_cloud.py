import numpy as np
import pytest

from hierarchy.assemble_cloud import assemble_cloud
from hierarchy.model import in_file_space
from hierarchy.part import Part, UnreadableFile


def sphere_part(count=1500, offset=(0, 0, 0)):
    directions = np.random.default_rng(1).normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return Part(directions + np.asarray(offset)), directions


def assemble(part):
    return assemble_cloud("a", [part], [])


def test_normals_and_radii_are_estimated_far_from_the_origin():
    part, directions = sphere_part(offset=(4.5e6, 5.5e6, 100))
    cloud = assemble(part)
    np.testing.assert_allclose(in_file_space(cloud, cloud.positions), part.positions, atol=1e-6)
    assert np.einsum("ij,ij->i", cloud.normals, directions).min() > 0.9
    assert cloud.estimated_normals
    assert cloud.warnings == ()
    assert (cloud.positions.dtype, cloud.normals.dtype, cloud.radii.dtype) == (np.float32,) * 3
    assert (cloud.radii > 0).all()


def test_normals_of_the_file_are_kept_on_their_side():
    part, directions = sphere_part()
    part.normals = -3 * directions
    cloud = assemble(part)
    np.testing.assert_allclose(cloud.normals, -directions, atol=1e-6)
    assert not cloud.estimated_normals


def test_some_bad_normals_follow_those_around_them():
    part, directions = sphere_part()
    part.normals = -directions
    part.normals[:50] = 0
    part.normals[50:80] = np.nan
    cloud = assemble(part)
    assert np.einsum("ij,ij->i", cloud.normals, -directions).min() > 0.9
    assert not cloud.estimated_normals
    assert cloud.warnings == ("recomputed 80 normals without a direction",)


def test_normals_that_are_all_zero_count_as_none():
    part, directions = sphere_part()
    part.normals = np.zeros_like(directions)
    cloud = assemble(part)
    assert np.einsum("ij,ij->i", cloud.normals, directions).min() > 0.9
    assert cloud.estimated_normals
    assert cloud.warnings == ("estimated all normals: the file's have no direction",)


def test_dropped_points_take_their_attributes_along():
    part, directions = sphere_part()
    part.normals = directions.copy()
    part.colors = (127.5 + 127.5 * np.column_stack([directions, directions[:, 0]])).astype(np.uint8)
    part.positions[10] = np.nan
    part.positions[20] = part.positions[30]
    cloud = assemble(part)
    assert len(cloud.positions) == len(cloud.radii) == 1498
    np.testing.assert_allclose(cloud.colors[:, :3], 127.5 + 127.5 * cloud.normals, atol=1.01)
    assert len(cloud.warnings) == 2


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_very_few_points(count):
    cloud = assemble(Part(np.eye(4, 3)[:count]))
    assert len(cloud.positions) == count
    np.testing.assert_allclose(np.linalg.norm(cloud.normals, axis=1), 1.0, atol=1e-6)
    assert (cloud.radii > 0).all()
    assert np.isfinite(cloud.radii).all()


def test_no_points():
    with pytest.raises(UnreadableFile, match="nothing to draw"):
        assemble(Part(np.full((5, 3), np.inf)))
