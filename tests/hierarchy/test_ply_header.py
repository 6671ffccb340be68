import pytest

from hierarchy.part import UnreadableFile
from hierarchy.ply_header import parse_header

LINES = ["ply", "format binary_big_endian 1.0", "comment TextureFile my texture.png", "obj_info whatever",
         "element vertex 5", "property float32 x", "property uchar red", "element face 2",
         "property list uint8 int vertex_index", "end_header"]  # fmt: skip


@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
def test_every_line_ending(ending):
    text = ending.join(LINES).encode() + ending.encode()
    header = parse_header(text + b"\n\r data")
    assert header.size == len(text)
    assert not header.ascii
    assert header.texture_name == "my texture.png"
    vertex, face = header.elements
    assert (vertex.name, vertex.count, [p.name for p in vertex.properties]) == ("vertex", 5, ["x", "red"])
    assert [p.type.str for p in vertex.properties] == [">f4", "|u1"]
    assert face.properties[0].type.str == ">i4"
    assert face.properties[0].count_type.str == "|u1"


def test_a_file_that_ends_with_its_header():
    text = "\n".join(LINES).encode()
    assert parse_header(text).size == len(text)


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("ply", "plyx", "not a PLY"),
        ("end_header", "end", "no end"),
        ("format binary_big_endian 1.0", "comment", "makes no sense|names no format"),
        ("binary_big_endian", "binary_middle_endian", "makes no sense"),
        ("element vertex 5", "element vertex -5", "makes no sense"),
        ("element vertex 5", "element vertex many", "makes no sense"),
        ("element vertex 5", "comment no element", "makes no sense"),
        ("property float32 x", "property quaternion x", "makes no sense"),
        ("property float32 x", "property float32", "makes no sense"),
    ],
)
def test_what_makes_no_sense_is_refused(old, new, reason):
    with pytest.raises(UnreadableFile, match=reason):
        parse_header(("\n".join(LINES) + "\n").replace(old, new, 1).encode())
