import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from hierarchy import load
from hierarchy.load import load_model
from hierarchy.model import Cancelled, Mesh, ModelError, PointCloud

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def reason(path, **options):
    """Load what cannot be loaded; return the reason behind the file's name, of one line."""
    with pytest.raises(ModelError) as caught:
        load_model(path, **options)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(f"{path.name}: ")
    return message.removeprefix(f"{path.name}: ")


def test_what_is_no_file(tmp_path):
    assert reason(tmp_path / "none.ply") == "no such file"
    assert reason(tmp_path) == "is a folder, not a file"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.ply")
    assert reason(tmp_path / "pipe.ply") == "is not a regular file"


@pytest.mark.parametrize("suffix", ["ply", "obj", "laz", "stl", "glb", "xyz", "unheard"])
def test_empty(tmp_path, suffix):
    path = tmp_path / f"a.{suffix}"
    path.touch()
    assert reason(path) == "the file is empty"


def test_no_permission(tmp_path, monkeypatch):
    path = tmp_path / "a.obj"
    path.write_text(TRIANGLE)

    # The tests may run as root, whom no permission stops.
    def refuse(path, warnings):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr("hierarchy.obj.read_obj", refuse)
    assert reason(path) == "no permission to read it"


@pytest.mark.parametrize("name", ["a.unheard", "a", "a.png", "a.blend"])
def test_unknown_kinds(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(b"some bytes of something else")
    assert reason(path).startswith("unknown kind of file")


@pytest.mark.parametrize(
    "suffix", ["obj", "stl", "off", "glb", "gltf", "3mf", "dae", "las", "laz", "ply", "xyz", "zip"]
)
def test_rubbish_of_every_kind_is_one_line(tmp_path, suffix):
    rng = np.random.default_rng(1)
    for content in (b"\n\n\n", b"rubbish\nand more\n", rng.integers(0, 256, 5000).astype(np.uint8).tobytes()):
        path = tmp_path / f"a.{suffix}"
        path.write_bytes(content)
        assert reason(path)


def test_the_content_says_more_than_the_name(tmp_path):
    path = tmp_path / "a.stl"
    header = "ply\nformat ascii 1.0\nelement vertex 3\n" + "".join(f"property float {axis}\n" for axis in "xyz")
    header += "element face 1\nproperty list uchar int vertex_index\nend_header\n"
    path.write_text(header + "0 0 0 1 0 0 0 1 0\n3 0 1 2\n")
    assert len(load_model(path).faces) == 1
    path = tmp_path / "A.OBJ"
    path.write_text(TRIANGLE)
    assert load_model(str(path)).name == "A.OBJ"


def test_a_name_that_no_terminal_should_obey(tmp_path):
    path = tmp_path / "a\n\x1b[2J\u202eb\udcff.obj"
    path.write_text(TRIANGLE + "mtllib \x1b[31mred.mtl\nusemtl a\nf 1 3 2\n")
    mesh = load_model(path)
    assert mesh.name == "a ?[2J?b?.obj"
    assert mesh.warnings[0] == "the material file ?[31mred.mtl is not in the model's folder"
    path.write_text("v 0 0 0\nv 1")
    with pytest.raises(ModelError, match=r"^a \?\[2J\?b\?\.obj: truncated: its last line is cut off$"):
        load_model(path)


def test_thousands_of_missing_files_are_a_few_warnings(tmp_path):
    path = tmp_path / "a.obj"
    (tmp_path / "a.mtl").write_text("".join(f"newmtl {k}\nmap_Kd {'x' * 500}{k}.png\n" for k in range(100)))
    faces = "".join(f"usemtl {k}\nf 1/1 2/1 3/1\n" for k in range(100))
    path.write_text("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n" + faces)
    warnings = load_model(path).warnings
    assert len(warnings) == 11
    assert warnings[-1] == "and 90 more like these"
    assert max(map(len, warnings)) <= 200


def test_textures_that_are_too_large_together(tmp_path, monkeypatch):
    monkeypatch.setattr("hierarchy.texture.MOST_TEXELS", 40)
    for k in range(3):
        Image.new("RGB", (4, 4), (255, 0, 0)).save(tmp_path / f"{k}.png")
    (tmp_path / "a.mtl").write_text("".join(f"newmtl {k}\nmap_Kd {k}.png\n" for k in range(3)))
    faces = "".join(f"usemtl {k}\nf 1/1 2/1 3/1\n" for k in range(3))
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n" + faces)
    assert load_model(tmp_path / "a.obj").warnings == ("the texture 2.png cannot be read",)


def test_counts_of_what_was_dropped(tmp_path):
    path = tmp_path / "a.obj"
    path.write_text(TRIANGLE + "v nan 0 0\nf 1 2 4\nf 1 2 9\nf 1 2 2\nf 2 1 1\n")
    assert load_model(path).warnings == (
        "dropped 1 face with indices out of range",
        "dropped 1 vertex whose positions are not finite",
        "dropped 1 face at positions that are not finite",
        "dropped 2 degenerate faces",
    )


@pytest.mark.parametrize(
    "text", ["v 0 0 0\nv 1 0 0\nf 1 2 9\n", "v nan 0 0\n", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "# only a comment\n"]
)
def test_nothing_to_draw(tmp_path, text):
    path = tmp_path / "a.obj"
    path.write_text(text)
    assert reason(path).startswith("nothing to draw: ")


def test_points(tmp_path):
    path = tmp_path / "a.xyz"
    np.savetxt(path, np.random.default_rng(1).random((40, 3)))
    cloud = load_model(path)
    assert isinstance(cloud, PointCloud)
    assert cloud.estimated_normals
    cloud = load_model(path, texture=tmp_path / "none.png")
    assert cloud.warnings == ("the texture is not used: the model has no faces",)


class PanicException(BaseException):
    """What a panic in Rust code looks like."""


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (PanicException("index out of bounds:\n 3"), "damaged, truncated or not an OBJ file"),
        (ValueError(), "damaged, truncated or not an OBJ file"),
        (RecursionError("too deep"), "damaged, truncated or not an OBJ file"),
        (MemoryError(), "not enough memory to load it"),
        (OSError(5, "Input/output error"), "cannot be read: Input/output error"),
        (ModuleNotFoundError("No module named 'x'", name="x"), "reading OBJ files needs the Python package x"),
    ],
)
def test_whatever_a_library_raises_is_one_line(tmp_path, monkeypatch, error, expected):
    path = tmp_path / "a.obj"
    path.write_text(TRIANGLE)

    def fail(path, warnings):
        raise error

    monkeypatch.setattr("hierarchy.obj.read_obj", fail)
    assert reason(path) == expected


@pytest.mark.parametrize("error", [KeyboardInterrupt, SystemExit, Cancelled, GeneratorExit])
def test_what_is_not_about_the_file_passes(tmp_path, error):
    path = tmp_path / "a.obj"
    path.write_text(TRIANGLE)

    def stop(stage, fraction):
        raise error

    with pytest.raises(error):
        load_model(path, progress=stop)


def test_progress_rises_to_one(tmp_path):
    path = tmp_path / "a.obj"
    path.write_text(TRIANGLE)
    seen = []
    load_model(path, progress=lambda stage, fraction: seen.append((stage, fraction)))
    fractions = [fraction for _, fraction in seen]
    assert fractions == sorted(fractions)
    assert seen[-1] == ("load", 1.0)


def test_importing_the_loader_costs_no_heavy_library():
    code = "import sys, hierarchy.load; print({'numba', 'scipy', 'trimesh', 'laspy', 'PIL'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True,
                          cwd=Path(load.__file__).parents[1])  # fmt: skip
    assert done.stdout.strip() == "set()"


@pytest.mark.parametrize(
    ("name", "faces", "closed", "warnings"),
    [
        ("igea.ply", 268_686, True, ()),
        ("rangemap.ply", 86_766, False, ()),
        ("fandisk.obj", 12_946, True, ()),
        ("spot.obj", 5_856, True, ()),
        ("stanford-bunny.obj", 69_451, False, ()),
    ],
)
def test_real_meshes(shared_models, name, faces, closed, warnings):
    mesh = load_model(shared_models / name)
    assert isinstance(mesh, Mesh)
    assert (len(mesh.faces), mesh.closed, mesh.warnings) == (faces, closed, warnings)
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-5)
    np.testing.assert_allclose(mesh.positions.min(axis=0) + mesh.positions.max(axis=0), 0.0, atol=1e-4)


def test_a_real_cloud(shared_models):
    cloud = load_model(shared_models / "lion.copc.laz")
    assert len(cloud.positions) == 275_855
    assert cloud.warnings == ("dropped 66134 duplicate points",)
    assert cloud.colors.shape == (275_855, 4)
    # Points lie on a grid of one centimetre.
    assert 0.005 < cloud.scale * np.median(cloud.radii) < 0.02
    assert cloud.scale * cloud.radii.max() < 0.1
