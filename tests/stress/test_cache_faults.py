"""The cache under faults: whatever happens to its files, a model opens as it should, and a good entry stays good."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from cache_models import same, small_model

from app import scene
from app.cache import Cache
from app.cache_folder import cached_files
from app.scene import ModelSource, Scene, keep_scene, open_scene
from app.tile_cache import find_tiles, keep_tiles
from hierarchy import store
from hierarchy.normal_tiles import TileBaker
from hierarchy.store import save_hierarchy
from hierarchy.tile_shelf import ShownTiles

ROOT = Path(__file__).parents[2]


def start(script: str, *arguments: object, **environment: str) -> subprocess.Popen[str]:
    paths = os.pathsep.join([str(ROOT), str(ROOT / "tests" / "stress")])
    return subprocess.Popen(
        [sys.executable, ROOT / "tests" / "stress" / script, *map(str, arguments)],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": paths, **environment},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> Scene:
    """A small model, built without a cache."""
    return open_scene(ModelSource(small_model(tmp_path_factory.mktemp("model") / "small.ply")))


@pytest.fixture
def cache(cache_folder, built, monkeypatch) -> Cache:
    """A cache that holds the small model."""
    monkeypatch.setattr(scene, "WORTH_KEEPING", -1.0)
    cache = Cache(cache_folder)
    keep_scene(open_scene(built.source, cache=cache), cache)
    return cache


def entry(cache: Cache) -> Path:
    (path,) = (file.path for file in cached_files(cache.folder) if file.is_model)
    return path


def found_wrong(cache: Cache, built: Scene) -> bool:
    """Tell whether the cache gives what it must not, or raises."""
    try:
        opened = scene._find(built.source, cache)
    except Exception:
        return True
    return opened is not None


def test_cut_anywhere(ledger, amount, rng, cache, built):
    path = entry(cache)
    good = path.read_bytes()
    lengths = {0, 1, 7, 8, 9, len(good) - 1, *rng.integers(0, len(good), amount(50, 3_000)).tolist()}
    wrong = 0
    for length in lengths:
        path.write_bytes(good[:length])
        wrong += found_wrong(cache, built)
    ledger.record(
        "faults", "cache entry cut off", "every kind of length, 0 among them", cases=len(lengths), worst=wrong, bound=0,
        unit="believed",
    )  # fmt: skip


def test_header_with_a_flipped_bit(ledger, amount, rng, cache, built):
    path = entry(cache)
    good = path.read_bytes()
    header = 8 + int.from_bytes(good[:8], "little")
    wrong = 0
    places = range(0, header, amount(17, 1))
    for place in places:
        path.write_bytes(good[:place] + bytes([good[place] ^ 1 << rng.integers(8)]) + good[place + 1 :])
        wrong += found_wrong(cache, built)
    ledger.record(
        "faults", "header of a cache entry", "a bit of each byte flipped", cases=len(places), worst=wrong, bound=0,
        unit="believed",
    )  # fmt: skip


def test_bits_flipped_anywhere(ledger, amount, rng, cache, built):
    wrong = 0
    cases = amount(30, 3_000)
    path = entry(cache)
    good = bytearray(path.read_bytes())
    for place in rng.integers(0, len(good), cases):
        damaged = bytearray(good)
        damaged[place] ^= 1 << rng.integers(8)
        path.write_bytes(damaged)
        wrong += found_wrong(cache, built)
    ledger.record(
        "faults", "cache entries", "single bits flipped in hierarchies", cases=cases, worst=wrong, bound=0,
        unit="believed",
    )  # fmt: skip


def test_things_in_its_place(ledger, cache, built, tmp_path, monkeypatch):
    path = entry(cache)
    good = path.read_bytes()
    with monkeypatch.context() as other:
        other.setattr(store, "FORMAT", "surfelscope 0")
        save_hierarchy(tmp_path / "old", built.hierarchy, {}, lambda fraction: None)
    (tmp_path / "huge").write_bytes((2**62).to_bytes(8, "little") + good[8:])
    places = {
        "another version": lambda: path.write_bytes((tmp_path / "old").read_bytes()),
        "a text": lambda: path.write_text("not a cache"),
        "zeros": lambda: path.write_bytes(bytes(len(good))),
        "a header that is too long": lambda: path.write_bytes((tmp_path / "huge").read_bytes()),
        "a dangling link": lambda: path.symlink_to(tmp_path / "nowhere"),
        "a link to itself": lambda: path.symlink_to(path),
        "a pipe": lambda: os.mkfifo(path),
        "a folder": path.mkdir,
    }
    wrong = 0
    for what, put in places.items():
        path.unlink()
        put()
        wrong += found_wrong(cache, built)
        keep_scene(open_scene(built.source, cache=cache), cache)
        mended = scene._find(built.source, cache)
        if what == "a folder":
            # Only its owner knows what it is for.
            wrong += mended is not None
            path.rmdir()
            path.write_bytes(good)
        else:
            wrong += mended is None or not same(mended.hierarchy, built.hierarchy) or path.is_symlink()
        wrong += (tmp_path / "nowhere").exists()
    ledger.record(
        "faults", "something else in a cache entry's place", ", ".join(places), cases=len(places), worst=wrong, bound=0,
        unit="wrong",
    )  # fmt: skip


@pytest.fixture
def tiles(cache, built) -> tuple[Scene, Path]:
    """The small model out of the cache, and the file there that holds tiles of it."""
    opened = open_scene(built.source, cache=cache)
    nodes = np.arange(opened.hierarchy.node_count, dtype=np.uint32)
    baked = TileBaker(opened.hierarchy, 8).fitted(nodes, np.full(len(nodes), 8, np.int32))
    keep_tiles(cache, opened, ShownTiles(8, baked))
    assert find_tiles(cache, opened, 8) is not None
    (path,) = (file.path for file in cached_files(cache.folder) if ".tiles" in file.path.name)
    return opened, path


def believed(cache: Cache, opened: Scene) -> bool:
    """Tell whether the cache gives tiles that it must not, or raises."""
    try:
        return find_tiles(cache, opened, 8) is not None
    except Exception:
        return True


def test_tiles_cut_anywhere_or_with_a_flipped_bit(ledger, amount, rng, cache, tiles):
    opened, path = tiles
    good = path.read_bytes()
    wrong = 0
    lengths = {0, 1, 7, 8, 9, len(good) - 1, *rng.integers(0, len(good), amount(50, 2_000)).tolist()}
    for length in lengths:
        path.write_bytes(good[:length])
        wrong += believed(cache, opened)
    header = 8 + int.from_bytes(good[:8], "little")
    # Half of them in the header, whose bytes are few.
    places = [*rng.integers(0, header, amount(50, 2_000)), *rng.integers(0, len(good), amount(50, 2_000))]
    for place in places:
        path.write_bytes(good[:place] + bytes([good[place] ^ 1 << rng.integers(8)]) + good[place + 1 :])
        wrong += believed(cache, opened)
    path.write_bytes(good)
    assert find_tiles(cache, opened, 8) is not None
    ledger.record(
        "faults", "tiles in the cache", "cut off anywhere; single bits flipped, half of them in the header",
        cases=len(lengths) + len(places), worst=wrong, bound=0, unit="believed",
    )  # fmt: skip


def test_kernels_survive_what_is_accepted(ledger, amount, cache, built, tmp_path, pytestconfig):
    """Contents that were changed and have checksums that fit: as a program that is wrong could write them."""
    save_hierarchy(tmp_path / "hierarchy", built.hierarchy, {}, lambda fraction: None)
    cases = amount(10, 5_000)
    process = start("cache_kernels_child.py", tmp_path, pytestconfig.getoption("--stress-seed"), cases)
    output, complaints = process.communicate(timeout=600)
    outcomes = output.split("\n")[:-1]
    assert process.returncode == 0, f"case {len(outcomes)} of {cases} ended the process: {complaints[-2000:]}"
    assert {"ran", "refused"} <= set(outcomes)
    ledger.record(
        "faults", "kernels on changed hierarchies", "arrays changed or of other lengths, checksums that fit; what is "
        "accepted is selected from, predicted and baked in a process of its own", cases=cases,
        worst=cases - len(outcomes), bound=0, unit="crashes",
    )  # fmt: skip


def test_four_processes_at_once(ledger, amount, built, cache_folder):
    rounds = amount(2, 40)
    processes = [start("cache_user_child.py", built.source.path, seed, rounds) for seed in range(amount(2, 4))]
    wrong = 0
    for process in processes:
        output, complaints = process.communicate(timeout=600)
        wrong += output.count("wrong") + (process.returncode != 0) + bool(complaints)
        assert wrong == 0, output + complaints
    wrong += sum(path.suffix == ".part" for path in cache_folder.iterdir()) if cache_folder.exists() else 0
    ledger.record(
        "faults", "processes that share a cache", "four open, keep, damage and clear the same entry", worst=wrong,
        cases=rounds * len(processes), bound=0, unit="wrong",
    )  # fmt: skip


def test_writers_killed_at_any_moment(ledger, amount, rng, cache, built, tmp_path):
    path = entry(cache)
    good = tmp_path / "good"
    good.write_bytes(path.read_bytes())
    process = start("cache_writer_child.py", good, path)
    assert process.stdin is not None
    assert process.stdout is not None
    wrong, cases = 0, amount(20, 1_000)
    for _ in range(cases):
        process.stdin.write("write\n")
        process.stdin.flush()
        writer = int(process.stdout.readline())
        time.sleep(rng.uniform(0.0, 0.01))
        os.kill(writer, 9)
        process.stdout.readline()
        opened = scene._find(built.source, cache)
        wrong += opened is None or not same(opened.hierarchy, built.hierarchy)
        wrong += sum(each.suffix == ".part" for each in cache.folder.iterdir())
    process.stdin.close()
    assert process.stderr is not None
    complaints = process.stderr.read()
    process.stdout.close()
    process.stderr.close()
    assert (process.wait(60), complaints) == (0, "")
    ledger.record(
        "faults", "writers killed", "SIGKILL at random moments while an entry is replaced; what they leave is swept at "
        "the next start", cases=cases, worst=wrong, bound=0, unit="lost or left",
    )  # fmt: skip


def test_file_that_changes_while_it_loads(ledger, amount, rng, built, cache_folder, tmp_path, monkeypatch):
    """A second thread writes, cuts, replaces and removes the file: no entry may be of anything but what it says."""
    import threading

    from hierarchy.model import ModelError

    monkeypatch.setattr(scene, "WORTH_KEEPING", -1.0)
    path = tmp_path / "changing.ply"
    contents, hierarchies = [], []
    for turn in (False, True):
        small_model(path, turn=turn)
        contents.append(path.read_bytes())
        hierarchies.append(open_scene(ModelSource(path)).hierarchy)
    assert len(contents[0]) == len(contents[1])
    assert not same(*hierarchies)
    stop = threading.Event()
    seed = int(rng.integers(2**32))

    def write() -> None:
        chance = np.random.default_rng(seed)
        while not stop.is_set():
            content = contents[chance.integers(2)]
            match chance.integers(5):
                case 0:
                    part = path.with_name("part")
                    part.write_bytes(content)
                    part.replace(path)
                case 1:
                    path.unlink(missing_ok=True)
                case 2:
                    path.write_bytes(content[: chance.integers(len(content))])
                case _:
                    # Slowly, the beginning of one and the end of the other.
                    with path.open("r+b" if path.exists() else "wb") as file:
                        for begin in range(0, len(content), 4096):
                            file.write(content[begin : begin + 4096])
                            file.flush()
            time.sleep(chance.uniform(0.0, 0.01))

    cache = Cache(cache_folder)
    wrong = opened_count = 0
    cases = amount(6, 300)
    for _ in range(cases):
        stop.clear()
        writer = threading.Thread(target=write)
        writer.start()
        try:
            keep_scene(open_scene(ModelSource(path), cache=cache), cache)
            opened_count += 1
        except ModelError as error:
            wrong += "\n" in str(error)
        finally:
            seed += 1
            stop.set()
            writer.join()
        for content, hierarchy in zip(contents, hierarchies, strict=True):
            path.write_bytes(content)
            found = scene._find(ModelSource(path), cache)
            wrong += found is not None and not same(found.hierarchy, hierarchy)
    assert opened_count > 0
    ledger.record(
        "faults", "a model that changes while it loads", "written slowly, cut, replaced and removed meanwhile",
        cases=cases, worst=wrong, bound=0, unit="kept as another or not told in a line",
    )  # fmt: skip
