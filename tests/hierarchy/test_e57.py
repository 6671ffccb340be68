import time
from pathlib import Path

import numpy as np
import pytest
from e57_writer import crc32c, double, integer, physical, reseal, scan, single, write_e57

from hierarchy.e57 import read_e57
from hierarchy.e57_packets import unpack_bits
from hierarchy.e57_pages import logical
from hierarchy.load import file_kind, load_model
from hierarchy.model import Cancelled, ModelError, PointCloud
from hierarchy.part import UnreadableFile

RNG = np.random.default_rng(1)
POINTS = RNG.uniform(-10, 10, (500, 3))


def cartesian(points, kind=double):
    return {f"cartesian{axis}": kind(column) for axis, column in zip("XYZ", points.T, strict=True)}


def pose(w, x, y, z, *translation):
    rotation = "".join(f'<{n} type="Float">{v!r}</{n}>' for n, v in zip("wxyz", (w, x, y, z), strict=True))
    moved = "".join(f'<{n} type="Float">{v!r}</{n}>' for n, v in zip("xyz", translation, strict=True))
    return f"<pose><rotation>{rotation}</rotation><translation>{moved}</translation></pose>"


def read_one(tmp_path, fields, count=500, more="", **options):
    (part,) = read_e57(write_e57(tmp_path / "a.e57", [scan(count, fields, more)], **options), [])
    return part


def failure(tmp_path, fields, **options):
    with pytest.raises(UnreadableFile) as caught:
        read_one(tmp_path, fields, **options)
    return str(caught.value)


def test_a_file_of_the_standards_own_library():
    # Written by libE57Format: two scans of points on a lattice, the second turned by 90 degrees about z and moved.
    parts = read_e57(Path(__file__).with_name("libe57.e57"), [])
    lattice = np.stack(np.unravel_index(np.arange(60), (3, 4, 5)), axis=1).astype(float)
    np.testing.assert_array_equal(parts[0].positions, lattice[np.arange(60) % 7 != 0])
    np.testing.assert_allclose(parts[1].positions, lattice @ [[0, 1, 0], [-1, 0, 0], [0, 0, 1]] + [10, 20, 30])
    np.testing.assert_array_equal(parts[0].colors[:, 2], (4 * np.arange(60))[np.arange(60) % 7 != 0])
    # Its intensities run from 0 to 59.
    np.testing.assert_array_equal(parts[1].colors[:, 0], np.rint(np.arange(60) * 255 / 59))


def test_the_writer_of_the_tests_agrees_with_the_known_checksum():
    assert crc32c(b"123456789") == 0xE3069283


@pytest.mark.parametrize("piece", [1, 7, 99, 1000])
def test_scaled_integers_across_packets(tmp_path, piece):
    raw = np.round(POINTS * 1000).astype(int)
    fields = {
        f"cartesian{axis}": integer(column, -10_000, 10_000, scale=0.001, offset=5.0)
        for axis, column in zip("XYZ", raw.T, strict=True)
    }
    part = read_one(tmp_path, fields, piece=piece)
    np.testing.assert_allclose(part.positions, raw * 0.001 + 5.0, rtol=0, atol=1e-12)


@pytest.mark.parametrize("many", [10, 1000])
@pytest.mark.parametrize("bits", [1, 2, 7, 8, 9, 31, 32, 33, 57, 58, 63, 64])
def test_unpacking_every_width_of_bits(monkeypatch, bits, many):
    monkeypatch.setattr("hierarchy.e57_packets.MANY", many)
    values = [int(v) for v in RNG.integers(0, 2**bits, 200, dtype=np.uint64, endpoint=False)] if bits < 64 else None
    values = values or [int(v) for v in RNG.integers(0, 2**64 - 1, 200, dtype=np.uint64, endpoint=True)]
    values[:2] = [2**bits - 1, 0]
    _, stream = integer(values, 0, 2**bits - 1)
    assert unpack_bits(np.frombuffer(stream + bytes(9), np.uint8), bits, 200).tolist() == values


def test_an_integer_without_a_range_has_64_bits(tmp_path):
    low = -(2**63)
    _, stream = integer([low, 0, 2**63 - 1], low, 2**63 - 1)
    fields = {f"cartesian{axis}": ('type="Integer"', stream) for axis in "XYZ"}
    assert read_one(tmp_path, fields, 3).positions[:, 0].tolist() == [-(2.0**63), 0.0, 2.0**63]


def test_a_value_that_never_changes_takes_no_bits(tmp_path):
    fields = cartesian(POINTS) | {"cartesianZ": integer([7] * 500, 7, 7, scale=0.5)}
    np.testing.assert_array_equal(read_one(tmp_path, fields).positions[:, 2], 3.5)


def test_a_million_points_in_no_bytes_are_not_believed(tmp_path):
    fields = {f"cartesian{axis}": integer([], 7, 7) for axis in "XYZ"}
    assert len(read_one(tmp_path, fields, 1000).positions) == 1000
    assert "too many for" in failure(tmp_path, fields, count=2**40)


def test_spherical_coordinates(tmp_path):
    distance = np.linalg.norm(POINTS, axis=1)
    fields = {
        "sphericalRange": double(distance),
        "sphericalAzimuth": double(np.arctan2(POINTS[:, 1], POINTS[:, 0])),
        "sphericalElevation": double(np.arcsin(POINTS[:, 2] / distance)),
        "sphericalInvalidState": integer(np.arange(500) % 3, 0, 2),
    }
    np.testing.assert_allclose(read_one(tmp_path, fields).positions, POINTS[::3], atol=1e-12)


def test_a_pose_turns_points_and_normals(tmp_path):
    normals = POINTS / np.linalg.norm(POINTS, axis=1, keepdims=True)
    fields = cartesian(POINTS) | {f"nor:normal{axis}": single(c) for axis, c in zip("XYZ", normals.T, strict=True)}
    # A third of a turn about (1, 1, 1): x to y to z; the quaternion is not a unit one.
    part = read_one(tmp_path, fields, more=pose(2.0, 2.0, 2.0, 2.0, 1.0, 2.0, 3.0))
    np.testing.assert_allclose(part.positions, POINTS[:, [2, 0, 1]] + [1, 2, 3], atol=1e-12)
    np.testing.assert_allclose(part.normals, normals[:, [2, 0, 1]], atol=1e-6)


@pytest.mark.parametrize("w", [0.0, float("nan"), float("inf")])
def test_a_quaternion_that_is_none_turns_nothing(tmp_path, w):
    part = read_one(tmp_path, cartesian(POINTS), more=pose(w, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    np.testing.assert_array_equal(part.positions, POINTS)


def test_all_scans_become_one_cloud(tmp_path):
    scans = [scan(500, cartesian(POINTS), pose(1.0, 0.0, 0.0, 0.0, 30.0 * i, 0.0, 0.0)) for i in range(3)]
    write_e57(tmp_path / "a.e57", scans)
    cloud = load_model((tmp_path / "a.e57").rename(tmp_path / "scan.dat"))
    assert isinstance(cloud, PointCloud)
    assert file_kind(tmp_path / "scan.dat") == "e57"
    assert len(cloud.positions) == 1500


def test_colours_of_16_bits_with_their_limits(tmp_path):
    limits = "".join(
        f"<color{name}{end}>{value}</color{name}{end}>"
        for name in ("Red", "Green", "Blue")
        for end, value in (("Minimum", 100), ("Maximum", 1100))
    )
    levels = np.linspace(100, 1100, 500).astype(int)
    fields = cartesian(POINTS) | {f"color{name}": integer(levels, 0, 65535) for name in ("Red", "Green", "Blue")}
    fields["isColorInvalid"] = integer(np.arange(500) == 9, 0, 1)
    colors = read_one(tmp_path, fields, more=f"<colorLimits>{limits}</colorLimits>").colors
    expected = np.rint((levels - 100) * 0.255).astype(np.uint8)
    expected[9] = 255
    np.testing.assert_array_equal(colors, np.stack([expected, expected, expected, np.full(500, 255)], axis=1))


def test_colours_without_limits_take_those_of_their_bits(tmp_path):
    fields = cartesian(POINTS) | {f"color{name}": integer([15] * 500, 0, 15) for name in ("Red", "Green", "Blue")}
    assert (read_one(tmp_path, fields).colors == 255).all()


def test_intensity_is_grey_where_there_are_no_colours(tmp_path):
    fields = cartesian(POINTS) | {"intensity": single(np.linspace(0, 1, 500))}
    colors = read_one(tmp_path, fields).colors
    assert colors[[0, 250, 499]].tolist() == [[0, 0, 0, 255], [128, 128, 128, 255], [255, 255, 255, 255]]


def test_a_scan_without_coordinates_is_left_out(tmp_path):
    scans = [scan(500, cartesian(POINTS)), scan(3, {"intensity": single([1, 2, 3])})]
    warnings = []
    assert len(read_e57(write_e57(tmp_path / "a.e57", scans), warnings)) == 1
    assert warnings == ["left out 1 scan without coordinates"]


@pytest.mark.parametrize("scans", [[], [scan(0, cartesian(POINTS[:0]))]])
def test_no_points(tmp_path, scans):
    with pytest.raises(UnreadableFile, match="nothing to draw"):
        read_e57(write_e57(tmp_path / "a.e57", scans), [])


@pytest.mark.parametrize("many", [1, 1000])
def test_a_changed_bit_fails_its_page(monkeypatch, tmp_path, many):
    monkeypatch.setattr("hierarchy.e57_pages.MANY", many)
    path = write_e57(tmp_path / "a.e57", [scan(500, cartesian(POINTS))])
    data = bytearray(path.read_bytes())
    data[3000] ^= 1
    path.write_bytes(data)
    with pytest.raises(UnreadableFile, match="page 2 does not agree with its checksum"):
        read_e57(path, [])


@pytest.mark.parametrize("kept", [20, 1000, 3000, -1])
def test_truncated(tmp_path, kept):
    path = write_e57(tmp_path / "a.e57", [scan(500, cartesian(POINTS))])
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(UnreadableFile, match="truncated"):
        read_e57(path, [])


def test_more_points_promised_than_there_are(tmp_path):
    assert "fewer points than it promises" in failure(tmp_path, cartesian(POINTS), stated=501)
    assert "negative number" in failure(tmp_path, cartesian(POINTS), stated=-1)


def test_scans_that_share_their_points(tmp_path):
    scans = [scan(500, cartesian(POINTS))] * 4
    with pytest.raises(UnreadableFile, match="scans overlap"):
        read_e57(write_e57(tmp_path / "a.e57", scans, shared=True), [])


def test_thousands_of_scans_of_one_point_each(tmp_path):
    # Every one with packets and pages of its own, of which each costs more to start on than to read.
    scans = [scan(1, cartesian(POINTS[[i % 500]])) for i in range(2000)]
    write_e57(tmp_path / "a.e57", scans)
    start = time.thread_time()
    assert len(read_e57(tmp_path / "a.e57", [])) == 2000
    # Measured: 0.6 s.
    assert time.thread_time() - start < 5.0


def test_a_packet_shorter_than_its_own_head(tmp_path):
    path = write_e57(tmp_path / "a.e57", [scan(500, cartesian(POINTS))])
    data = bytearray(path.read_bytes())
    # The first packet, behind the header of the section, then is two bytes long.
    data[82:84] = b"\x01\x00"
    path.write_bytes(reseal(bytes(data)))
    with pytest.raises(UnreadableFile, match="does not have the fields"):
        read_e57(path, [])


def test_a_range_that_is_none(tmp_path):
    _, stream = integer([0] * 500, 0, 7)
    fields = cartesian(POINTS) | {"colorRed": ('type="Integer" minimum="7" maximum="0"', stream)}
    assert failure(tmp_path, fields) == "damaged: colorRed has no range"


def test_a_thousand_laughs_in_the_description(tmp_path):
    bomb = '<!DOCTYPE e57Root [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;">]><e57Root>&b;<x y="%d"/></e57Root>'
    assert failure(tmp_path, cartesian(POINTS), description=bomb) == "damaged: its description defines entities"


@pytest.mark.parametrize("text", ["nine", "9" * 5000, "1e999999", "0x10"])
def test_a_word_where_a_number_belongs(tmp_path, text):
    write_e57(tmp_path / "a.e57", [scan(500, cartesian(POINTS))], stated=text)
    with pytest.raises(ModelError, match=r"^a\.e57: damaged, truncated or not an E57 file"):
        load_model(tmp_path / "a.e57")


def test_a_description_a_hundred_thousand_levels_deep(tmp_path):
    deep = "<a>" * 100_000 + "<!-- %d -->" + "</a>" * 100_000
    assert failure(tmp_path, cartesian(POINTS), description=deep).startswith("nothing to draw")


def test_places_in_content_and_in_the_file():
    for place in (0, 48, 1019, 1020, 5000):
        assert logical(physical(place)) == place


def test_progress_can_cancel(tmp_path):
    def cancel(stage, fraction):
        raise Cancelled

    path = write_e57(tmp_path / "a.e57", [scan(500, cartesian(POINTS))])
    with pytest.raises(Cancelled):
        read_e57(path, [], cancel)
