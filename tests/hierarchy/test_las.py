import struct

import laspy
import numpy as np
import pytest

from hierarchy.las import is_compressed, read_las, read_laz
from hierarchy.las_header import find_laszip, read_las_header
from hierarchy.model import Cancelled
from hierarchy.part import UnreadableFile

POINTS = np.random.default_rng(1).uniform(0, 10, (2000, 3)).round(3) + np.array([4.0e6, 5.5e6, 100.0])

COUNT, RECORDS, FORMAT, POINT_SIZE, START = (107, "<I"), (100, "<I"), (104, "<B"), (105, "<H"), (96, "<I")


def read(path):
    (part,) = read_laz(path) if is_compressed(path) else read_las(path)
    return part


def write_las(path, point_format=2, scale=1, extra=False):
    header = laspy.LasHeader(point_format=point_format)
    header.offsets, header.scales = [4.0e6, 5.5e6, 0.0], [0.001] * 3
    if extra:
        header.add_extra_dim(laspy.ExtraBytesParams(name="height", type=np.float64))
    las = laspy.LasData(header)
    las.x, las.y, las.z = POINTS.T
    if "red" in las.point_format.dimension_names:
        las.red, las.green, las.blue = (np.arange(2000) % 256 * scale for _ in range(3))
    las.write(path)
    return path


def overwrite(path, field, value):
    place, layout = field
    data = bytearray(path.read_bytes())
    struct.pack_into(layout, data, place, value)
    path.write_bytes(data)
    return path


def failure(path):
    with pytest.raises(UnreadableFile) as caught:
        read(path)
    return str(caught.value)


@pytest.mark.parametrize("suffix", ["las", "laz"])
@pytest.mark.parametrize("point_format", [*range(9), 10])
def test_coordinates_keep_their_millimetres(tmp_path, suffix, point_format):
    part = read(write_las(tmp_path / f"a.{suffix}", point_format, extra=point_format in (2, 7)))
    np.testing.assert_allclose(part.positions, POINTS, atol=1e-6, rtol=0)
    assert part.normals is None
    if point_format in (2, 3, 5, 7, 8, 10):
        assert part.colors[:, 2].tolist() == (np.arange(2000) % 256).tolist()
    else:
        assert part.colors is None


@pytest.mark.parametrize("scale", [1, 257])
def test_colours_of_8_and_16_bits(tmp_path, scale):
    part = read(write_las(tmp_path / "a.las", scale=scale))
    assert part.colors[:256, 0].tolist() == list(range(256))
    assert (part.colors[:, 3] == 255).all()


def test_colours_that_were_never_taken(tmp_path):
    assert read(write_las(tmp_path / "a.las", scale=0)).colors is None


def test_points_of_many_batches(tmp_path, monkeypatch):
    monkeypatch.setattr("hierarchy.las.BATCH", 1 << 12)
    for suffix in ("las", "laz"):
        part = read(write_las(tmp_path / f"a.{suffix}"))
        np.testing.assert_allclose(part.positions, POINTS, atol=1e-6, rtol=0)
        assert part.colors[:256, 0].tolist() == list(range(256))


@pytest.mark.parametrize("suffix", ["las", "laz"])
@pytest.mark.parametrize("kept", [0.005, 0.01, 0.5, 0.9, 0.99])
def test_truncated(tmp_path, suffix, kept):
    path = write_las(tmp_path / f"a.{suffix}")
    data = path.read_bytes()
    path.write_bytes(data[: int(kept * len(data))])
    assert "truncated" in failure(path)


def test_a_table_of_chunks_full_of_rubbish_never_reaches_lazrs(tmp_path):
    path = write_las(tmp_path / "a.laz")
    data = bytearray(path.read_bytes())
    start = read_las_header(path).start
    table = int.from_bytes(data[start : start + 8], "little")
    # lazrs would reserve 64 GB for so many chunks, and abort the process.
    data[table + 4 : table + 8] = b"\xff\xff\xff\xff"
    path.write_bytes(bytes(data))
    assert "table of chunks" in failure(path)


def test_four_billion_records_before_the_points_are_not_counted(tmp_path):
    for suffix in ("las", "laz"):
        part = read(overwrite(write_las(tmp_path / f"a.{suffix}"), RECORDS, 2**32 - 1))
        assert len(part.positions) == 2000


def test_a_record_longer_than_the_room_for_records():
    record = struct.pack("<2x16sHH32x", b"laszip encoded", 22204, 100)
    assert find_laszip(record + bytes(100), 1) == bytes(100)
    for data, records in ((record + bytes(99), 1), (record + bytes(100), 0), (b"", 9)):
        with pytest.raises(UnreadableFile, match="how its points are compressed"):
            find_laszip(data, records)


@pytest.mark.parametrize(
    ("field", "value", "expected"),
    [
        (COUNT, 2**32 - 1, "truncated: its header promises 4294967295 points"),
        (COUNT, 2001, "truncated: its header promises 2001 points"),
        (COUNT, 0, "nothing to draw"),
        (FORMAT, 11, "points of format 11 are unknown"),
        (POINT_SIZE, 25, "damaged: points of format 2 do not fit into 25 bytes"),
        (POINT_SIZE, 0, "damaged: points of format 2 do not fit into 0 bytes"),
        (POINT_SIZE, 65535, "truncated"),
        (START, 0, "damaged: its points begin inside its header"),
        (START, 2**32 - 1, "truncated: the file ends before its points"),
        (FORMAT, 0x82, "damaged: it does not say how its points are compressed"),
    ],
)
def test_a_field_of_the_header_that_is_wrong(tmp_path, field, value, expected):
    assert expected in failure(overwrite(write_las(tmp_path / "a.las"), field, value))


def test_a_compressed_file_that_promises_more_than_its_size_allows(tmp_path):
    path = write_las(tmp_path / "a.laz")
    assert "4,294,967,295 points" in failure(overwrite(path, COUNT, 2**32 - 1))


def test_compressed_points_longer_than_their_compression_says(tmp_path):
    path = write_las(tmp_path / "a.laz")
    assert "not as long as its compression says" in failure(overwrite(path, POINT_SIZE, 27))


def test_no_points(tmp_path):
    for suffix in ("las", "laz"):
        laspy.LasData(laspy.LasHeader(point_format=0)).write(tmp_path / f"a.{suffix}")
        assert "nothing to draw" in failure(tmp_path / f"a.{suffix}")


def test_progress_can_cancel(tmp_path):
    def cancel(stage, fraction):
        raise Cancelled

    with pytest.raises(Cancelled):
        read_las(write_las(tmp_path / "a.las"), cancel)


def test_a_real_scan(shared_models):
    (lion,) = read_laz(shared_models / "lion.copc.laz")
    assert lion.positions.shape == (341_989, 3)
    assert lion.colors.shape == (341_989, 4)
    assert lion.colors[:, :3].max() == 254
