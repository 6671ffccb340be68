"""A run file comes back as it was written, is one file or the other at every moment, and says what is wrong with it."""

from __future__ import annotations

import csv
import json
import math
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from benchmarks.run_file import Record, Run, RunFileError, Setting, flat, read_run, table_path, write_run

ROOT = Path(__file__).parents[2]


def record(view: str = "front", r_inner: float = 16.0, frame: float = 12.5) -> Record:
    setting = Setting("igea.ply", view, "surfelscope", 2.0, r_inner, 16)
    times = {"median": frame, "min": frame - 1.0, "spread": 0.25}
    return Record(setting, {"frame_ms": times, "splats": 1234}, {"normal_degrees": {"mean": 0.5}, "psnr": None})


def run_of(*records: Record) -> Run:
    return Run({"code": "abc"}, {"rounds": 9}, {"igea.ply": {"triangles": 5}}, list(records), [{"w_s": 2}], [], [])


def test_what_is_written_is_read(tmp_path):
    run = run_of(record(), record("far", 8.0))
    write_run(tmp_path / "run.json", run)
    assert read_run(tmp_path / "run.json") == run


def test_numbers_of_numpy_and_numbers_that_are_none_become_plain(tmp_path):
    cost = {"splats": np.int64(3), "list": [np.float32(0.5)]}
    odd = Record(record().setting, cost, {"psnr": math.inf, "x": math.nan})
    write_run(tmp_path / "run.json", run_of(odd))
    (read,) = read_run(tmp_path / "run.json").records
    assert read.cost == {"splats": 3, "list": [0.5]}
    assert read.error == {"psnr": None, "x": None}
    # Strict JSON knows no NaN.
    json.loads((tmp_path / "run.json").read_text(), parse_constant=pytest.fail)


def test_six_digits_are_kept(tmp_path):
    write_run(tmp_path / "run.json", run_of(record(frame=12.3456789)))
    (read,) = read_run(tmp_path / "run.json").records
    assert read.value("cost.frame_ms.median") == 12.3457


def test_each_record_has_a_line_of_its_own(tmp_path):
    write_run(tmp_path / "a.json", run_of(record(), record("far")))
    write_run(tmp_path / "b.json", run_of(record(), record("far"), record("inside")))
    a, b = ((tmp_path / name).read_text().splitlines() for name in ("a.json", "b.json"))
    assert len(b) - len(a) == 1
    assert sum('"inside"' in line for line in b) == 1


def test_values_are_found_by_their_paths():
    one = record()
    assert one.value("cost.frame_ms.median") == 12.5
    assert one.value("r_inner") == 16.0
    assert one.value("error.normal_degrees.mean") == 0.5
    assert math.isnan(one.value("error.psnr"))
    assert math.isnan(one.value("cost.nothing"))
    assert math.isnan(one.value("model"))
    assert flat({"a": {"b": {"c": 1}}, "d": 2}) == {"a.b.c": 1, "d": 2}


def test_the_table_has_a_row_a_record_and_the_columns_of_all(tmp_path):
    first = record()
    second = Record(Setting("igea.ply", "far", "triangles", 0.0, 0.0, 0), {"frame_ms": {"median": 60.0}}, {"flip": 0.1})
    write_run(tmp_path / "run.json", run_of(first, second))
    with table_path(tmp_path / "run.json").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["method"] for row in rows] == ["surfelscope", "triangles"]
    assert rows[0]["cost.frame_ms.median"] == "12.5"
    assert rows[0]["error.flip"] == rows[1]["cost.splats"] == ""
    assert rows[1]["error.flip"] == "0.1"


def test_a_failure_while_writing_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "run.json"
    write_run(path, run_of(record()))

    def full(_descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(RunFileError, match=r"run\.json: cannot be written \(No space left on device\)"):
        write_run(path, run_of(record(), record("far")))
    assert len(read_run(path).records) == 1


WRITE_FOR_EVER = """
import sys
from pathlib import Path
from benchmarks.run_file import Record, Run, Setting, write_run
run = Run({}, {})
for count in range(100_000):
    cost = {"frame_ms": {"median": 1.0}, "padding": [0.0] * 500}
    run.records.append(Record(Setting("m", f"view {count}", "surfelscope", 2.0, 16.0, 16), cost, {}))
    write_run(Path(sys.argv[1]), run)
"""


def test_a_process_killed_while_it_writes_leaves_a_whole_file(tmp_path):
    path = tmp_path / "run.json"
    for wait_s in (0.0, 0.02, 0.05):
        process = subprocess.Popen([sys.executable, "-c", WRITE_FOR_EVER, str(path)], cwd=ROOT)
        deadline = time.monotonic() + 30.0
        path.unlink(missing_ok=True)
        while not path.exists() and time.monotonic() < deadline:
            time.sleep(0.002)
        time.sleep(wait_s)
        process.send_signal(signal.SIGKILL)
        process.wait()
        records = read_run(path).records
        assert [each.setting.view for each in records] == [f"view {count}" for count in range(len(records))]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("{", "not a run"),
        ("[1, 2]", "not a run"),
        ('{"records": []}', "not a run"),
        ('{"format": 99}', "its format is 99"),
        ('{"format": 1, "environment": {}, "settings": {}}', "a damaged one"),
        (
            '{"format": 1, "environment": {}, "settings": {}, "models": {}, "records": [{"model": "m"}], "paper": [],'
            ' "scaling": [], "bounds": []}',
            "a damaged one",
        ),
        (
            '{"format": 1, "environment": {}, "settings": {}, "models": {}, "records": [], "paper": [], "scaling": [],'
            ' "bounds": [{"view": 3}]}',
            "a damaged one",
        ),
    ],
)
def test_other_files_are_refused_in_one_line(tmp_path, text, reason):
    path = tmp_path / "other.json"
    path.write_text(text)
    with pytest.raises(RunFileError, match=reason) as refused:
        read_run(path)
    assert "\n" not in str(refused.value)
    assert str(path) in str(refused.value)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(RunFileError, match=r"no\.json: No such file"):
        read_run(tmp_path / "no.json")
