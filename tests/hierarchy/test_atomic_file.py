import fcntl
import os
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hierarchy import atomic_file
from hierarchy.atomic_file import remove_unfinished, replacing, sweep

ROOT = Path(__file__).parents[2]

WRITE_UNTIL_KILLED = """
import sys
from pathlib import Path
from hierarchy.atomic_file import replacing
with replacing(Path(sys.argv[1])) as file:
    while True:
        file.write(b"half")
        file.flush()
        print(".", flush=True)
"""


def write(path: Path, data: bytes) -> None:
    with replacing(path) as file:
        file.write(data)


def start_writer(path: Path) -> subprocess.Popen:
    process = subprocess.Popen([sys.executable, "-c", WRITE_UNTIL_KILLED, path], cwd=ROOT, stdout=subprocess.PIPE)
    assert process.stdout is not None
    process.stdout.readline()
    return process


def kill(process: subprocess.Popen) -> None:
    process.kill()
    process.wait()
    process.stdout.close()


def test_file_appears_whole_and_nothing_stays_beside_it(tmp_path):
    path = tmp_path / "a.bin"
    with replacing(path) as file:
        file.write(b"new")
        assert not path.exists()
    assert path.read_bytes() == b"new"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_failure_leaves_the_old_file(tmp_path, error):
    path = tmp_path / "a.bin"
    path.write_bytes(b"old")

    def fail() -> None:
        with replacing(path) as file:
            file.write(b"half")
            raise error

    with pytest.raises(type(error)):
        fail()
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]
    assert not atomic_file._unfinished


def test_replaced_file_keeps_its_permissions_and_a_new_one_follows_the_umask(tmp_path):
    old, new = tmp_path / "old", tmp_path / "new"
    old.write_bytes(b"")
    old.chmod(0o640)
    write(old, b"x")
    before = os.umask(0o027)
    try:
        write(new, b"x")
    finally:
        os.umask(before)
    assert stat.S_IMODE(old.stat().st_mode) == stat.S_IMODE(new.stat().st_mode) == 0o640


def test_link_is_replaced_not_what_it_leads_to(tmp_path):
    target, link = tmp_path / "target", tmp_path / "link"
    link.symlink_to(target)
    write(link, b"new")
    assert not target.exists()
    assert not link.is_symlink()
    assert link.read_bytes() == b"new"


def test_longest_name_there_can_be(tmp_path):
    path = tmp_path / ("n" * 255)
    write(path, b"new")
    assert path.read_bytes() == b"new"


def test_sweep_removes_what_a_killed_process_left_and_nothing_else(tmp_path):
    path = tmp_path / "a.bin"
    path.write_bytes(b"old")
    others = [tmp_path / name for name in ("a.part", ".a.bin.part", ".b.bin.0123456789ab.part.txt")]
    for other in others:
        other.write_bytes(b"")
    process = start_writer(path)
    # It is being written: its lock says so, however old it may look.
    (part,) = set(tmp_path.glob(".a.bin.*.part"))
    os.utime(part, (0, 0))
    process.send_signal(signal.SIGSTOP)
    try:
        fd = os.open(part, os.O_RDWR)
        with pytest.raises(BlockingIOError):
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.close(fd)
    finally:
        kill(process)
    assert sweep(tmp_path, "b.bin") == 0
    assert sweep(tmp_path) == 1
    assert not part.exists()
    assert all(other.exists() for other in others)
    assert path.read_bytes() == b"old"


def test_sweep_leaves_what_is_being_written(tmp_path):
    process = start_writer(tmp_path / "a.bin")
    try:
        assert sweep(tmp_path) == 0
    finally:
        kill(process)
    assert sweep(tmp_path) == 1


def test_sweep_goes_by_age_where_locks_do_not_work(tmp_path, monkeypatch):
    monkeypatch.setattr(atomic_file, "_lock", lambda file: False)
    young, old = tmp_path / ".a.0123456789ab.part", tmp_path / ".b.0123456789ab.part"
    for path in (young, old):
        path.write_bytes(b"")
    os.utime(old, (time.time() - 2 * atomic_file.ABANDONED_AFTER,) * 2)
    assert sweep(tmp_path) == 1
    assert young.exists()


def test_sweep_of_no_folder_finds_nothing(tmp_path):
    assert sweep(tmp_path / "nowhere") == 0


def test_interrupt_at_the_worst_moment_removes_what_is_half_written(tmp_path):
    path = tmp_path / "a.bin"

    def write_while_interrupted() -> None:
        with replacing(path) as file:
            file.write(b"half")
            remove_unfinished()
            assert list(tmp_path.iterdir()) == []

    with pytest.raises(FileNotFoundError):
        write_while_interrupted()


def test_file_taken_for_abandoned_before_it_was_locked_is_made_again(tmp_path, monkeypatch):
    lock = atomic_file._lock

    def lose_once(file):
        monkeypatch.setattr(atomic_file, "_lock", lock)
        Path(f"/proc/self/fd/{file.fileno()}").readlink().unlink()
        return lock(file)

    if not Path("/proc/self/fd").is_dir():
        pytest.skip("no names of open files here")
    monkeypatch.setattr(atomic_file, "_lock", lose_once)
    write(tmp_path / "a.bin", b"new")
    assert (tmp_path / "a.bin").read_bytes() == b"new"
