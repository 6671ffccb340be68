"""The peak of memory is this process's own."""

import subprocess
import sys

import numpy as np
import pytest

from app import memory

LINE = "from app.memory import peak_memory_mb; print(peak_memory_mb())"


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not tell")
def test_the_peak_grows_with_what_is_used():
    before = memory.peak_memory_mb()
    used = np.ones(300_000_000, np.uint8)
    assert before is not None
    assert memory.peak_memory_mb() >= 300.0
    del used
    assert memory.peak_memory_mb() >= max(before, 300.0)


@pytest.mark.skipif(not memory.STATUS.exists(), reason="the system does not tell otherwise")
def test_a_process_does_not_count_what_the_one_that_started_it_has():
    used = np.ones(300_000_000, np.uint8)
    child = subprocess.run([sys.executable, "-c", LINE], capture_output=True, text=True, check=True)
    assert 1.0 < float(child.stdout) < 200.0
    del used


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not tell")
def test_without_a_status_file_the_system_is_asked(monkeypatch, tmp_path):
    own = memory.peak_memory_mb()
    monkeypatch.setattr(memory, "STATUS", tmp_path / "none")
    assert memory.peak_memory_mb() >= 0.9 * own
    (tmp_path / "other").write_text("Name:\tpython\n")
    monkeypatch.setattr(memory, "STATUS", tmp_path / "other")
    assert memory.peak_memory_mb() >= 0.9 * own
