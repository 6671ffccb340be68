"""A run goes on only where code, machine, settings and models are the same; other source files do not matter."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.environment import SAME, code_digest
from benchmarks.resume import check_same, check_same_model
from benchmarks.run_file import Run, RunFileError

PATH = Path("run.json")
ENVIRONMENT = {name: f"{name} of before" for name in SAME} | {"commit": "1234567", "date": "then", "cores": 2}
SETTINGS = {"resolution": [64, 64], "rounds": 9, "samples": 4}
RUN = Run(ENVIRONMENT, SETTINGS, {"igea.ply": {"content": "0123456789abcdef"}})


def test_the_same_again_goes_on():
    # JSON has no tuples.
    check_same(PATH, RUN, ENVIRONMENT | {"date": "now", "commit": "other"}, SETTINGS | {"resolution": (64, 64)})
    check_same_model(PATH, RUN, "igea.ply", "0123456789abcdef")
    check_same_model(PATH, RUN, "bunny.obj", "anything")


@pytest.mark.parametrize("name", SAME)
def test_another_machine_or_code_is_refused(name):
    with pytest.raises(RunFileError, match=r"^run\.json: was measured .*now it is here.*") as refused:
        check_same(PATH, RUN, ENVIRONMENT | {name: "now it is here"}, SETTINGS)
    assert "--restart" in str(refused.value)
    assert str(ENVIRONMENT[name]) in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("change", [{"resolution": (128, 64)}, {"rounds": 3}, {"samples": 1}])
def test_other_settings_are_refused(change):
    (name,) = change
    with pytest.raises(RunFileError, match=f"with other {name}"):
        check_same(PATH, RUN, ENVIRONMENT, SETTINGS | change)


def test_another_model_of_the_same_name_is_refused():
    with pytest.raises(RunFileError, match=r"of another igea\.ply"):
        check_same_model(PATH, RUN, "igea.ply", "fedcba9876543210")


def test_the_digest_changes_with_code_that_is_measured_only(tmp_path):
    for room in ("hierarchy", "renderer", "shaders/include", "benchmarks", "app"):
        (tmp_path / room).mkdir(parents=True)
    files = ["hierarchy/lod.py", "shaders/include/frame.glsl", "benchmarks/measurement.py"]
    shown = ["benchmarks/plots.py", "app/window.py", "hierarchy/notes.txt"]
    for name in files + shown:
        (tmp_path / name).write_text("before")
    digests = [code_digest(tmp_path)]
    for name in files:
        (tmp_path / name).write_text("after")
        digests.append(code_digest(tmp_path))
    assert len(set(digests)) == len(digests)
    for name in shown:
        (tmp_path / name).write_text("after")
    assert code_digest(tmp_path) == digests[-1]
