import numpy as np
import pytest

from hierarchy.part import Part, colors_from_channels, indices_in_range, split_corners


@pytest.mark.parametrize(
    ("channels", "expected"),
    [
        (np.array([0, 128, 255], np.uint8), [0, 128, 255]),
        (np.array([0, 32896, 65535], np.uint16), [0, 128, 255]),
        # 8-bit values in 16-bit fields, as many LAS writers have it.
        (np.array([0, 128, 255], np.uint16), [0, 128, 255]),
        (np.array([0.0, 0.5, 1.0], np.float32), [0, 128, 255]),
        (np.array([0.0, 128.0, 255.0], np.float32), [0, 128, 255]),
        (np.array([np.nan, np.inf, 1.0], np.float32), [0, 0, 255]),
        (np.array([-5, 0, 255], np.int32), [0, 0, 255]),
    ],
)
def test_channels_of_every_kind(channels, expected):
    colors = colors_from_channels([channels] * 3)
    assert colors[:, 0].tolist() == expected
    assert colors[:, 3].tolist() == [255] * 3


def test_a_fourth_channel_is_alpha():
    colors = colors_from_channels([np.array([10], np.uint8)] * 3 + [np.array([7], np.uint8)])
    assert colors.tolist() == [[10, 10, 10, 7]]


def test_indices_in_range():
    faces = np.array([[0, 1, 2], [0, 1, 3], [-1, 0, 1], [2**62, 0, 1]])
    assert indices_in_range(faces, 3).tolist() == [True, False, False, False]


def test_split_corners_takes_every_attribute_along():
    rng = np.random.default_rng(1)
    part = Part(
        rng.random((4, 3)), None, rng.random((4, 3)), rng.integers(0, 255, (4, 4)).astype(np.uint8), rng.random((4, 2))
    )
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    split = split_corners(part, faces)
    assert split.faces.tolist() == [[0, 1, 2], [3, 4, 5]]
    for name in ("positions", "normals", "colors", "texture_coordinates"):
        np.testing.assert_array_equal(getattr(split, name)[split.faces], getattr(part, name)[faces])
