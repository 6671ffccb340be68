"""The cache: what is found again, what is not, and what is never believed."""

import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app import cache_folder as folder_module
from app import inputs, scene
from app.cache import Cache
from app.cache_folder import cached_files, clear, make_room, user_cache_folder
from app.known_digests import KnownDigests
from app.scene import ModelSource, Scene, keep_scene, open_scene
from hierarchy import file_state
from hierarchy.model import Cancelled

ROOT = Path(__file__).parents[2]

OBJ = "mtllib a.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\n"
OBJ += "f 1/1 3/3 2/2\nf 1/1 2/2 4/3\nf 2/1 3/2 4/3\nf 3/1 1/2 4/3\n"


@pytest.fixture(autouse=True)
def everything_is_worth_keeping(monkeypatch):
    monkeypatch.setattr(scene, "WORTH_KEEPING", -1.0)


@pytest.fixture
def said():
    return []


@pytest.fixture
def cache(cache_folder, said):
    return Cache(cache_folder, said.append)


@pytest.fixture
def model(torus, tmp_path):
    """A file that may be changed."""
    return Path(shutil.copy(torus, tmp_path / "model.ply"))


@pytest.fixture(autouse=True)
def nothing_is_fresh(monkeypatch):
    """Have files count as old that the tests have just written."""
    monkeypatch.setattr(file_state, "FRESH", -(10**18))


def opened(path: Path | None, cache: Cache, **keywords) -> Scene:
    return open_scene(ModelSource(path, **keywords), cache=cache)


def kept(path: Path, cache: Cache, **keywords) -> Scene:
    built = open_scene(ModelSource(path, **keywords), cache=cache)
    keep_scene(built, cache)
    return built


def was_found(found: Scene) -> bool:
    return found.provenance.inputs is None


def no_digest(_path):
    raise AssertionError("a file was read to see whether it has changed")


def write_obj(folder: Path, color: int) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / "a.mtl").write_text("newmtl m\nmap_Kd t.png\n")
    Image.new("RGB", (4, 4), (color, 0, 0)).save(folder / "t.png")
    (folder / "a.obj").write_text(OBJ)
    return folder / "a.obj"


def test_second_start_neither_reads_nor_builds_and_gives_the_same(model, cache, monkeypatch):
    built = kept(model, cache)
    monkeypatch.setattr(scene, "_load", no_digest)
    monkeypatch.setattr("app.known_digests.digest_of", no_digest)
    found = opened(model, cache)
    assert was_found(found)
    assert found.content == built.content
    assert found.hierarchy.name == "model.ply"
    assert np.array_equal(found.hierarchy.nodes, built.hierarchy.nodes)
    assert found.build_s == 0.0


def test_what_was_found_is_not_written_again(model, cache, said):
    kept(model, cache)
    before = {file.path: file.path.stat().st_ino for file in cached_files(cache.folder)}
    keep_scene(opened(model, cache), cache)
    assert {file.path: file.path.stat().st_ino for file in cached_files(cache.folder)} == before


def test_what_is_built_in_no_time_is_not_kept(model, cache, monkeypatch):
    monkeypatch.setattr(scene, "WORTH_KEEPING", 1e9)
    kept(model, cache)
    assert not cache.folder.exists()


def test_other_content_other_entry(model, cache, write_torus):
    kept(model, cache)
    write_torus(model, bumps=0.05)
    assert not was_found(opened(model, cache))


@pytest.mark.parametrize("keywords", [{"points": True}, {"texture": True}])
def test_other_options_other_entry(model, cache, keywords, tmp_path):
    kept(model, cache)
    if "texture" in keywords:
        keywords = {"texture": tmp_path / "t.png"}
        Image.new("RGB", (4, 4)).save(tmp_path / "t.png")
    assert not was_found(opened(model, cache, **keywords))
    kept(model, cache, **keywords)
    assert was_found(opened(model, cache, **keywords))


def test_other_program_other_entry(model, cache, monkeypatch):
    kept(model, cache)
    monkeypatch.setattr(inputs, "program", lambda: "another version")
    assert not was_found(opened(model, cache))


def test_program_is_known_by_its_code():
    assert len(inputs.program()) > 64


def test_copy_and_touched_file_are_found_by_their_content(model, cache, tmp_path):
    kept(model, cache)
    copy = tmp_path / "copy.ply"
    shutil.copy(model, copy)
    found = opened(copy, cache)
    assert was_found(found)
    assert found.hierarchy.name == "copy.ply"
    os.utime(model)
    assert was_found(opened(model, cache))


def test_same_size_and_times_but_other_content_is_noticed(model, cache):
    kept(model, cache)
    before = model.stat()
    data = bytearray(model.read_bytes())
    data[-3] ^= 1
    model.write_bytes(data)
    os.utime(model, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert not was_found(opened(model, cache))


def test_file_of_another_length_is_not_even_read(model, cache, monkeypatch, tmp_path, write_torus):
    kept(model, cache)
    other = write_torus(tmp_path / "other.ply", rings=12)
    monkeypatch.setattr("app.known_digests.digest_of", no_digest)
    assert not was_found(opened(other, cache))


def test_texture_that_changes_is_part_of_the_model(cache, tmp_path):
    path = write_obj(tmp_path / "a", 10)
    built = kept(path, cache)
    assert was_found(opened(path, cache))
    write_obj(tmp_path / "a", 200)
    changed = opened(path, cache)
    assert not was_found(changed)
    assert not np.array_equal(changed.hierarchy.leaves.colors, built.hierarchy.leaves.colors)


@pytest.mark.parametrize("name", ["a.mtl", "t.png"])
def test_file_that_was_missing_and_turns_up_is_noticed(cache, tmp_path, name):
    path = write_obj(tmp_path / "a", 10)
    content = (tmp_path / "a" / name).read_bytes()
    (tmp_path / "a" / name).unlink()
    kept(path, cache)
    found = opened(path, cache)
    assert was_found(found)
    assert found.hierarchy.warnings
    (tmp_path / "a" / name).write_bytes(content)
    assert not was_found(opened(path, cache))


def test_same_model_with_other_textures_in_two_folders_does_not_push_itself_out(cache, tmp_path):
    red, black = write_obj(tmp_path / "a", 255), write_obj(tmp_path / "b", 0)
    kept(red, cache)
    kept(black, cache)
    assert opened(red, cache).hierarchy.leaves.colors[0, 0] == 255
    assert opened(black, cache).hierarchy.leaves.colors[0, 0] == 0
    assert was_found(opened(red, cache))


def test_buffer_that_a_child_process_read_is_part_of_the_model(cache, tmp_path):
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")
    (tmp_path / "b.bin").write_bytes(positions.tobytes())
    gltf = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "buffers": [{"uri": "b.bin", "byteLength": 36}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}
        ],
    }
    path = tmp_path / "a.gltf"
    path.write_text(json.dumps(gltf))
    kept(path, cache)
    assert was_found(opened(path, cache))
    (tmp_path / "b.bin").write_bytes((2.0 * positions).astype("<f4").tobytes())
    assert not was_found(opened(path, cache))


def test_file_that_changes_while_it_loads_is_not_kept(model, cache, said, monkeypatch, write_torus, tmp_path):
    load = scene._load
    before = model.stat()

    def load_then_change(source, progress):
        loaded = load(source, progress)
        data = bytearray(model.read_bytes())
        data[-3] ^= 1
        model.write_bytes(data)
        os.utime(model, ns=(before.st_atime_ns, before.st_mtime_ns))
        return loaded

    monkeypatch.setattr(scene, "_load", load_then_change)
    kept(model, cache)
    assert cached_files(cache.folder) == []
    assert "changed while it was read" in said[-1]


def test_fresh_file_is_compared_by_content_not_by_times(model, cache, monkeypatch):
    """Within one step of the file system's clock a file may change without its times changing."""
    monkeypatch.setattr(file_state, "FRESH", 10**18)
    kept(model, cache)
    assert was_found(opened(model, cache))
    read = []
    digest = file_state.digest_of
    monkeypatch.setattr("app.known_digests.digest_of", lambda path: read.append(path) or digest(path))
    opened(model, cache)
    assert read == [model]


def test_file_that_changes_within_one_tick_of_the_clock_is_not_kept(model, monkeypatch):
    monkeypatch.setattr(file_state, "FRESH", 10**18)
    seen = file_state.see(model)
    data = bytearray(model.read_bytes())
    data[-3] ^= 1
    model.write_bytes(data)
    monkeypatch.setattr(file_state, "state_of", lambda path: seen.state)
    assert file_state.digest_of_seen(seen) is None


def test_built_in_model_is_kept(cache, monkeypatch):
    from hierarchy.meteoroid import make_meteoroid

    monkeypatch.setattr(scene, "_load", lambda source, progress: make_meteoroid(500))
    built = opened(None, cache)
    keep_scene(built, cache)
    found = opened(None, cache)
    assert was_found(found)
    assert found.hierarchy.name == built.hierarchy.name


def test_damaged_entry_is_built_anew_and_replaced(model, cache, said):
    kept(model, cache)
    (entry,) = (file.path for file in cached_files(cache.folder) if file.is_model)
    entry.write_bytes(entry.read_bytes()[:-1])
    rebuilt = opened(model, cache)
    assert not was_found(rebuilt)
    assert any("is not used" in what for what in said)
    keep_scene(rebuilt, cache)
    assert was_found(opened(model, cache))


def test_notes_of_another_version_are_not_believed(model, cache):
    built = opened(model, cache)
    entry, notes = cache.entry(built.source, built.provenance.inputs)
    cache.keep(entry, built.hierarchy, {**notes, "content": '{"kind": "mesh"}'}, lambda fraction: None)
    assert not was_found(opened(model, cache))


def test_damaged_digests_are_forgotten(model, cache):
    kept(model, cache)
    (known,) = cache.folder.glob("*.known")
    good = known.read_bytes()
    for place in range(0, len(good), 7):
        known.write_bytes(good[:place] + bytes([good[place] ^ 1]) + good[place + 1 :])
        assert KnownDigests(cache.folder, model)._states == {}
    for text in (b"", b"[]\n" + b"0" * 64, b"\xff" * 10):
        known.write_bytes(text)
        assert was_found(opened(model, cache))


def test_least_recently_used_goes_first(cache_folder, said):
    cache_folder.mkdir()
    names = [f"{i:x}-{'0' * 32}-{'0' * 16}-{'0' * 12}.safetensors" for i in range(5)]
    for age, name in enumerate(names):
        (cache_folder / name).write_bytes(b"x" * 100)
        os.utime(cache_folder / name, (1000 - age, 1000 - age))
    (cache_folder / "of-the-user.safetensors").write_bytes(b"x" * 10_000)
    assert make_room(cache_folder, 100, 350)
    assert [file.path.name for file in cached_files(cache_folder)] == [names[1], names[0]]
    assert not make_room(cache_folder, 400, 350)
    assert len(cached_files(cache_folder)) == 2


def test_there_are_never_more_files_than_are_looked_through(cache_folder, monkeypatch):
    monkeypatch.setattr(folder_module, "MOST_FILES", 3)
    cache_folder.mkdir()
    for i in range(5):
        (cache_folder / f"{i:x}-{'0' * 32}-{'0' * 16}-{'0' * 12}.safetensors").write_bytes(b"x")
    assert make_room(cache_folder, 1, 10**9)
    assert len(cached_files(cache_folder)) == 2


def test_model_larger_than_the_cache_is_not_kept_and_pushes_nothing_out(model, cache_folder, said):
    kept(model, Cache(cache_folder))
    before = cached_files(cache_folder)
    keep_scene(opened(model, Cache(cache_folder, most_bytes=1000), points=True), Cache(cache_folder, said.append, 1000))
    assert "too many for it" in said[-1]
    assert {file.path for file in before} == {file.path for file in cached_files(cache_folder)}


def test_use_counts(model, cache):
    kept(model, cache)
    (entry,) = (file.path for file in cached_files(cache.folder) if file.is_model)
    os.utime(entry, (5, 5))
    opened(model, cache)
    assert entry.stat().st_mtime > time.time() - 100


def test_clearing_removes_what_the_cache_wrote_and_nothing_else(model, cache):
    kept(model, cache)
    (cache.folder / "mine.txt").write_text("keep")
    (cache.folder / ".mine.0123456789ab.part").write_text("left by somebody killed")
    assert clear(cache.folder)[0] == 2
    assert [path.name for path in cache.folder.iterdir()] == ["mine.txt"]
    (cache.folder / "mine.txt").unlink()
    kept(model, cache)
    clear(cache.folder)
    assert not cache.folder.exists()


def test_cancelled_keeping_leaves_nothing(model, cache):
    built = opened(model, cache)

    def cancel(_fraction):
        raise Cancelled

    with pytest.raises(Cancelled):
        keep_scene(built, cache, cancel)
    assert not [path for path in cache.folder.iterdir() if path.suffix != ".known"]


def test_mapped_scene_outlives_its_entry(model, cache):
    built = kept(model, cache)
    found = opened(model, cache)
    clear(cache.folder)
    assert np.array_equal(found.hierarchy.splats, built.hierarchy.splats)


def test_folder_that_the_environment_names_comes_first(monkeypatch, tmp_path):
    monkeypatch.setenv("SURFELSCOPE_CACHE", str(tmp_path))
    assert user_cache_folder() == tmp_path
    monkeypatch.setenv("SURFELSCOPE_CACHE", "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "user"))
    chosen = user_cache_folder()
    assert chosen is not None
    assert chosen.name.lower() == "surfelscope"
    if sys.platform.startswith("linux"):
        assert chosen == tmp_path / "user" / "surfelscope"


def run(*arguments):
    line = [sys.executable, "-m", "app.cli", *map(str, arguments)]
    done = subprocess.run(line, cwd=ROOT, capture_output=True, text=True, timeout=300, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def test_commands(torus, cache_folder):
    run("info", torus, "--no-cache")
    assert not cache_folder.exists()
    run("info", torus)
    assert f"{cache_folder}: 1 models" in run("cache")
    assert "removed" in run("cache", "--clear")
    assert f"{cache_folder}: 0 models, 0.0 MB" in run("cache")
    assert not cache_folder.exists()
