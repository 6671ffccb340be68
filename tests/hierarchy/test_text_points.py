import time

import numpy as np
import pytest

from hierarchy.part import UnreadableFile
from hierarchy.text_points import read_text_points

RNG = np.random.default_rng(2)
POINTS = RNG.uniform(-9, 9, (30, 3)).round(4)
NORMALS = RNG.normal(size=(30, 3))
NORMALS /= np.linalg.norm(NORMALS, axis=1, keepdims=True)
COLORS = RNG.integers(0, 256, (30, 3))
INTENSITY = RNG.integers(-2048, 2047, (30, 1))


def read(tmp_path, columns, head="", separator=" "):
    path = tmp_path / "a.xyz"
    lines = [separator.join(f"{value:.6g}" for value in row) for row in np.hstack(columns)]
    path.write_text(head + "\n".join(lines) + "\n")
    return read_text_points(path)[0]


@pytest.mark.parametrize("separator", [" ", ",", "; ", "\t"])
@pytest.mark.parametrize("head", ["", "30\n", "# x y z\n\n", "//X,Y,Z\n", "X Y Z\n"])
def test_points(tmp_path, separator, head):
    part = read(tmp_path, [POINTS], head, separator)
    np.testing.assert_allclose(part.positions, POINTS)
    assert part.normals is None
    assert part.colors is None


@pytest.mark.parametrize(
    "columns",
    [[POINTS, COLORS], [POINTS, NORMALS], [POINTS, COLORS, NORMALS], [POINTS, NORMALS, COLORS],
     [POINTS, INTENSITY, COLORS], [POINTS, INTENSITY], [POINTS, INTENSITY, COLORS, NORMALS]],
)  # fmt: skip
def test_columns_are_told_apart_by_their_values(tmp_path, columns):
    part = read(tmp_path, columns)
    np.testing.assert_allclose(part.positions, POINTS)
    has_colors = any(c is COLORS for c in columns)
    has_normals = any(c is NORMALS for c in columns)
    assert (part.colors is not None) == has_colors
    assert (part.normals is not None) == has_normals
    if has_colors:
        np.testing.assert_array_equal(part.colors[:, :3], COLORS)
    if has_normals:
        np.testing.assert_allclose(part.normals, NORMALS, atol=1e-5)


@pytest.mark.parametrize(
    ("text", "reason"),
    [("hello world\n", "three numbers"), ("1 2\n3 4\n", "three numbers"), ("1 2 3\n4 5\n", "every line"),
     ("1 2 3\n4 five 6\n", "not a number"), ("\0\1\2 3 4\n", "not a text")],
)  # fmt: skip
def test_damaged(tmp_path, text, reason):
    path = tmp_path / "a.txt"
    path.write_text(text)
    with pytest.raises(UnreadableFile, match=reason):
        read_text_points(path)


def test_one_line_of_half_a_million_numbers(tmp_path):
    path = tmp_path / "a.xyz"
    path.write_text("1 " * 500_000)
    start = time.process_time()
    (part,) = read_text_points(path)
    assert time.process_time() - start < 2.0
    assert part.positions.shape == (1, 3)


def test_columns_without_any_number(tmp_path):
    path = tmp_path / "a.xyz"
    path.write_text("0 0 0 nan nan nan\n1 0 0 nan nan nan\n")
    (part,) = read_text_points(path)
    assert part.normals is None
