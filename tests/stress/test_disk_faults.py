"""Disks that are full, broken or forbidden: one line at most, nothing half-written, and what was good stays good."""

from __future__ import annotations

import errno
import os
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from cache_models import same, small_model
from PIL import Image

from app import scene
from app.cache import Cache
from app.cache_folder import cached_files
from app.errors import OutputError
from app.export import write_arrays, write_png
from app.scene import ModelSource, Scene, keep_scene, open_scene
from hierarchy import atomic_file
from renderer.frame import Frame

ROOT = Path(__file__).parents[2]
ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EROFS, errno.EFBIG)


class FailingFile:
    """A file that writes so many bytes and then fails, or fails when it is flushed to the disk."""

    def __init__(self, file, room: int, error: int) -> None:
        self._file, self._room, self._error = file, room, error

    def write(self, data) -> int:
        data = memoryview(data).cast("B")
        self._file.write(data[: self._room])
        self._room -= len(data)
        if self._room < 0:
            raise OSError(self._error, os.strerror(self._error))
        return len(data)

    def __getattr__(self, name: str):
        return getattr(self._file, name)

    def __enter__(self):
        return self

    def __exit__(self, *_error) -> None:
        self._file.close()


@pytest.fixture
def failing(monkeypatch):
    """failing(room, error) has every file fail that is written from now on; failing(None, 0) ends that."""
    create = atomic_file._create

    def fail(room: int | None, error: int) -> None:
        made = create if room is None else lambda part, mode: FailingFile(create(part, mode), room, error)
        monkeypatch.setattr(atomic_file, "_create", made)

    return fail


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> Scene:
    return open_scene(ModelSource(small_model(tmp_path_factory.mktemp("model") / "small.ply")))


def fresh(built: Scene, cache: Cache) -> Scene:
    """The scene as if it had just been built."""
    opened = open_scene(built.source)
    return Scene(opened.source, built.content, built.hierarchy, opened.load_s, 1.0, opened.provenance)


def leftovers(folder: Path) -> int:
    return sum(path.suffix == ".part" for path in folder.iterdir()) if folder.is_dir() else 0


def test_cache_on_a_disk_that_fails(ledger, amount, rng, built, cache_folder, failing):
    said: list[str] = []
    cache = Cache(cache_folder, said.append)
    keep_scene(fresh(built, cache), cache)
    size = sum(file.size for file in cached_files(cache_folder))
    wrong = 0
    cases = amount(8, 500)
    for case in range(cases):
        failing(int(rng.integers(0, size // 2)), ERRORS[case % len(ERRORS)])
        keep_scene(fresh(built, cache), cache)
        failing(None, 0)
        opened = scene._find(built.source, cache)
        wrong += opened is None or not same(opened.hierarchy, built.hierarchy)
        wrong += leftovers(cache_folder) + any("\n" in what for what in said)
    ledger.record(
        "faults", "cache on a disk that fails", "no room, over quota, broken or read-only after any number of bytes",
        cases=cases, worst=wrong, bound=0, unit="lost, left or raised",
    )  # fmt: skip


def test_cache_under_a_limit_of_file_sizes(ledger, amount, rng, built, cache_folder):
    cache = Cache(cache_folder)
    keep_scene(fresh(built, cache), cache)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    wrong = 0
    cases = amount(5, 150)
    for _ in range(cases):
        again = fresh(built, cache)
        resource.setrlimit(resource.RLIMIT_FSIZE, (int(rng.integers(1, 20_000)), before[1]))
        try:
            keep_scene(again, cache)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
        opened = scene._find(built.source, cache)
        wrong += opened is None or not same(opened.hierarchy, built.hierarchy)
        wrong += leftovers(cache_folder)
    ledger.record(
        "faults", "cache under RLIMIT_FSIZE", "limits below what is written", cases=cases, worst=wrong, bound=0,
        unit="lost, left or raised",
    )  # fmt: skip


def test_cache_in_a_place_that_is_none(ledger, built, tmp_path):
    (tmp_path / "file").write_bytes(b"")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    places = ["/proc/surfelscope", "/dev/null", "/dev/full/cache", tmp_path / "file", tmp_path / "file" / "cache"]
    places += [tmp_path / "loop", "/" + "n" * 300, "/sys/surfelscope"]
    wrong = 0
    for place in places:
        said: list[str] = []
        cache = Cache(Path(place), said.append)
        keep_scene(fresh(built, cache), cache)
        wrong += scene._find(built.source, cache) is not None
        wrong += not said or any("\n" in what for what in said)
    assert (tmp_path / "file").read_bytes() == b""
    ledger.record(
        "faults", "cache in a place that is none", "files, devices, links in a circle, file systems that are read-only",
        cases=len(places), worst=wrong, bound=0, unit="raised or not told",
    )  # fmt: skip


def test_cache_on_a_small_disk(ledger, amount, rng, built, tmp_path):
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", disk], capture_output=True, check=False
    ).returncode
    if mounted:
        pytest.skip("no file system may be mounted here")
    wrong, cases = 0, amount(5, 100)
    try:
        cache = Cache(disk / "cache")
        for _ in range(cases):
            filler = disk / "filler"
            filler.write_bytes(bytes(int(rng.uniform() * shutil.disk_usage(disk).free)))
            keep_scene(fresh(built, cache), cache)
            opened = scene._find(built.source, cache)
            wrong += opened is not None and not same(opened.hierarchy, built.hierarchy)
            wrong += leftovers(cache.folder)
            filler.unlink()
        keep_scene(fresh(built, cache), cache)
        wrong += scene._find(built.source, cache) is None
    finally:
        subprocess.run(["umount", "-l", disk], check=True)
    ledger.record(
        "faults", "cache on a disk of 1 MB", "more or less full", cases=cases, worst=wrong, bound=0,
        unit="wrong, left or raised",
    )  # fmt: skip


def test_outputs_on_a_disk_that_fails(ledger, amount, rng, tmp_path, failing):
    color = rng.integers(0, 256, (40, 60, 4), dtype=np.uint8)
    plane = np.ones((40, 60), np.float32)
    frame = Frame(normal=np.ones((40, 60, 3), np.float32), depth=plane, coverage=plane, color=color)
    png, npz = tmp_path / "a.png", tmp_path / "a.npz"
    write_png(png, color)
    write_arrays(npz, frame, 1.0)
    good = {path: path.read_bytes() for path in (png, npz)}
    wrong = 0
    cases = amount(20, 1_000)
    for case in range(cases):
        path = (png, npz)[case % 2]
        failing(int(rng.integers(0, len(good[path]))), ERRORS[case % len(ERRORS)])
        try:
            if path == png:
                write_png(path, color)
            else:
                write_arrays(path, frame, 1.0)
            wrong += 1
        except OutputError as error:
            wrong += "\n" in str(error) or path.name not in str(error)
        failing(None, 0)
        wrong += path.read_bytes() != good[path] or len(list(tmp_path.iterdir())) != 2
    ledger.record(
        "faults", "pictures and arrays on a disk that fails", "no room, over quota, broken or read-only after any "
        "number of bytes, over an older file", cases=cases, worst=wrong, bound=0,
        unit="lost, left or not told in a line",
    )  # fmt: skip


def test_render_where_its_output_does_not_fit(ledger, built, tmp_path):
    """As a process: one line, status 2, and the older picture as it was."""
    output = tmp_path / "a.png"
    Image.new("RGB", (2, 2)).save(output)
    before = output.read_bytes()
    line = [sys.executable, "-m", "app.cli", "render", built.source.path, "--w-s", "2", "--resolution", "600,600"]
    done = subprocess.run(
        [*map(str, line), "--no-cache", "--output", str(output)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (2_000, resource.RLIM_INFINITY)),
    )
    wrong = (done.returncode != 2) + (len(done.stderr.splitlines()) != 1) + (output.read_bytes() != before)
    wrong += len(list(tmp_path.iterdir())) != 1
    ledger.record(
        "faults", "render to a disk that is full", "a limit of file sizes, over an older picture", cases=1, worst=wrong,
        bound=0, unit="lost, left or not told in a line",
    )  # fmt: skip
