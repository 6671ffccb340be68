import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from app import kernels

ROOT = Path(kernels.__file__).resolve().parents[1]


@pytest.fixture
def nothing_chosen(monkeypatch):
    # Set first, so that what the test sets is undone.
    monkeypatch.setenv(kernels.VARIABLE, "")


def test_the_folder_differs_when_a_file_with_kernels_does(tmp_path, monkeypatch):
    (tmp_path / "app").mkdir()
    for room in kernels.ROOMS:
        (tmp_path / room).mkdir()
    called = tmp_path / "hierarchy" / "enclosing.py"
    called.write_text("a = 1\n")
    monkeypatch.setattr(kernels, "__file__", str(tmp_path / "app" / "kernels.py"))
    before = kernels.state_of_code()
    assert kernels.state_of_code() == before
    called.write_text("a = 22\n")
    assert kernels.state_of_code() != before


@pytest.mark.usefixtures("nothing_chosen")
def test_a_folder_of_its_own_and_old_ones_are_forgotten(tmp_path):
    old, recent = tmp_path / "old", tmp_path / "recent"
    old.mkdir()
    recent.mkdir()
    long_ago = time.time() - 2 * kernels.FORGOTTEN
    os.utime(old, (long_ago, long_ago))
    kernels.keep_kernels_apart(tmp_path)
    assert os.environ[kernels.VARIABLE] == str(tmp_path / kernels.state_of_code())
    assert recent.is_dir()
    assert not old.exists()


def test_who_has_chosen_a_folder_keeps_it(tmp_path, monkeypatch):
    monkeypatch.setenv(kernels.VARIABLE, "somewhere")
    kernels.keep_kernels_apart(tmp_path)
    assert os.environ[kernels.VARIABLE] == "somewhere"


def test_no_place_for_kernels_is_no_end(tmp_path):
    """Neither the cache folder nor the code's own folder can be written: numba alone would give up."""
    blocked = tmp_path / "file"
    blocked.write_text("")
    code = "import os, app.kernels as k; k.keep_kernels_apart(); print(os.environ[k.VARIABLE])"
    environment = {**os.environ, "SURFELSCOPE_CACHE": str(blocked), kernels.VARIABLE: "", "TMPDIR": str(tmp_path)}
    command = [sys.executable, "-c", code]
    run = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    assert Path(run.stdout.strip()).parent == tmp_path
    assert list(tmp_path.iterdir()) == [blocked]


def test_no_kernel_waits_for_libraries_of_linear_algebra():
    code = "import sys; from app.kernels import spare_blas; spare_blas(); from hierarchy.kernel import gaussian\n"
    code += "assert gaussian(0.0) == 1.0; sys.exit('scipy.linalg' in sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
