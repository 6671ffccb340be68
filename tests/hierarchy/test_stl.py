import numpy as np
import pytest

from hierarchy.part import UnreadableFile
from hierarchy.stl import TRIANGLE, read_stl

CORNERS = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 1], [1, 0, 1], [0, 2.5, 1]]], np.float32)


def binary(corners, header=b""):
    table = np.zeros(len(corners), TRIANGLE)
    table["corners"] = corners
    return header.ljust(80, b" ") + np.uint32(len(corners)).tobytes() + table.tobytes()


def ascii_text(corners):
    facets = "".join(
        "facet normal 0 0 1\n outer loop\n" + "".join(f"  vertex {x} {y} {z:e}\n" for x, y, z in triangle)
        + " endloop\nendfacet\n" for triangle in corners
    )  # fmt: skip
    return f"solid vertex of a thing\n{facets}endsolid\n".encode()


@pytest.mark.parametrize("data", [binary(CORNERS), binary(CORNERS, b"solid, says a binary file"),
                                  ascii_text(CORNERS).replace(b"solid vertex of a thing", b"solid"),
                                  b"\n" + ascii_text(CORNERS).replace(b"vertex of a", b"").upper()])  # fmt: skip
def test_both_kinds(tmp_path, data):
    path = tmp_path / "a.stl"
    path.write_bytes(data)
    (part,) = read_stl(path)
    np.testing.assert_allclose(part.positions[part.faces], CORNERS)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (binary(CORNERS)[:-1], "truncated.*2 triangles"),
        (binary(CORNERS)[:60], "truncated"),
        (binary(CORNERS[:0]), "nothing to draw"),
        (ascii_text(CORNERS)[:-60], "truncated"),
        (ascii_text(CORNERS).replace(b"2.5", b"x.y"), "not a number|damaged"),
        (b"solid\nfacet\nvertex 1 2 3\nendfacet\nendsolid\n", "three vertices"),
        (b"solid\nendsolid\n", "nothing to draw"),
    ],
)
def test_damaged(tmp_path, data, reason):
    path = tmp_path / "a.stl"
    path.write_bytes(data)
    with pytest.raises(UnreadableFile, match=reason):
        read_stl(path)
