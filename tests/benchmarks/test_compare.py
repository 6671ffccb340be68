"""What is flagged between two runs, and what is not."""

from __future__ import annotations

from pathlib import Path

import pytest
from synthetic_run import synthetic_run

from benchmarks.compare import TOLERANCE, compare, compare_runs
from benchmarks.run_file import Record, Run, RunFileError, write_run


@pytest.fixture
def old() -> Run:
    return synthetic_run()


@pytest.fixture
def new() -> Run:
    return synthetic_run()


def record_of(run: Run, method: str = "surfelscope") -> Record:
    return next(r for r in run.records if r.setting.method == method and r.setting.w_s in (0, 16))


def test_a_run_equals_itself(old, new):
    result = compare_runs(old, new)
    assert (result.flagged, result.better, result.only_old, result.only_new, result.notes) == ((), (), (), (), ())
    assert result.status == 0
    assert result.compared == len(old.records) + len(old.scaling)
    assert "0 flagged" in result.text()


@pytest.mark.parametrize(("growth", "flagged"), [(0.999 + TOLERANCE, False), (1.001 + TOLERANCE, True), (0.5, False)])
def test_a_frame_is_flagged_beyond_the_tolerance(old, new, growth, flagged):
    slower = record_of(new)
    slower.cost["frame_over_triangles"] *= growth
    result = compare_runs(old, new)
    assert [c.setting for c in result.flagged] == ([slower.setting] if flagged else [])
    assert result.status == int(flagged)


def test_a_slower_machine_is_no_change_but_is_said(old, new):
    new.environment["cpu"] = "Half a processor"
    for record in new.records:
        for name in ("frame_ms", "triangles_ms"):
            for figure in record.cost[name]:
                record.cost[name][figure] *= 2.0
    result = compare_runs(old, new)
    assert result.flagged == ()
    assert "Half a processor" in result.text()


def test_what_is_too_small_to_see_is_not_flagged(old, new):
    for run, degrees, holes in ((old, 0.001, 0), (new, 0.009, 2)):
        record = record_of(run)
        record.error["normal_degrees"]["mean"], record.error["holes"] = degrees, holes
    assert compare_runs(old, new).flagged == ()


def test_what_was_zero_has_no_share(old, new):
    record_of(new).error["holes"] = 3
    result = compare_runs(old, new)
    assert [change.figure.text for change in result.flagged] == ["holes"]
    assert "was 0" in result.text()


def test_primitives_are_splats_and_triangles_together(old, new):
    moved = record_of(new)
    moved.cost["splats"] += 400
    moved.cost["triangles"] -= 400
    more = record_of(new, "no tiles")
    more.cost["splats"] *= 1.5
    flagged = compare_runs(old, new).flagged
    assert [(c.figure.text, c.setting) for c in flagged] == [("splats + triangles", more.setting)]


def test_the_growing_surface_is_compared_too(old, new):
    new.scaling[-1]["cost"]["frame_over_triangles"] *= 1.2
    (change,) = compare_runs(old, new).flagged
    assert change.setting.model == "surface of 17000000"
    assert "+20.0%" in compare_runs(old, new).text()


def test_the_largest_change_comes_first_and_improvements_apart(old, new):
    for record, factor in zip(new.records, (1.2, 1.5, 0.5), strict=False):
        record.cost["gpu_bytes"] *= factor
    result = compare_runs(old, new)
    assert [round(c.share, 3) for c in result.flagged] == [0.5, 0.2]
    assert [round(c.share, 3) for c in result.better] == [-0.5]


def test_settings_of_one_run_only_are_listed_and_not_flagged(old, new):
    gone = new.records.pop(3)
    result = compare_runs(old, new)
    assert result.only_old == (gone.setting,)
    assert result.status == 0
    assert "1 only in the old run" in result.text()
    assert compare_runs(new, old).only_new == (gone.setting,)


def test_a_figure_that_one_run_lacks_is_not_compared(old, new):
    record_of(new).error["silhouette"]["mean"] = None
    assert compare_runs(old, new).flagged == ()


def test_another_model_or_size_of_picture_is_said(old, new):
    new.settings["resolution"] = [512, 512]
    new.models["igea.ply"]["content"] = "another"
    notes = compare_runs(old, new).notes
    assert any("resolution" in note for note in notes)
    assert any("igea.ply has changed" in note for note in notes)


def test_many_rows_are_cut_short(old, new):
    for record in new.records:
        record.cost["gpu_bytes"] *= 2.0
    result = compare_runs(old, new)
    assert len(result.flagged) == len(new.records)
    assert f"... and {len(new.records) - 40} more" in result.text()


def test_files_are_compared_and_bad_ones_said_in_a_line(old, tmp_path: Path):
    write_run(tmp_path / "a.json", old)
    assert compare(tmp_path / "a.json", tmp_path / "a.json").status == 0
    with pytest.raises(RunFileError, match=r"missing\.json"):
        compare(tmp_path / "a.json", tmp_path / "missing.json")
