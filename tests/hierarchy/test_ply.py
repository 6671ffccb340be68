import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hierarchy.part import UnreadableFile
from hierarchy.ply import fan_triangles, read_ply, strip_triangles

FORMATS = ["ascii", "binary_little_endian", "binary_big_endian"]

CODES = {"char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I", "float": "f", "double": "d",
         "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "float32": "f",
         "float64": "d"}  # fmt: skip


def write_ply(path, form, elements, comments=()):
    """Write elements [(name, [property line], [row])], where a row has a number or a list for each property."""
    lines = ["ply", f"format {form} 1.0", *[f"comment {c}" for c in comments]]
    body = b""
    order = ">" if "big" in form else "<"
    for name, properties, rows in elements:
        lines.append(f"element {name} {len(rows)}")
        lines += [f"property {p}" for p in properties]
        for row in rows:
            words = []
            for p, value in zip(properties, row, strict=True):
                kinds = p.split()
                if kinds[0] == "list":
                    words += [(kinds[1], len(value)), *[(kinds[2], item) for item in value]]
                else:
                    words.append((kinds[0], value))
            if form == "ascii":
                body += (" ".join(str(value) for _, value in words) + "\n").encode()
            else:
                body += b"".join(struct.pack(order + CODES[kind], value) for kind, value in words)
    path.write_bytes("\n".join([*lines, "end_header", ""]).encode() + body)
    return path


XYZ = ["float x", "float y", "float z"]
SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 2, 0)]


@pytest.mark.parametrize("form", FORMATS)
def test_a_mixture_of_polygons_between_elements_nobody_asked_for(tmp_path, form):
    part, = read_ply(write_ply(tmp_path / "a.ply", form, [
        ("camera", ["float view_px", "list uchar float k", "int viewportx"], [(1.5, [1, 2, 3], 640)]),
        ("vertex", [*XYZ, "float quality", "list uchar int links"],
         [(*p, 0.5, list(range(i))) for i, p in enumerate(SQUARE)]),
        ("face", ["uchar flags", "list uchar int vertex_indices", "list uchar float weights"],
         [(0, [0, 1, 2, 3], [0.5]), (1, [2, 4, 3], []), (2, [0, 1], [1, 2]), (0, [0, 1, 2, 4, 3], [])]),
        ("edge", ["int a"], [(7,)]),
    ]))  # fmt: skip
    np.testing.assert_allclose(part.positions, SQUARE)
    assert part.faces.tolist() == [[0, 1, 2], [0, 2, 3], [2, 4, 3], [0, 1, 2], [0, 2, 4], [0, 4, 3]]


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("index", ["uchar", "int16", "ushort", "int32", "uint"])
@pytest.mark.parametrize("coordinate", ["float32", "double", "short"])
def test_types(tmp_path, form, index, coordinate):
    vertices = [(3 * x, 3 * y, 0) for x, y, _ in SQUARE[:4]]
    part, = read_ply(write_ply(tmp_path / "a.ply", form, [
        ("vertex", [f"{coordinate} {axis}" for axis in "xyz"], vertices),
        ("face", [f"list uint8 {index} vertex_index"], [([0, 1, 2],), ([0, 2, 3],)]),
    ]))  # fmt: skip
    np.testing.assert_allclose(part.positions, vertices)
    assert part.faces.tolist() == [[0, 1, 2], [0, 2, 3]]


@pytest.mark.parametrize("form", FORMATS)
def test_normals_colours_and_texture_coordinates(tmp_path, form):
    part, = read_ply(write_ply(tmp_path / "a.ply", form, [
        ("vertex", [*XYZ, "float nx", "float ny", "float nz", "uchar red", "uchar green", "uchar blue", "uchar alpha",
                    "float confidence", "float s", "float t"],
         [(1, 2, 3, 0, 0, 1, 10, 20, 30, 40, 0.5, 0.25, 0.75)]),
    ], comments=["TextureFile skin of a cow.png"]))  # fmt: skip
    assert part.faces is None
    np.testing.assert_allclose(part.normals, [[0, 0, 1]])
    assert part.colors.tolist() == [[10, 20, 30, 40]]
    np.testing.assert_allclose(part.texture_coordinates, [[0.25, 0.75]])
    assert part.texture_name == "skin of a cow.png"


@pytest.mark.parametrize("names", [("red", "green", "blue"), ("diffuse_red", "diffuse_green", "diffuse_blue")])
def test_colours_by_name_and_as_floats(tmp_path, names):
    part, = read_ply(write_ply(tmp_path / "a.ply", "ascii", [
        ("vertex", [*XYZ, *[f"float {n}" for n in names]], [(0, 0, 0, 1.0, 0.5, 0.0)])]))  # fmt: skip
    assert part.colors.tolist() == [[255, 128, 0, 255]]


def test_ascii_integers_of_one_are_not_full_colours(tmp_path):
    part, = read_ply(write_ply(tmp_path / "a.ply", "ascii", [
        ("vertex", [*XYZ, "uchar red", "uchar green", "uchar blue"], [(0, 0, 0, 1, 0, 1)])]))  # fmt: skip
    assert part.colors.tolist() == [[1, 0, 1, 255]]


@pytest.mark.parametrize("form", FORMATS)
def test_faces_colours_split_vertices(tmp_path, form):
    part, = read_ply(write_ply(tmp_path / "a.ply", form, [
        ("vertex", XYZ, SQUARE),
        ("face", ["list uchar int vertex_indices", "uchar red", "uchar green", "uchar blue"],
         [([0, 1, 2, 3], 255, 0, 0), ([3, 2, 4], 0, 0, 255), ([0, 1, 99], 9, 9, 9)]),
    ]))  # fmt: skip
    assert part.bad_faces == 1
    np.testing.assert_allclose(part.positions[part.faces], np.array(SQUARE)[[[0, 1, 2], [0, 2, 3], [3, 2, 4]]])
    assert part.colors[part.faces][:, :, 0].tolist() == [[255] * 3, [255] * 3, [0] * 3]


def test_texture_coordinates_at_the_corners_of_faces(tmp_path):
    part, = read_ply(write_ply(tmp_path / "a.ply", "binary_little_endian", [
        ("vertex", XYZ, SQUARE),
        ("face", ["list uchar int vertex_indices", "list uchar float texcoord"],
         [([0, 1, 2, 3], [0, 0, 1, 0, 1, 1, 0, 1]), ([3, 2, 4], [0.5, 0.5, 0.25, 0.5, 0.5, 0.75])]),
    ]))  # fmt: skip
    expected = [[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)], [(0.5, 0.5), (0.25, 0.5), (0.5, 0.75)]]
    np.testing.assert_allclose(part.texture_coordinates[part.faces], expected)


@pytest.mark.parametrize("form", FORMATS)
def test_strips(tmp_path, form):
    part, = read_ply(write_ply(tmp_path / "a.ply", form, [
        ("vertex", XYZ, [(i // 2, i % 2, 0) for i in range(8)]),
        ("tristrips", ["list int int vertex_indices"], [([0, 1, 2, 3, -1, 4, 5, 6, 7],)]),
    ]))  # fmt: skip
    assert part.faces.tolist() == [[0, 1, 2], [1, 3, 2], [4, 5, 6], [5, 7, 6]]
    p = part.positions[part.faces]
    assert (np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])[:, 2] < 0).all()


def test_strips_that_are_stitched_unsigned_or_too_short():
    assert strip_triangles(np.array([6]), np.array([0, 1, 2, 2, 3, 4])).tolist() == [[0, 1, 2], [2, 4, 3]]
    unsigned = np.array([0, 1, 2, 2**32 - 1, 3, 4, 5], np.uint32)
    assert strip_triangles(np.array([7]), unsigned).tolist() == [[0, 1, 2], [3, 4, 5]]
    # Two rows are two strips, without a -1 between them.
    assert strip_triangles(np.array([3, 3]), np.arange(6)).tolist() == [[0, 1, 2], [3, 4, 5]]
    assert strip_triangles(np.array([2, 0]), np.array([0, 1])).shape == (0, 3)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.integers(0, 9), max_size=40))
def test_fans_have_two_triangles_less_than_corners(counts):
    rows, corners = fan_triangles(np.array(counts, np.int64))
    expected = [(r, (0, i + 1, i + 2)) for r, count in enumerate(counts) for i in range(count - 2)]
    assert [(r, tuple(c)) for r, c in zip(rows.tolist(), corners.tolist(), strict=True)] == expected


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("kept", [0.3, 0.6, 0.95])
@pytest.mark.parametrize("polygons", [[[0, 1, 2]] * 6, [[0, 1, 2, 3], [0, 1, 2]] * 3])
def test_truncated(tmp_path, form, kept, polygons):
    path = write_ply(tmp_path / "a.ply", form, [
        ("vertex", XYZ, SQUARE), ("face", ["list uchar int vertex_indices"], [(p,) for p in polygons])])  # fmt: skip
    data = path.read_bytes()
    start = data.index(b"end_header\n") + 11
    path.write_bytes(data[: start + int(kept * (len(data) - start)) - 1])
    with pytest.raises(UnreadableFile, match="truncated"):
        read_ply(path)


@pytest.mark.parametrize("form", FORMATS)
def test_a_header_that_promises_a_billion_vertices_costs_nothing(tmp_path, form):
    path = tmp_path / "a.ply"
    header = f"ply\nformat {form} 1.0\nelement vertex 1000000000000\n"
    path.write_bytes((header + "".join(f"property {p}\n" for p in XYZ) + "end_header\n1 2 3\n").encode())
    with pytest.raises(UnreadableFile, match="truncated"):
        read_ply(path)


@pytest.mark.parametrize("form", FORMATS[1:])
def test_a_list_of_a_billion_or_a_negative_number_of_items(tmp_path, form):
    for count in (10**9, -1):
        path = write_ply(tmp_path / "a.ply", form, [
            ("vertex", XYZ, SQUARE), ("face", ["list int int vertex_indices"], [([0, 1, 2],)] * 2)])  # fmt: skip
        data = bytearray(path.read_bytes())
        data[-16:-12] = struct.pack((">" if "big" in form else "<") + "i", count)
        path.write_bytes(bytes(data))
        with pytest.raises(UnreadableFile, match="damaged"):
            read_ply(path)


def test_words_among_ascii_numbers(tmp_path):
    path = write_ply(tmp_path / "a.ply", "ascii", [("vertex", XYZ, SQUARE)])
    path.write_bytes(path.read_bytes().replace(b"0.5", b"half"))
    with pytest.raises(UnreadableFile, match="not a number"):
        read_ply(path)


def test_not_finite_words_are_read(tmp_path):
    (part,) = read_ply(write_ply(tmp_path / "a.ply", "ascii", [("vertex", XYZ, [("nan", "inf", "-inf"), (1, 2, 3)])]))
    assert np.isfinite(part.positions).tolist() == [[False] * 3, [True] * 3]


def test_no_vertices_with_coordinates(tmp_path):
    with pytest.raises(UnreadableFile, match="x, y and z"):
        read_ply(write_ply(tmp_path / "a.ply", "ascii", [("vertex", ["float x", "float y"], [(1, 2)])]))


def test_real_scans(shared_models):
    (igea,) = read_ply(shared_models / "igea.ply")
    assert igea.positions.shape == (134_345, 3)
    assert igea.faces.shape == (268_686, 3)
    (rangemap,) = read_ply(shared_models / "rangemap.ply")
    assert rangemap.positions.shape == (44_461, 3)
    assert rangemap.faces.shape == (86_766, 3)
    assert 0 <= rangemap.faces.min() <= rangemap.faces.max() < 44_461
