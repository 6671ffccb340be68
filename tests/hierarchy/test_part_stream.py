import io
import json

import numpy as np
import pytest

from hierarchy.part import Part
from hierarchy.part_stream import ARRAYS, BrokenStream, receive_message, receive_part, send_message, send_part

RNG = np.random.default_rng(1)


def full_part():
    return Part(
        RNG.random((5, 3)),
        RNG.integers(0, 5, (4, 3)),
        RNG.random((5, 3)),
        RNG.integers(0, 256, (5, 4)).astype(np.uint8),
        RNG.random((5, 2)),
        RNG.integers(0, 256, (3, 2, 4)).astype(np.uint8),
        "ä\nb",
        (1, 2, 3, 255),
        7,
    )


def there_and_back(part, most_bytes=10**6):
    stream = io.BytesIO()
    send_part(stream, part)
    stream.seek(0)
    return receive_part(stream, receive_message(stream), most_bytes)


@pytest.mark.parametrize(
    "part", [full_part(), Part(np.empty((0, 3)), np.empty((0, 3), np.int64)), Part(np.ones((1, 3)))]
)
def test_a_part_arrives_as_it_was_sent(part):
    arrived, size = there_and_back(part)
    assert size == sum(getattr(part, name).nbytes for name in ARRAYS if getattr(part, name) is not None)
    for name in ARRAYS:
        sent, got = getattr(part, name), getattr(arrived, name)
        assert (sent is None) == (got is None)
        if sent is not None:
            assert got.dtype == sent.dtype
            assert got.flags.writeable
            np.testing.assert_array_equal(got, sent)
    assert (arrived.texture_name, arrived.material_color, arrived.bad_faces) == (
        part.texture_name,
        part.material_color,
        part.bad_faces,
    )


def test_a_slice_that_is_not_contiguous():
    positions = RNG.random((10, 6))[::2, ::2]
    np.testing.assert_array_equal(there_and_back(Part(positions))[0].positions, positions)


def test_more_bytes_than_allowed():
    size = there_and_back(full_part())[1]
    assert there_and_back(full_part(), size)
    with pytest.raises(BrokenStream):
        there_and_back(full_part(), size - 1)


@pytest.mark.parametrize(
    "shapes",
    [
        {},
        {"faces": [1, 3]},
        {"positions": [3]},
        {"positions": [1, 2]},
        {"positions": [-1, 3]},
        {"positions": [1, 3], "faces": [1, 4]},
        {"positions": [1, 3], "normals": [2, 3]},
        {"positions": [1, 3], "colors": [1, 3]},
        {"positions": [1, 3], "texture": [2]},
        {"positions": [1, 3], "texture": [-2, -2, 4]},
        {"positions": [1, 3], "name": [1]},
        {"positions": [2**62, 3]},
        {"positions": [10**300, 3]},
        {"positions": "12"},
        {"positions": ["a", 3]},
        {"positions": None},
        [1],
        None,
    ],
)
def test_shapes_that_lie(shapes):
    message = {"part": shapes, "texture_name": None, "material_color": None, "bad_faces": 0}
    with pytest.raises(BrokenStream):
        receive_part(io.BytesIO(bytes(1000)), message, 10**9)


def test_a_stream_that_ends_within_an_array():
    stream = io.BytesIO()
    send_part(stream, full_part())
    stream = io.BytesIO(stream.getvalue()[:-1])
    with pytest.raises(BrokenStream):
        receive_part(stream, receive_message(stream), 10**6)


@pytest.mark.parametrize("line", [b"", b"\n", b"[]\n", b"{", b"\xff\n", b"[" * 100_000, b" " * 10**6 + b"{}\n"])
def test_lines_that_are_no_message(line):
    with pytest.raises(BrokenStream):
        receive_message(io.BytesIO(line))


def test_messages_are_single_lines():
    stream = io.BytesIO()
    send_message(stream, {"warning": "two\nlines \udcff"})
    assert stream.getvalue().count(b"\n") == 1
    assert json.loads(stream.getvalue()) == {"warning": "two\nlines \udcff"}
