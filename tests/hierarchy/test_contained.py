import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import laspy
import numpy as np
import pytest

from hierarchy import contained
from hierarchy.contained import TOO_LONG, read_contained
from hierarchy.las import read_laz
from hierarchy.las_header import read_las_header
from hierarchy.load import load_model
from hierarchy.model import Cancelled, ModelError
from hierarchy.part import UnreadableFile

ROOT = Path(contained.__file__).resolve().parents[1]

# A child whose reader of LAZ files is the given one.
READER = """
import os, signal, sys, time
import numpy as np
from hierarchy import contained_child, las
from hierarchy.part import Part
def read_laz(path, progress):
{}
las.read_laz = read_laz
contained_child.main()
"""


@pytest.fixture
def laz(tmp_path):
    las = laspy.LasData(laspy.LasHeader(point_format=2))
    las.x, las.y, las.z = np.random.default_rng(1).random((3, 1000))
    las.write(tmp_path / "a.laz")
    return tmp_path / "a.laz"


@pytest.fixture
def started(monkeypatch):
    """All children that were started."""
    children = []
    start = contained._start

    def keep(*arguments):
        children.append(start(*arguments))
        return children[-1]

    monkeypatch.setattr(contained, "_start", keep)
    return children


def run_instead(monkeypatch, code):
    monkeypatch.setattr(contained, "CHILD", ("-P", "-c", code))


def read_with(monkeypatch, body):
    run_instead(monkeypatch, READER.format("\n".join("    " + line for line in body.splitlines())))


def failure(path, **options):
    with pytest.raises(UnreadableFile) as caught:
        read_contained(path, "laz", [], **options)
    return str(caught.value)


def is_gone(pid):
    """Whether a process ends within some seconds; one that waits for its parent to notice has ended."""
    deadline = time.monotonic() + 20
    while time.monotonic() < deadline:
        try:
            if Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[-1].split()[0] == "Z":
                return True
        except OSError:
            return True
        time.sleep(0.05)
    return False


def test_a_good_file_comes_back_whole(laz, started):
    fractions = []
    (part,) = read_contained(laz, "laz", [], lambda stage, fraction: fractions.append(fraction))
    (expected,) = read_laz(laz)
    np.testing.assert_array_equal(part.positions, expected.positions)
    assert 0.3 in fractions
    assert started[0].returncode == -signal.SIGKILL or started[0].returncode == 0
    assert started[0].stdin.closed
    assert started[0].stdout.closed


def test_layers_of_points_longer_than_the_file(tmp_path):
    las = laspy.LasData(laspy.LasHeader(point_format=6))
    las.x, las.y, las.z = np.random.default_rng(1).random((3, 1000))
    las.write(tmp_path / "a.laz")
    data = bytearray((tmp_path / "a.laz").read_bytes())
    header = read_las_header(tmp_path / "a.laz")
    # Behind the place of the table of chunks: one whole point, the count of points, and the sizes of nine layers. lazrs
    # reserves as much as they say, and where it gets it reads on for seconds.
    sizes = header.start + 8 + header.point_size + 4
    data[sizes : sizes + 36] = b"\xff" * 36
    (tmp_path / "a.laz").write_bytes(data)
    assert failure(tmp_path / "a.laz").startswith("damaged")


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="limits processor time by a signal")
def test_a_reader_that_loops(monkeypatch, laz, started):
    read_with(monkeypatch, "while True: pass")
    assert failure(laz, seconds=1.0) == TOO_LONG
    assert started[0].returncode == -signal.SIGXCPU


def test_a_reader_that_waits(monkeypatch, laz, started):
    read_with(monkeypatch, "time.sleep(1000)")
    monkeypatch.setattr(contained, "WAITING", 0.2)
    assert failure(laz, seconds=5.0) == TOO_LONG
    assert started[0].returncode is not None


@pytest.mark.parametrize("end", ["os.abort()", "os.kill(os.getpid(), signal.SIGSEGV)", "os._exit(0)", "os._exit(1)"])
def test_a_reader_that_ends_the_process(monkeypatch, laz, end):
    read_with(monkeypatch, end)
    assert failure(laz) == "damaged: its reader broke down"


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="limits memory")
def test_a_reader_that_wants_all_memory(monkeypatch, laz):
    read_with(monkeypatch, "return [Part(np.ones((10**9, 3)))]")
    assert failure(laz) == "damaged, or it unpacks to far more than a file of its size should"


def test_a_reader_that_panics(monkeypatch, laz):
    read_with(monkeypatch, "raise type('PanicException', (BaseException,), {})('index out of bounds')")
    assert failure(laz) == "damaged, truncated or not a LAZ file"


def test_what_a_reader_prints_is_not_seen_and_harms_nothing(monkeypatch, laz, capfd):
    read_with(
        monkeypatch, "os.write(1, b'{\"done\": 1}'); os.write(2, b'panic'); print('x'); return [Part(np.ones((2, 3)))]"
    )
    (part,) = read_contained(laz, "laz", [])
    assert part.positions.tolist() == [[1.0, 1.0, 1.0]] * 2
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    "said",
    [
        "{}",
        "'rubbish'",
        "'\\0' * 10**7",
        "'{\"done\": false}\\n' * 1000",
        '\'{"part": {"positions": [1000000000000, 3]}}\\n\'',
        '\'{"part": {"positions": [5, 3]}, "texture_name": 0, "material_color": [1], "bad_faces": 0}\\n\'',
        '\'{"warning": 3, "progress": "x", "unreadable": null}\\n\'',
    ],
)
def test_a_child_that_talks_nonsense(monkeypatch, laz, said):
    run_instead(monkeypatch, f"import sys; sys.stdout.write(str({said}))")
    assert failure(laz) == "damaged: its reader broke down"


@pytest.mark.parametrize("error", [Cancelled, KeyboardInterrupt])
def test_cancelling_ends_a_child_at_work(monkeypatch, laz, started, error):
    read_with(monkeypatch, "progress('load', 0.125)\nwhile True: pass")

    def stop(stage, fraction):
        if fraction == 0.125:
            raise error

    with pytest.raises(error):
        read_contained(laz, "laz", [], stop, seconds=100.0)
    assert started[0].returncode == -signal.SIGKILL


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks into /proc")
@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_the_child_does_not_outlive_its_parent(laz, end):
    child = READER.format("    time.sleep(1000)")
    code = (
        "from pathlib import Path; from hierarchy import contained; import sys\n"
        f"contained.CHILD = ('-P', '-c', {child!r})\n"
        "start = contained._start\n"
        "def tell(*arguments):\n"
        "    started = start(*arguments); print(started.pid, flush=True); return started\n"
        "contained._start = tell\n"
        f"contained.read_contained(Path({str(laz)!r}), 'laz', [], seconds=100.0)\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as parent:
        pid = int(parent.stdout.readline())
        time.sleep(0.5)
        parent.send_signal(end)
        parent.wait(30)
    assert is_gone(pid)


def test_modules_in_the_users_folder_are_not_imported(monkeypatch, laz):
    for name in ("numpy", "lazrs", "hierarchy", "json"):
        (laz.parent / f"{name}.py").write_text("raise SystemExit(9)")
    monkeypatch.chdir(laz.parent)
    assert len(read_contained(Path("a.laz"), "laz", [])) == 1


def test_names_that_look_like_something_else(monkeypatch, laz):
    monkeypatch.chdir(laz.parent)
    for name in ("-c", "a\nb", os.fsdecode(b"\xff\xfe"), "--help.laz"):
        laz.rename(name)
        laz = Path(name)
        assert len(read_contained(laz, "laz", [])) == 1


def test_unknown_kinds_and_missing_files(tmp_path):
    (tmp_path / "a.what").write_text("?")
    with pytest.raises(ModelError, match=r"^a\.what: unknown kind of file \(\.what\)$"):
        load_model(tmp_path / "a.what")
    with pytest.raises(FileNotFoundError):
        read_contained(tmp_path / "b.laz", "laz", [])
