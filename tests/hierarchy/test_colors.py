"""Colours of the nodes are area-weighted means of what is below."""

import numpy as np
import pytest
from small_models import bumpy_sphere, cloud_of, mesh_of, sorted_leaves, surfel_sphere

from hierarchy.colors import splat_colors
from hierarchy.octree import build_octree

seeds = np.random.default_rng(11)


def random_colors(count):
    return seeds.integers(0, 256, (count, 4)).astype(np.uint8)


def colors_of(model, min_leaves=2):
    leaves, shapes, codes = sorted_leaves(model)
    octree = build_octree(codes, min_leaves)
    return leaves, shapes, octree, splat_colors(octree, shapes, leaves)


def assert_means(leaf_colors, weights, octree, colors):
    for node in range(len(octree.first_child)):
        begin, end = octree.leaf_begin[node], octree.leaf_end[node]
        mean = np.average(leaf_colors[begin:end], axis=0, weights=weights[begin:end])
        assert np.abs(colors[node] - mean).max() <= 0.5 + 1e-3


def test_nodes_of_a_mesh():
    model = bumpy_sphere()
    model = mesh_of(model.positions, model.faces, colors=random_colors(len(model.positions)))
    leaves, shapes, octree, colors = colors_of(model)
    assert colors.dtype == np.uint8
    assert colors.shape == (len(octree.first_child), 4)
    corners = leaves.colors[leaves.indices].astype(float)
    assert_means(corners.mean(axis=1), shapes.areas.astype(float), octree, colors)


def test_nodes_and_leaves_of_a_cloud():
    sphere = surfel_sphere(200)
    model = cloud_of(sphere.positions, sphere.normals, sphere.radii, random_colors(200))
    leaves, _, octree, colors = colors_of(model)
    inner = len(octree.first_child)
    assert colors.shape == (inner + 200, 4)
    np.testing.assert_array_equal(colors[inner:], leaves.colors)
    assert_means(leaves.colors.astype(float), leaves.radii.astype(float) ** 2, octree, colors)


def test_bigger_primitives_count_more():
    white, black = [255] * 4, [0, 0, 0, 255]
    model = cloud_of([[0, 0, 0], [1, 0, 0]], [[0, 0, 1]] * 2, [3.0, 1.0], np.array([white, black], np.uint8))
    _, _, _, colors = colors_of(model)
    np.testing.assert_array_equal(colors[0], [230, 230, 230, 255])  # 255 * 9 / 10 = 229.5, rounded to even


@pytest.mark.parametrize("value", [0, 1, 127, 255])
def test_one_colour_stays_that_colour(value):
    model = bumpy_sphere()
    model = mesh_of(model.positions, model.faces, colors=np.full((len(model.positions), 4), value, np.uint8))
    assert (colors_of(model)[3] == value).all()


def test_primitives_without_an_area_still_have_a_colour():
    model = mesh_of([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], colors=np.full((3, 4), 90, np.uint8))
    _, shapes, _, colors = colors_of(model)
    assert not shapes.areas.any()
    np.testing.assert_array_equal(colors, [[90] * 4])


def test_the_size_of_the_model_does_not_matter():
    model = bumpy_sphere()
    colors = random_colors(len(model.positions))
    tiny = mesh_of(model.positions * np.float32(2.0**-40), model.faces, colors=colors)
    ordinary = mesh_of(model.positions, model.faces, colors=colors)
    np.testing.assert_array_equal(colors_of(tiny)[3], colors_of(ordinary)[3])


def test_no_colours():
    assert colors_of(bumpy_sphere())[3] is None
    assert colors_of(surfel_sphere())[3] is None
