"""Tiles in the cache: pictures are the same with and without, and what is damaged is as good as absent."""

import errno
import os
import shutil
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from app import render_command, scene
from app.cache import Cache
from app.cache_folder import cached_files, clear
from app.options import CameraOptions, Options
from app.progress import Reporter
from app.render_command import draw_scene
from app.scene import ModelSource, Scene, open_scene
from app.viewer import Viewer
from app.viewport import Viewport
from hierarchy import atomic_file, tile_store
from hierarchy.meteoroid import make_meteoroid
from hierarchy.normal_tiles import TileBaker
from renderer.context import ContextError, create_headless_context

NEAR, ASIDE = CameraOptions(position=(0.0, 0.0, 4.0)), CameraOptions(position=(2.0, 5.0, 3.0))


@pytest.fixture(autouse=True)
def everything_is_worth_keeping(monkeypatch):
    monkeypatch.setattr(scene, "WORTH_KEEPING", -1.0)


@pytest.fixture(autouse=True, scope="module")
def _needs_a_context():
    try:
        create_headless_context().release()
    except ContextError as error:
        pytest.skip(str(error))


@pytest.fixture
def said():
    return []


@pytest.fixture
def cache(cache_folder, said):
    return Cache(cache_folder, said.append)


def write_model(path: Path, kind: str) -> Path:
    """Write a meteoroid, some of them with colours in patches, as text."""
    mesh = make_meteoroid(4_000)
    header = ["ply", "format ascii 1.0", f"element vertex {len(mesh.positions)}"]
    header += [f"property float {name}" for name in ("x", "y", "z")]
    lines = [" ".join(f"{value:.6f}" for value in position) for position in mesh.positions]
    if kind == "coloured":
        header += [f"property uchar {name}" for name in ("red", "green", "blue")]
        colors = (127.0 * (1.0 + np.sin(9.0 * mesh.positions))).astype(np.uint8)
        lines = [f"{line} {' '.join(map(str, color))}" for line, color in zip(lines, colors, strict=True)]
    header += [f"element face {len(mesh.faces)}", "property list uchar int vertex_indices", "end_header"]
    faces = [f"3 {a} {b} {c}" for a, b, c in mesh.faces]
    path.write_text("\n".join([*header, *lines, *faces, ""]))
    return path


@pytest.fixture(scope="module")
def models(tmp_path_factory):
    folder = tmp_path_factory.mktemp("models")
    return {kind: write_model(folder / f"{kind}.ply", kind) for kind in ("plain", "coloured")}


@pytest.fixture
def model(models):
    return models["plain"]


@dataclass(frozen=True)
class Drawn:
    """A picture's bytes, and how many tiles it has and how many of them are from the cache."""

    picture: bytes
    tiles: int
    cached: int


def draw(model: Path, cache: Cache | None, camera: CameraOptions = NEAR, **options) -> Drawn:
    """Do what `surfelscope render` does."""
    output = model.parent / "picture.png"
    points = options.get("points", False)
    options = Options(model=model, outputs=(output,), resolution=(160, 120), camera=camera, **options)
    opened = open_scene(ModelSource(model, points=points), cache=cache)
    statistics, unkept = draw_scene(opened, options, Reporter(verbose=False), cache)
    render_command._keep(opened, unkept, cache)
    return Drawn(output.read_bytes(), statistics["tiles"], statistics["tiles_cached"])


def tile_files(cache: Cache) -> list[Path]:
    return sorted(file.path for file in cached_files(cache.folder) if ".tiles" in file.path.name)


def inodes(cache: Cache) -> list[int]:
    return [path.stat().st_ino for path in tile_files(cache)]


@pytest.mark.parametrize(("kind", "options"), [("plain", {}), ("coloured", {}), ("coloured", {"points": True})])
def test_picture_is_the_same_to_the_last_byte_whatever_tiles_were_kept(models, cache, kind, options):
    cold = draw(models[kind], None, **options)
    assert cold.tiles > 100
    first = draw(models[kind], cache, **options)
    assert first == cold
    again = draw(models[kind], cache, **options)
    assert (again.picture, again.tiles, again.cached) == (cold.picture, cold.tiles, cold.tiles)
    # From another side, and from so near that some tiles may have more texels.
    for camera in (ASIDE, CameraOptions(position=(0.0, 0.0, 2.5))):
        expected = draw(models[kind], None, camera, **options)
        mixed = draw(models[kind], cache, camera, **options)
        assert mixed.picture == expected.picture != cold.picture
        assert mixed.tiles == expected.tiles
        assert mixed.cached < mixed.tiles
    back = draw(models[kind], cache, **options)
    assert (back.picture, back.tiles) == (cold.picture, cold.tiles)


def test_second_start_bakes_nothing_and_writes_nothing(model, cache, monkeypatch):
    draw(model, cache)
    before = inodes(cache)
    assert len(before) == 1
    monkeypatch.setattr(TileBaker, "fitted", None)
    draw(model, cache)
    assert inodes(cache) == before


def test_tiles_of_another_view_take_the_place_of_the_last_ones(model, cache):
    draw(model, cache)
    before = inodes(cache)
    moved = draw(model, cache, ASIDE)
    assert 0 < moved.cached < moved.tiles
    assert len(inodes(cache)) == 1
    assert inodes(cache) != before
    assert draw(model, cache, ASIDE).cached == moved.tiles


def test_tiles_of_every_size_have_a_file_of_their_own(model, cache):
    draw(model, cache)
    assert draw(model, cache, texels=8).cached == 0
    assert [path.name.split(".")[1] for path in tile_files(cache)] == ["tiles16", "tiles8"]
    assert draw(model, cache).cached > 0


def test_nothing_is_looked_for_or_kept_where_nobody_asks(model, cache):
    draw(model, cache, normal_mapping=False)
    assert tile_files(cache) == []
    draw(model, cache)
    assert draw(model, None).cached == 0
    assert draw(model, cache, normal_mapping=False).cached == 0


def test_model_that_is_not_in_the_cache_leaves_no_tiles_there(model, cache, monkeypatch):
    monkeypatch.setattr(scene, "WORTH_KEEPING", 1e9)
    draw(model, cache)
    assert not cache.folder.exists()


def test_cache_that_is_cleared_meanwhile_stays_empty(model, cache, monkeypatch):
    draw(model, cache)
    keep = render_command.keep_tiles
    monkeypatch.setattr(render_command, "keep_tiles", lambda *arguments: (clear(cache.folder), keep(*arguments)))
    draw(model, cache, ASIDE)
    assert not cache.folder.exists()


def test_tiles_count_and_go_with_the_rest_but_are_no_models(model, cache):
    draw(model, cache)
    files = cached_files(cache.folder)
    assert sum(file.is_model for file in files) == 1
    assert sum(file.path.suffix == ".safetensors" for file in files) == 2
    clear(cache.folder)
    assert not cache.folder.exists()


def test_tiles_never_push_out_the_hierarchy_that_they_are_of(model, cache, said):
    draw(model, cache)
    (hierarchy,) = (file.path for file in cached_files(cache.folder) if file.is_model)
    tiles = tile_files(cache)[0]
    # Last used long ago.
    os.utime(hierarchy, (5, 5))
    size = tiles.stat().st_size
    # Room for the tiles, if all the rest goes.
    narrow = Cache(cache.folder, said.append, hierarchy.stat().st_size + 100)
    draw(model, narrow, ASIDE)
    assert hierarchy.exists()
    assert "too many for it" in said[-1]
    # The older ones make room for the new ones.
    for file in cached_files(cache.folder):
        os.utime(file.path, (5, 5))
    draw(model, Cache(cache.folder, said.append, hierarchy.stat().st_size + 2 * size), ASIDE)
    assert hierarchy.exists()
    assert said[-1].startswith("cache: kept")


def test_use_counts_and_tiles_go_before_their_hierarchy(model, cache):
    """Without the hierarchy tiles would be for nothing."""
    draw(model, cache)
    (tiles,) = tile_files(cache)
    for camera in (NEAR, ASIDE):
        for file in cached_files(cache.folder):
            os.utime(file.path, (5, 5))
        draw(model, cache, camera)
        # As by a clock that stands still.
        assert cache.path_of(tiles.name.split(".")[0]).stat().st_mtime >= tiles.stat().st_mtime > 100
        for file in cached_files(cache.folder):
            os.utime(file.path, (5, 5))
        order = [file.path for file in cached_files(cache.folder) if file.path.suffix == ".safetensors"]
        assert order[0] == tiles


# Faults.


def other_version(tiles: Path, opened: Scene) -> None:
    kept = tile_store.load_tiles(tiles, opened.hierarchy, 16, opened.provenance.entry)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tile_store, "FORMAT", "surfelscope tiles 0")
        tile_store.save_tiles(tiles, kept, opened.hierarchy, opened.provenance.entry)


def other_hierarchy(tiles: Path, opened: Scene) -> None:
    kept = tile_store.load_tiles(tiles, opened.hierarchy, 16, opened.provenance.entry)
    tile_store.save_tiles(tiles, kept, opened.hierarchy, "1-another-model")


def other_texels(tiles: Path, opened: Scene) -> None:
    shutil.copy(tiles.with_name(tiles.name.replace("tiles16", "tiles8")), tiles)


def hierarchy_instead(tiles: Path, opened: Scene) -> None:
    shutil.copy(tiles.with_name(f"{opened.provenance.entry}.safetensors"), tiles)


def put(make):
    """Return what puts something in the place of a file."""

    def replace(tiles: Path, _opened: Scene) -> None:
        tiles.unlink()
        make(tiles)

    return replace


FAULTS = {
    "cut off": lambda tiles, _: tiles.write_bytes(tiles.read_bytes()[:-1]),
    "cut off in its header": lambda tiles, _: tiles.write_bytes(tiles.read_bytes()[:100]),
    "empty": lambda tiles, _: tiles.write_bytes(b""),
    "bit flipped": lambda tiles, _: tiles.write_bytes(tiles.read_bytes()[:-9] + b"\xff" + tiles.read_bytes()[-8:]),
    "text": lambda tiles, _: tiles.write_text("not a cache"),
    "another version": other_version,
    "another hierarchy's": other_hierarchy,
    "other texels": other_texels,
    "hierarchy": hierarchy_instead,
    "pipe": put(os.mkfifo),
    "link to itself": put(lambda path: path.symlink_to(path)),
    "folder": put(Path.mkdir),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_damaged_tiles_are_baked_and_replaced(model, cache, said, fault):
    cold = draw(model, cache)
    draw(model, cache, texels=8)
    tiles = next(path for path in tile_files(cache) if "tiles16" in path.name)
    FAULTS[fault](tiles, open_scene(ModelSource(model), cache=cache))
    said.clear()
    assert draw(model, cache) == cold
    assert sum("is not used" in what for what in said) == 1
    assert not any("\n" in what for what in said)
    mended = draw(model, cache)
    assert mended.picture == cold.picture
    # Only its owner knows what a folder is for.
    assert mended.cached == (0 if fault == "folder" else cold.tiles)


def test_disk_that_is_full_leaves_the_last_tiles_there(model, cache, said, monkeypatch):
    draw(model, cache)
    (tiles,) = tile_files(cache)
    good = tiles.read_bytes()
    create = atomic_file._create

    def fail(part, mode):
        if part.parent != cache.folder:
            return create(part, mode)
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(atomic_file, "_create", fail)
        moved = draw(model, cache, ASIDE)
    assert moved.picture == draw(model, None, ASIDE).picture
    assert said[-1] == f"cache: tiles are not kept: {os.strerror(errno.ENOSPC)}"
    assert tiles.read_bytes() == good
    assert sorted(path.suffix for path in cache.folder.iterdir()) == [".known", ".safetensors", ".safetensors"]


def test_file_that_may_not_be_read_is_as_good_as_absent(model, cache, said, monkeypatch):
    cold = draw(model, cache)
    (tiles,) = tile_files(cache)

    def refuse(path):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    with monkeypatch.context() as patch:
        patch.setattr(tile_store, "map_tensors", refuse)
        assert draw(model, cache) == cold
    assert f"cache: {tiles.name} is not used: {os.strerror(errno.EACCES)}" in said


def test_window_draws_its_first_picture_with_what_it_kept_the_last_time(model, cache):
    """The viewport and the viewer of two starts, one after the other."""
    missing, pictures = ([], []), []
    for start in range(2):
        with create_headless_context() as ctx:
            viewport = Viewport(ctx, lambda: None, cache=cache)
            viewport.size = (160, 120)
            viewer = Viewer(Options(model=model), lambda: None, viewport.upload, cache)
            end = time.monotonic() + 60.0
            while viewer.scene is None or viewport.is_stale(viewer) or viewport.is_baking:
                assert time.monotonic() < end
                viewer.poll(viewport.size)
                if viewport.is_stale(viewer):
                    report = viewport.draw(viewer)
                    missing[start].append(report.missing)
                    viewer.drawn(report)
                    unkept = viewport.take_unkept()
                    if unkept is not None:
                        viewer.keep_tiles(unkept)
                time.sleep(0.01)
            pictures.append(viewport.picture())
            viewer.close()
            viewport.release()
        ctx.release()
    assert missing[0][0] > 0
    assert set(missing[1]) == {0}
    assert len(tile_files(cache)) == 1
    assert np.array_equal(*pictures)
