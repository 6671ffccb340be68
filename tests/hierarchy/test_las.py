import laspy
import numpy as np
import pytest

from hierarchy.las import read_las
from hierarchy.model import Cancelled
from hierarchy.part import UnreadableFile

POINTS = np.random.default_rng(1).uniform(0, 10, (2000, 3)).round(3) + np.array([4.0e6, 5.5e6, 100.0])


def write_las(path, point_format=2, scale=1):
    header = laspy.LasHeader(point_format=point_format)
    header.offsets, header.scales = [4.0e6, 5.5e6, 0.0], [0.001] * 3
    las = laspy.LasData(header)
    las.x, las.y, las.z = POINTS.T
    if "red" in las.point_format.dimension_names:
        las.red, las.green, las.blue = (np.arange(2000) % 256 * scale for _ in range(3))
    las.write(path)
    return path


@pytest.mark.parametrize("suffix", ["las", "laz"])
@pytest.mark.parametrize("point_format", [0, 2, 7])
def test_coordinates_keep_their_millimetres(tmp_path, suffix, point_format):
    (part,) = read_las(write_las(tmp_path / f"a.{suffix}", point_format))
    np.testing.assert_allclose(part.positions, POINTS, atol=1e-6, rtol=0)
    assert part.normals is None
    assert (part.colors is None) == (point_format == 0)


@pytest.mark.parametrize("scale", [1, 257])
def test_colours_of_8_and_16_bits(tmp_path, scale):
    (part,) = read_las(write_las(tmp_path / "a.las", scale=scale))
    assert part.colors[:256, 0].tolist() == list(range(256))
    assert (part.colors[:, 3] == 255).all()


def test_colours_that_were_never_taken(tmp_path):
    (part,) = read_las(write_las(tmp_path / "a.las", scale=0))
    assert part.colors is None


@pytest.mark.parametrize("suffix", ["las", "laz"])
@pytest.mark.parametrize("kept", [0.5, 0.9, 0.99])
def test_truncated(tmp_path, suffix, kept):
    path = write_las(tmp_path / f"a.{suffix}")
    data = path.read_bytes()
    path.write_bytes(data[: int(kept * len(data))])
    with pytest.raises(UnreadableFile, match="truncated"):
        read_las(path)


def test_a_table_of_chunks_full_of_rubbish_never_reaches_lazrs(tmp_path):
    path = write_las(tmp_path / "a.laz")
    data = bytearray(path.read_bytes())
    with laspy.open(path) as reader:
        start = reader.header.offset_to_point_data
    table = int.from_bytes(data[start : start + 8], "little")
    # lazrs would reserve 64 GB for so many chunks, and abort the process.
    data[table + 4 : table + 8] = b"\xff\xff\xff\xff"
    path.write_bytes(bytes(data))
    with pytest.raises(UnreadableFile, match="table of chunks"):
        read_las(path)


def test_no_points(tmp_path):
    laspy.LasData(laspy.LasHeader(point_format=0)).write(tmp_path / "a.las")
    with pytest.raises(UnreadableFile, match="nothing to draw"):
        read_las(tmp_path / "a.las")


def test_progress_can_cancel(tmp_path):
    def cancel(stage, fraction):
        raise Cancelled

    with pytest.raises(Cancelled):
        read_las(write_las(tmp_path / "a.las"), cancel)


def test_a_real_scan(shared_models):
    (lion,) = read_las(shared_models / "lion.copc.laz")
    assert lion.positions.shape == (341_989, 3)
    assert lion.colors.shape == (341_989, 4)
    assert lion.colors[:, :3].max() == 254
