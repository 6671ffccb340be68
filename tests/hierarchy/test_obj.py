import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hierarchy.obj import MOST_MATERIAL_FILES, MOST_MATERIALS, read_obj
from hierarchy.obj_scan import count_lines, scan_lines
from hierarchy.part import UnreadableFile

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def read(tmp_path, text, warnings=None):
    path = tmp_path / "a.obj"
    path.write_bytes(text.encode())
    return read_obj(path, [] if warnings is None else warnings)


@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
def test_polygons_of_any_size(tmp_path, ending):
    text = "# a comment\no thing\n" + SQUARE + "v .5 2 0\nf 1 2 3 4\nf 4 3 5\nl 1 2\nf 1 2\nf 1 2 3 5 4\n"
    (part,) = read(tmp_path, text.replace("\n", ending))
    corners = part.positions[part.faces][:, :, :2].tolist()
    a, b, c, d, e = [0, 0], [1, 0], [1, 1], [0, 1], [0.5, 2]
    assert corners == [[a, b, c], [a, c, d], [d, c, e], [a, b, c], [a, c, e], [a, e, d]]


def test_indices_that_count_backwards(tmp_path):
    (part,) = read(tmp_path, SQUARE + "f -4 -3 -2\nv 9 9 9\nf -5 -3 -2\n")
    np.testing.assert_allclose(part.positions[part.faces][:, :, 0], [[0, 1, 1], [0, 1, 0]])


def test_indices_out_of_range_are_counted(tmp_path):
    (part,) = read(tmp_path, SQUARE + "f 1 2 3\nf 1 2 5\nf 0 1 2\nf -5 1 2\nf 1 2 x\nf 1 2 99999999999999999999999\n")
    assert len(part.faces) == 1
    assert part.bad_faces == 5


def test_a_file_of_bad_faces_only_is_no_cloud(tmp_path):
    (part,) = read(tmp_path, SQUARE + "f 1 2 9\n")
    assert part.faces.shape == (0, 3)
    assert part.bad_faces == 1


def test_texture_coordinates_and_normals_split_vertices(tmp_path):
    text = SQUARE + "vt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\nvn 0 0 2\nf 1/1/1 2/2/1 3/3/1\nf 1/2/2 3/3/1 4/1/2\n"
    (part,) = read(tmp_path, text)
    assert len(part.positions) == 5
    expected = [[(0, 0), (1, 0), (1, 1)], [(1, 0), (1, 1), (0, 0)]]
    np.testing.assert_allclose(part.texture_coordinates[part.faces], expected)
    np.testing.assert_allclose(part.normals[part.faces][:, :, 2], [[1, 1, 1], [2, 1, 2]])


def test_corners_without_a_normal_or_with_one_out_of_range(tmp_path):
    (part,) = read(tmp_path, SQUARE + "vn 0 0 1\nf 1//1 2//7 3\n")
    assert np.isfinite(part.normals[part.faces[0], 2]).tolist() == [True, False, False]
    assert part.texture_coordinates is None


def test_colours_behind_positions(tmp_path):
    (part,) = read(tmp_path, "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 .5\nf 1 2 3\n")
    assert part.colors[part.faces[0]].tolist() == [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 128, 255]]
    # A fourth number is a weight.
    (part,) = read(tmp_path, "v 0 0 0 1\nv 1 0 0 1\nv 0 1 0 1\nf 1 2 3\n")
    assert part.colors is None


def test_lines_that_go_on(tmp_path):
    (part,) = read(tmp_path, SQUARE + "f 1 2 \\\n 3 \\\r\n 4\n")
    assert len(part.faces) == 2


def test_points_without_faces(tmp_path):
    (part,) = read(tmp_path, "v 0 0 0\nv 1 0 0\nvn 0 0 1\nvn 0 1 0\n")
    assert part.faces is None
    assert part.normals.tolist() == [[0, 0, 1], [0, 1, 0]]
    with pytest.raises(UnreadableFile, match="nothing to draw"):
        read(tmp_path, "# empty\n")


@settings(max_examples=200, deadline=None)
@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_are_read_as_python_reads_them(value):
    for text in (repr(value), f"{value:.6f}", f"{value:+.3E}"):
        line = np.frombuffer(f"v {text} 0 0".encode(), np.uint8)
        vertices = scan_lines(line, count_lines(line))[0]
        expected = float(text)
        # Beyond 1e308 the scaling may meet infinity, and below 1e-300 it loses digits.
        if abs(expected) < 1e300:
            assert vertices[0, 0] == pytest.approx(expected, rel=1e-14, abs=1e-300)


@pytest.mark.parametrize("word", ["nan", "x", "1.2.3", "-", "1e", ".", "1,5"])
def test_words_that_are_no_numbers_are_not_finite(word):
    line = np.frombuffer(f"v {word} 2 3".encode(), np.uint8)
    vertices = scan_lines(line, count_lines(line))[0]
    assert vertices[0, 1:3].tolist() == [2, 3]
    assert np.isnan(vertices[0, 0]) or word == "1e"


def test_materials_make_parts(tmp_path):
    (tmp_path / "a.mtl").write_text("newmtl red\nKd 1 0 0\nnewmtl skin\nKd 1 1 1\nmap_Kd -s 2 2 -o 0.5 my skin.png\n")
    text = "mtllib a.mtl\n" + SQUARE + "vt 0 0\nf 1 2 3\nusemtl skin\nf 1/1 3/1 4/1\nusemtl red\nf 1 2 4\n"
    warnings = []
    parts = read(tmp_path, text, warnings)
    found = {(p.material_color, p.texture_name, len(p.faces)) for p in parts}
    assert found == {(None, None, 1), ((255, 0, 0, 255), None, 1), ((255, 255, 255, 255), "my skin.png", 1)}
    assert warnings == []


def test_a_missing_or_foreign_material_file_is_named(tmp_path):
    (tmp_path / "a.mtl").write_text("newmtl red\nKd 1 0 0\n")
    inner = tmp_path / "inner"
    inner.mkdir()
    for name in ("none.mtl", "../a.mtl"):
        warnings = []
        (part,) = read(inner, f"mtllib {name}\n" + SQUARE + "usemtl red\nf 1 2 3\n", warnings)
        assert part.material_color is None
        assert warnings == [f"the material file {name} is not in the model's folder"]


def test_real_files(shared_models):
    (spot,) = read_obj(shared_models / "spot.obj", [])
    assert len(spot.faces) == 5856
    # 2930 positions and 3225 texture coordinates: the seams double some.
    assert len(spot.positions) == 3225
    (bunny,) = read_obj(shared_models / "stanford-bunny.obj", [])
    assert len(bunny.faces) == 69_451


@pytest.mark.parametrize("rest", ["v 1.0 2", "v 1 2 -", "vn 0 1", "f 1 2", "f"])
def test_last_line_cut_off(tmp_path, rest):
    path = tmp_path / "cut.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n" + rest)
    with pytest.raises(UnreadableFile, match="truncated"):
        read_obj(path, [])


def seconds_to_read(tmp_path, text):
    path = tmp_path / "a.obj"
    path.write_text(text)
    read_obj(path, [])
    start = time.process_time()
    warnings = []
    parts = read_obj(path, warnings)
    return time.process_time() - start, parts, warnings


def test_a_million_empty_lines_before_materials(tmp_path):
    """A search for "blanks, then usemtl" began anew at each line."""
    seconds, parts, _ = seconds_to_read(tmp_path, SQUARE + "f 1 2 3\n" + "\n" * 1_000_000 + "usemtl a\nf 1 2 3\n")
    assert len(parts) == 1
    assert seconds < 2.0


def test_one_material_file_named_ten_thousand_times_is_read_once(tmp_path, monkeypatch):
    (tmp_path / "a.mtl").write_text("newmtl a\nKd 1 0 0\n")
    seen = []
    monkeypatch.setattr("hierarchy.obj.read_materials", lambda folder, name: seen.append(name) or {})
    lines = "mtllib a.mtl\n" * 10_000 + "".join(f"mtllib {k}.mtl\n" for k in range(10_000))
    _, _, warnings = seconds_to_read(tmp_path, lines + SQUARE + "usemtl a\nf 1 2 3\n")
    assert len(seen) == 2 * MOST_MATERIAL_FILES
    assert warnings == [f"of 10001 material files only {MOST_MATERIAL_FILES} are read"]


def test_a_material_a_face(tmp_path):
    (tmp_path / "a.mtl").write_text("".join(f"newmtl {k}\nmap_Kd {k}.png\n" for k in range(20_000)))
    text = "mtllib a.mtl\n" + SQUARE + "".join(f"usemtl {k}\nf 1 2 3\n" for k in range(20_000))
    seconds, parts, warnings = seconds_to_read(tmp_path, text)
    assert len(parts) == MOST_MATERIALS
    assert sum(len(part.faces) for part in parts) == 20_000
    assert warnings == [f"of the materials only {MOST_MATERIALS - 1} are used"]
    assert seconds < 5.0


def test_a_material_file_without_end(tmp_path):
    with (tmp_path / "a.mtl").open("wb") as stream:
        stream.truncate(1 << 33)
    warnings = []
    read(tmp_path, "mtllib a.mtl\n" + SQUARE + "usemtl a\nf 1 2 3\n", warnings)
    assert warnings == ["the material file a.mtl is too large"]
