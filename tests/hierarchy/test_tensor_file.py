import json
import mmap

import numpy as np
import pytest
import safetensors.numpy

from hierarchy.tensor_file import ALIGNMENT, BLOCK, DamagedFile, map_tensors, read_metadata, write_tensors

TENSORS = {
    "bytes": np.arange(7, dtype=np.uint8),
    "floats": np.linspace(-1.0, 1.0, 15, dtype=np.float32).reshape(5, 3),
    "nothing": np.empty((0, 3), np.int32),
    "shorts": np.arange(5, dtype=np.uint16),
    "doubles": np.array([1e300, -1e-300]),
}


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "a.safetensors"
    write_tensors(path, TENSORS, {"who": 'a "quoted" \n name \udcff'})
    return path


def test_what_is_mapped_is_what_was_written(file):
    tensors, metadata = map_tensors(file)
    assert tensors.keys() == TENSORS.keys()
    for name, array in tensors.items():
        assert array.dtype == TENSORS[name].dtype
        assert np.array_equal(array, TENSORS[name])
        assert array.flags.aligned
        assert array.flags.writeable
    assert metadata["who"] == read_metadata(file)["who"] == 'a "quoted" \n name \udcff'


def test_any_reader_of_the_format_reads_it(tmp_path):
    path = tmp_path / "a.safetensors"
    size = write_tensors(path, TENSORS, {"who": "me"})
    assert size == path.stat().st_size
    read = safetensors.numpy.load_file(path)
    assert all(np.array_equal(read[name], array) for name, array in TENSORS.items())
    with safetensors.safe_open(path, "np") as opened:
        assert opened.metadata()["who"] == "me"


def test_arrays_begin_aligned(file):
    length = int.from_bytes(file.read_bytes()[:8], "little")
    assert (8 + length) % ALIGNMENT == 0


def test_writing_to_a_mapped_array_changes_nothing_else(file):
    before = file.read_bytes()
    tensors, _ = map_tensors(file)
    tensors["floats"][:] = 7.0
    assert file.read_bytes() == before
    assert map_tensors(file)[0]["floats"][0, 0] == -1.0


def test_mapped_arrays_outlive_their_file(file):
    tensors, _ = map_tensors(file)
    write_tensors(file, {"floats": np.zeros(3, np.float32)}, {})
    assert np.array_equal(tensors["floats"], TENSORS["floats"])
    file.unlink()
    assert np.array_equal(tensors["shorts"], TENSORS["shorts"])


def test_every_flipped_bit_is_noticed(file):
    good = file.read_bytes()
    for place in range(len(good)):
        file.write_bytes(good[:place] + bytes([good[place] ^ 1 << place % 8]) + good[place + 1 :])
        with pytest.raises(DamagedFile):
            map_tensors(file)


def test_every_other_length_is_noticed(file):
    good = file.read_bytes()
    for length in range(len(good)):
        file.write_bytes(good[:length])
        with pytest.raises(DamagedFile):
            map_tensors(file)
        with pytest.raises(DamagedFile):
            read_metadata(file)
    file.write_bytes(good + b"\0")
    with pytest.raises(DamagedFile, match="bytes instead of"):
        map_tensors(file)


def test_arrays_of_several_blocks_are_checked_to_the_end(tmp_path):
    path = tmp_path / "a.safetensors"
    write_tensors(path, {"long": np.arange(2 * BLOCK // 4 + 5, dtype=np.int32)}, {})
    map_tensors(path)
    data = bytearray(path.read_bytes())
    data[-1] ^= 128
    path.write_bytes(data)
    with pytest.raises(DamagedFile, match="long"):
        map_tensors(path)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_none_are_refused_though_their_checksums_fit(tmp_path, value):
    path = tmp_path / "a.safetensors"
    write_tensors(path, {"a": np.array([0.0, value], np.float32)}, {})
    with pytest.raises(DamagedFile, match="are not what was written"):
        map_tensors(path)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("shape", [2**62, 4]), ("shape", [-1, 3]), ("shape", "3x"), ("shape", [1e308]), ("shape", None),
        ("dtype", "BF16"), ("dtype", ["F32"]), ("data_offsets", [0, 4]), ("data_offsets", [2**64, 2**64 + 60]),
    ],
)  # fmt: skip
def test_header_that_describes_no_arrays_is_refused(tmp_path, monkeypatch, field, value):
    path = tmp_path / "a.safetensors"
    dumps = json.dumps

    def tampered(described, **keywords):
        if isinstance(described, dict) and "floats" in described and "__metadata__" in described:
            described["floats"][field] = value
        return dumps(described, **keywords)

    monkeypatch.setattr(json, "dumps", tampered)
    write_tensors(path, TENSORS, {})
    with pytest.raises(DamagedFile, match="arrays"):
        map_tensors(path)


def test_header_of_another_kind_is_refused(tmp_path):
    path = tmp_path / "a.safetensors"
    for text in (
        b"[1,2]",
        b"{}",
        b'"a"',
        b"[" * 5000,
        b'{"__metadata__":[]}',
        b'{"__metadata__":{"checksum":5}}',
        b"\xff\xff",
    ):
        path.write_bytes(len(text).to_bytes(8, "little") + text)
        with pytest.raises(DamagedFile):
            map_tensors(path)
    safetensors.numpy.save_file({"a": np.zeros(3)}, path)
    with pytest.raises(DamagedFile):
        map_tensors(path)


def test_what_is_no_file_is_not_waited_for(tmp_path):
    import os

    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", tmp_path):
        with pytest.raises(DamagedFile, match="no file"):
            map_tensors(path)
    with pytest.raises(FileNotFoundError):
        map_tensors(tmp_path / "nothing")


def test_cancelled_writing_leaves_nothing(tmp_path):
    path = tmp_path / "a.safetensors"

    def stop(fraction):
        if fraction > 0.5:
            raise InterruptedError

    with pytest.raises(InterruptedError):
        write_tensors(path, {"long": np.zeros(4 * BLOCK, np.uint8)}, {}, stop)
    assert list(tmp_path.iterdir()) == []


def test_map_is_of_the_kind_that_kernels_are_compiled_for(file):
    tensors, _ = map_tensors(file)
    base = tensors["floats"]
    while isinstance(base, np.ndarray) and base.base is not None:
        base = base.base
    assert isinstance(base, (mmap.mmap, memoryview))
    import numba

    assert numba.typeof(tensors["floats"]) == numba.typeof(np.zeros((5, 3), np.float32))
