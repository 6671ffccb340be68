"""The peak of memory is this process's own."""

import subprocess
import sys

import numpy as np
import pytest

from app import memory

LINE = "from app.memory import peak_memory_mb; print(peak_memory_mb())"


def _printed(code):
    return float(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not tell")
def test_the_peak_grows_with_what_is_used_and_stays():
    # In a process of its own: this one may have used more before.
    code = "import numpy as np; used = np.ones(300_000_000, np.uint8); del used; " + LINE
    without, with_ = (_printed(each) for each in (LINE, code))
    assert 290.0 < with_ - without < 400.0


@pytest.mark.skipif(not memory.STATUS.exists(), reason="the system does not tell otherwise")
def test_a_process_does_not_count_what_the_one_that_started_it_has():
    used = np.ones(300_000_000, np.uint8)
    assert 1.0 < _printed(LINE) < 200.0
    del used


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not tell")
def test_without_a_status_file_the_system_is_asked(monkeypatch, tmp_path):
    own = memory.peak_memory_mb()
    monkeypatch.setattr(memory, "STATUS", tmp_path / "none")
    assert memory.peak_memory_mb() >= 0.9 * own
    (tmp_path / "other").write_bytes(b"Name:\tm\xc3\n")
    monkeypatch.setattr(memory, "STATUS", tmp_path / "other")
    assert memory.peak_memory_mb() >= 0.9 * own
