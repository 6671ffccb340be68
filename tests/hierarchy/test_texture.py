import os
import struct
import subprocess
import sys
import time
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from hierarchy.assemble import gather_skin
from hierarchy.load import load_model
from hierarchy.model import ModelError, in_file_space
from hierarchy.part import Part, UnreadableFile
from hierarchy.texture import (
    FACES_FOR_ANY,
    MOST_FACES,
    TEXELS_PER_EDGE,
    paint,
    read_texture,
    sample_bilinear,
    varied_texels,
)

RNG = np.random.default_rng(4)
TEXTURE = RNG.integers(0, 256, (5, 8, 4)).astype(np.uint8)

QUAD = "v 0 0 0\nv 4 0 0\nv 4 2 0\nv 0 2 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n"


def centres(texture):
    height, width = texture.shape[:2]
    x, y = np.meshgrid((np.arange(width) + 0.5) / width, 1.0 - (np.arange(height) + 0.5) / height)
    return np.column_stack([x.ravel(), y.ravel()])


@pytest.mark.parametrize("turns", [0, 3, -2])
def test_texel_centres_give_texels_with_row_0_at_v_1(turns):
    np.testing.assert_array_equal(sample_bilinear(TEXTURE, centres(TEXTURE) + turns), TEXTURE.reshape(-1, 4))


def test_between_two_texels_lies_their_mean():
    middle = (centres(TEXTURE)[:1] + centres(TEXTURE)[1:2]) / 2
    np.testing.assert_allclose(sample_bilinear(TEXTURE, middle)[0], TEXTURE[0, :2].mean(axis=0), atol=0.51)


def test_borders_mix_only_where_the_image_repeats():
    corner = np.array([[0.0, 1.0]])
    np.testing.assert_array_equal(sample_bilinear(TEXTURE, corner)[0], TEXTURE[0, 0])
    four = TEXTURE[[0, 0, -1, -1], [0, -1, 0, -1]].mean(axis=0)
    np.testing.assert_allclose(sample_bilinear(TEXTURE, np.concatenate([corner, [[1.5, 0.5]]]))[0], four, atol=0.51)


def test_coordinates_that_are_not_finite():
    assert sample_bilinear(TEXTURE, np.array([[np.nan, 0.5], [np.inf, -np.inf]])).shape == (2, 4)


@pytest.mark.parametrize(("mode", "expected"), [("RGB", [200, 100, 50, 255]), ("RGBA", [200, 100, 50, 77]),
                                                ("L", [90, 90, 90, 255]), ("I;16", [90, 90, 90, 255])])  # fmt: skip
def test_modes_of_images(tmp_path, mode, expected):
    values = {"RGB": expected[:3], "RGBA": expected, "L": 90}
    if mode == "I;16":
        image = Image.fromarray(np.full((3, 2), 90 * 256 + 13, np.uint16))
    else:
        image = Image.new(mode, (2, 3), tuple(values[mode]) if mode != "L" else 90)
    image.save(tmp_path / "a.png")
    texture = read_texture(tmp_path / "a.png")
    assert texture.shape == (3, 2, 4)
    assert np.unique(texture.reshape(-1, 4), axis=0).tolist() == [expected]


def test_images_that_cannot_be_read(tmp_path):
    with pytest.raises(UnreadableFile, match=r"no such texture: a\.png"):
        read_texture(tmp_path / "a.png")
    (tmp_path / "a.png").write_text("no image")
    with pytest.raises(UnreadableFile, match=r"a\.png is no readable image"):
        read_texture(tmp_path / "a.png")
    Image.fromarray(RNG.integers(0, 255, (64, 64, 3)).astype(np.uint8)).save(tmp_path / "b.png")
    (tmp_path / "b.png").write_bytes((tmp_path / "b.png").read_bytes()[:2000])
    with pytest.raises(UnreadableFile, match=r"b\.png is no readable image"):
        read_texture(tmp_path / "b.png")
    with pytest.raises(UnreadableFile, match="no readable image"):
        read_texture(tmp_path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_pipe_as_a_texture_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.png")
    with pytest.raises(UnreadableFile, match="not a regular file"):
        read_texture(tmp_path / "pipe.png")


def test_a_texture_that_is_a_program_is_not_run(tmp_path):
    """Pillow would have Ghostscript run PostScript."""
    (tmp_path / "a.png").write_bytes(
        b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n%%EndComments\nshowpage\n%%EOF\n"
    )
    with pytest.raises(UnreadableFile, match="no readable image"):
        read_texture(tmp_path / "a.png")


def test_an_image_that_unpacks_to_gigabytes(tmp_path):
    """A kilobyte that says it is 60,000 texels wide and high."""
    rows = zlib.compress(bytes(1000))
    chunks = ((b"IHDR", struct.pack(">IIBBBBB", 60_000, 60_000, 8, 0, 0, 0, 0)), (b"IDAT", rows), (b"IEND", b""))
    blocks = [struct.pack(">I", len(d)) + k + d + struct.pack(">I", zlib.crc32(k + d)) for k, d in chunks]
    (tmp_path / "bomb.png").write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(blocks))
    with pytest.raises(UnreadableFile, match=r"bomb\.png has too many texels"):
        read_texture(tmp_path / "bomb.png")
    Image.new("L", (20, 10)).save(tmp_path / "a.png")
    with pytest.raises(UnreadableFile, match="too many texels"):
        read_texture(tmp_path / "a.png", most=199)
    assert read_texture(tmp_path / "a.png", most=200).shape == (10, 20, 4)


def test_a_damaged_tiff_has_nothing_to_say_on_the_standard_error(tmp_path, capfd):
    """libtiff writes to it by itself."""
    Image.fromarray(RNG.integers(0, 256, (40, 40, 3)).astype(np.uint8)).save(tmp_path / "a.tif", compression="tiff_lzw")
    data = bytearray((tmp_path / "a.tif").read_bytes())
    for at in range(60, len(data), 97):
        (tmp_path / "a.tif").write_bytes(data[:at] + b"\xff\xff\xff" + data[at + 3 :])
        try:
            read_texture(tmp_path / "a.tif")
        except UnreadableFile:
            pass
    os.write(2, b"afterwards it is heard again\n")
    assert capfd.readouterr().err == "afterwards it is heard again\n"


def test_a_tiff_of_thousands_of_samples_a_texel_has_nothing_to_log(tmp_path):
    """Pillow says by `logging` what it thinks of it, which without a handler goes to the standard error."""
    Image.new("RGB", (6, 6)).save(tmp_path / "a.tif")
    data = bytearray((tmp_path / "a.tif").read_bytes())
    # SamplesPerPixel: a tag, a type and a count, then the number.
    at = data.index(struct.pack("<HHI", 277, 3, 1))
    data[at + 8 : at + 10] = struct.pack("<H", 13_360)
    (tmp_path / "a.tif").write_bytes(data)
    program = "from pathlib import Path\nfrom hierarchy.texture import read_texture\nread_texture(Path('a.tif'))"
    path = str(Path(__file__).parents[2])
    ended = subprocess.run(
        [sys.executable, "-c", program],
        check=False,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
    )
    assert b"is no readable image" in ended.stderr
    assert b"samples" not in ended.stderr


def test_an_image_of_no_texel(tmp_path):
    (tmp_path / "a.gif").write_bytes(b"GIF89a" + bytes(7) + b",\0\0\0\0\0\0\0\0\0\2\0;")
    with pytest.raises(UnreadableFile, match="no readable image"):
        read_texture(tmp_path / "a.gif")


def test_a_large_image_is_read_in_bands(tmp_path, monkeypatch):
    monkeypatch.setattr("hierarchy.texture.BAND", 3 * 8)
    Image.fromarray(TEXTURE).save(tmp_path / "a.png")
    np.testing.assert_array_equal(read_texture(tmp_path / "a.png"), TEXTURE)


def test_a_quad_shows_its_texture(tmp_path):
    # A smooth gradient: the colour at a vertex is known from where it is.
    x, y = np.meshgrid((np.arange(128) + 0.5) / 128, 1 - (np.arange(64) + 0.5) / 64)
    Image.fromarray(np.stack([255 * x, 255 * y, 0 * x], -1).round().astype(np.uint8)).save(tmp_path / "skin.png")
    (tmp_path / "quad.obj").write_text(QUAD)
    mesh = load_model(tmp_path / "quad.obj", texture=tmp_path / "skin.png")
    place = in_file_space(mesh, mesh.positions)
    inner = (np.abs(mesh.scale * mesh.positions) < [1.9, 0.9, 1]).all(axis=1)
    np.testing.assert_allclose(mesh.colors[inner, 0], 255 * place[inner, 0] / 4, atol=1.5)
    np.testing.assert_allclose(mesh.colors[inner, 1], 255 * place[inner, 1] / 2, atol=1.5)
    # 32 texels a unit both ways.
    edges = np.linalg.norm(mesh.positions[mesh.faces] - mesh.positions[np.roll(mesh.faces, -1, axis=1)], axis=2)
    assert 0.3 * TEXELS_PER_EDGE < mesh.scale * edges.max() * 32 <= TEXELS_PER_EDGE
    np.testing.assert_array_equal(mesh.normals, np.tile(np.float32([0, 0, 1]), (len(mesh.normals), 1)))


def test_the_texture_that_the_material_names(tmp_path):
    Image.new("RGB", (4, 4), (10, 200, 30)).save(tmp_path / "my skin.png")
    (tmp_path / "quad.mtl").write_text("newmtl m\nmap_Kd my skin.png\n")
    (tmp_path / "quad.obj").write_text("mtllib quad.mtl\nusemtl m\n" + QUAD)
    mesh = load_model(tmp_path / "quad.obj")
    assert np.unique(mesh.colors, axis=0).tolist() == [[10, 200, 30, 255]]
    Image.new("RGB", (4, 4), (1, 2, 3)).save(tmp_path / "other.png")
    assert load_model(tmp_path / "quad.obj", texture=tmp_path / "other.png").colors[0].tolist() == [1, 2, 3, 255]


def test_a_texture_that_is_missing_damaged_foreign_or_of_no_use(tmp_path):
    inner = tmp_path / "inner"
    inner.mkdir()
    Image.new("RGB", (4, 4)).save(tmp_path / "secret.png")
    (inner / "bad.png").write_text("no image")
    outside = "is not in the model's folder"
    for name, reason in (("none.png", outside), ("../secret.png", outside), ("bad.png", "cannot be read")):
        (inner / "quad.mtl").write_text(f"newmtl m\nmap_Kd {name}\n")
        (inner / "quad.obj").write_text("mtllib quad.mtl\nusemtl m\n" + QUAD)
        mesh = load_model(inner / "quad.obj")
        assert mesh.colors is None
        assert mesh.warnings == (f"the texture {name} {reason}",)
    with pytest.raises(ModelError, match=r"^quad\.obj: the texture bad\.png is no readable image$"):
        load_model(inner / "quad.obj", texture=inner / "bad.png")
    (inner / "plain.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    mesh = load_model(inner / "plain.obj", texture=tmp_path / "secret.png")
    assert mesh.warnings == ("the texture is not used: the model has no texture coordinates",)


def test_a_huge_texture_stops_at_the_bound_and_parts_without_one_keep_their_colours():
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5], [6, 5, 5], [5, 6, 5]], np.float32)
    faces = np.array([[0, 1, 2], [3, 4, 5]], np.int32)
    normals = np.tile(np.float32([0, 0, 1]), (6, 1))
    colors = np.full((6, 4), 9, np.uint8)
    texels = np.array([[0, 0], [4e4, 0], [0, 4e4], [0, 0], [0, 0], [0, 0]])
    numbers = np.array([0, 0, 0, -1, -1, -1], np.int32)
    texture = np.full((1000, 1000, 4), 77, np.uint8)
    texture[::7] = 78
    p, f, n, c = paint(positions, faces, normals, colors, [texture], numbers, texels)
    assert 0.5 * MOST_FACES < len(f) <= MOST_FACES
    plain = p[:, 0] > 2
    assert plain.sum() == 3
    assert np.unique(c[plain]).tolist() == [9]
    assert np.unique(c[~plain]).tolist() == [77, 78]
    assert len(n) == len(c) == len(p)


def test_a_real_cow(shared_models):
    mesh = load_model(shared_models / "spot.obj", texture=shared_models / "spot_texture.png")
    assert mesh.closed
    assert mesh.warnings == ()
    assert 200_000 < len(mesh.faces) < MOST_FACES
    # Colours do not break at the seams: vertices at one place have nearly one colour.
    order = np.lexsort(mesh.positions.T)
    same = (np.diff(mesh.positions[order], axis=0) == 0).all(axis=1)
    jumps = np.abs(np.diff(mesh.colors[order].astype(int), axis=0)).max(axis=1)[same]
    assert len(jumps) > 1000
    assert np.percentile(jumps, 99) < 30


@pytest.mark.parametrize("coordinate", ["1e38", "-1e300", "1.7e308", "inf", "1e6"])
def test_texture_coordinates_beyond_all_texels_do_not_make_a_million_needles(tmp_path, coordinate):
    """A texture of 6 x 6 texels that repeats without end is worth no splitting."""
    Image.fromarray(RNG.integers(0, 256, (6, 6, 3)).astype(np.uint8)).save(tmp_path / "a.png")
    (tmp_path / "a.obj").write_text(QUAD.replace("vt 0 1", f"vt {coordinate} 1"))
    mesh = load_model(tmp_path / "a.obj", texture=tmp_path / "a.png")
    assert len(mesh.faces) <= FACES_FOR_ANY + 72


def test_a_texture_of_one_colour_splits_nothing(tmp_path):
    Image.new("RGB", (2000, 2000), (10, 20, 30)).save(tmp_path / "a.png")
    (tmp_path / "a.obj").write_text(QUAD)
    mesh = load_model(tmp_path / "a.obj", texture=tmp_path / "a.png")
    assert len(mesh.faces) == 2
    assert (mesh.colors[:, :3] == [10, 20, 30]).all()


def test_a_strip_of_a_texture_does_not_make_a_million_needles(tmp_path):
    Image.fromarray(RNG.integers(0, 256, (50_000, 2, 3)).astype(np.uint8)).save(tmp_path / "a.png")
    (tmp_path / "a.obj").write_text(QUAD)
    assert len(load_model(tmp_path / "a.obj", texture=tmp_path / "a.png").faces) <= FACES_FOR_ANY + 200


def test_a_large_blank_texture_with_a_dot_is_worth_the_dot():
    texture = np.zeros((1000, 3000, 4), np.uint8)
    assert varied_texels(texture) == 0
    texture[999, 2999] = 1
    assert varied_texels(texture) == (1000 % 64) * (3000 % 64)
    texture[10, 10, 3] = 1
    assert varied_texels(texture) == (1000 % 64) * (3000 % 64) + 64 * 64
    assert varied_texels(RNG.integers(0, 256, (100, 70, 4)).astype(np.uint8)) == 7000


def test_twenty_thousand_textures_take_as_long_as_one(tmp_path):
    """Each vertex was asked for each texture whether it is on it."""
    textures = [np.full((2, 2, 4), k % 250, np.uint8) for k in range(20_000)]
    positions = np.tile(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32), (20_000, 1))
    faces = np.arange(60_000, dtype=np.int32).reshape(-1, 3)
    numbers = np.repeat(np.arange(20_000, dtype=np.int32), 3)
    face = np.array([[0, 1, 2]])
    parts = [Part(p, face, texture_coordinates=p[:, :2], texture=t)
             for p, t in zip(positions.reshape(-1, 3, 3), textures, strict=True)]  # fmt: skip
    start = time.process_time()
    assert len(gather_skin(parts).textures) == 20_000
    _, _, _, colors = paint(positions, faces, np.ones_like(positions), None, textures, numbers, np.zeros((60_000, 2)))
    assert time.process_time() - start < 8.0
    np.testing.assert_array_equal(colors[:, 0], numbers % 250)
