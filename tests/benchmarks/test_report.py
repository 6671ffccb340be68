"""The page keeps its prose, and its tables say what the run says."""

from __future__ import annotations

import re

import pytest
from synthetic_run import synthetic_error, synthetic_run

from app.errors import OutputError, UsageError
from benchmarks.report import BLOCKS, NOTHING, fill_in, write_report
from benchmarks.run_file import Run
from benchmarks.tables import table
from benchmarks.targets_table import targets

PROSE = "What a reader should know | really.\n"


@pytest.fixture(scope="module")
def run() -> Run:
    return synthetic_run()


def page_of(*names: str, content: str = "old\n") -> str:
    blocks = (f"<!-- bench:{name} -->\n{content}<!-- /bench:{name} -->\n" for name in names)
    return PROSE + PROSE.join(blocks) + PROSE


def rows_of(text: str) -> list[list[str]]:
    """Return the cells of a Markdown table below its header."""
    lines = [line for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def test_prose_stays_and_tables_are_replaced(run):
    filled = fill_in(page_of("machine", "scaling"), run)
    assert "old" not in filled
    assert filled.count(PROSE) == 3
    assert "llvmpipe" in filled
    assert "0123456789ab" in filled
    # Filling in again changes nothing.
    assert fill_in(filled, run) == filled


@pytest.mark.parametrize("name", sorted(BLOCKS))
def test_every_table_has_as_many_cells_a_row(run, name):
    text = BLOCKS[name](run)
    widths = {len(re.findall(r"(?<!\\)\|", line)) for line in text.splitlines() if line.startswith("|")}
    assert len(widths) == 1 or (name == "bounds" and not widths)
    assert "nan" not in text


def test_a_run_without_records_says_so():
    empty = Run(synthetic_run().environment, synthetic_run().settings)
    filled = fill_in(page_of(*BLOCKS), empty)
    assert filled.count(NOTHING) == len(BLOCKS) - 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<!-- bench:scaling -->\n", "stands alone"),
        ("<!-- bench:scaling -->\n<!-- /bench:machine -->\n", "followed by"),
        ("<!-- bench:scaling -->\n<!-- bench:scaling -->\n", "followed by"),
        ("<!-- /bench:scaling -->\n<!-- bench:scaling -->\n", "followed by"),
        ("<!-- bench:nothing -->\n<!-- /bench:nothing -->\n", "no table 'nothing'"),
    ],
)
def test_bad_markers_are_refused_and_the_page_is_left(run, tmp_path, text, message):
    page = tmp_path / "page.md"
    page.write_text(text)
    with pytest.raises(UsageError, match=message):
        write_report(run, page)
    assert page.read_text() == text


def test_a_missing_page_is_one_line(run, tmp_path):
    with pytest.raises(OutputError, match=r"page\.md"):
        write_report(run, tmp_path / "page.md")


def test_a_report_fills_the_page_and_draws_the_plots(run, tmp_path):
    pytest.importorskip("matplotlib")
    page = tmp_path / "page.md"
    page.write_text(page_of(*BLOCKS))
    run = Run(run.environment, run.settings, scaling=run.scaling)
    assert write_report(run, page) == [page, tmp_path / "plots" / "time-over-size.svg"]
    assert "times as long" in page.read_text()


def test_scaling_says_where_splats_overtake_and_how_they_grow(run):
    text = BLOCKS["scaling"](run)
    rows = rows_of(text)
    assert [row[0] for row in rows] == [f"{entry['triangles']:,}" for entry in run.scaling]
    assert "faster than plain triangles from about 230 k triangles up" in text
    assert "takes 1.09 times as long as at 0.27 M" in text


def test_the_sweep_has_a_cell_for_every_measured_pair(run):
    rows = rows_of(BLOCKS["sweep"](run))
    by_radius = {row[0]: row[3:] for row in rows}
    # Texels beyond two a pixel are not measured: r_inner 4 stops at w_s 8.
    assert [bool(cell) for cell in by_radius["4"]] == [True, True, True, False, False]
    errors = [float(cell) for cell in by_radius["16"]]
    assert errors == sorted(errors, reverse=True)
    assert by_radius["tiles"][0].endswith("MB")


def test_targets_are_met_or_missed_by_the_figures():
    run = synthetic_run()
    run.scaling[-1]["cost"]["frame_over_triangles"] = 0.02
    rows = rows_of(targets(run))
    assert rows[0][0].startswith("Igea")
    assert [row[3] for row in rows if "17 M" in row[0] and "growing" in row[0]] == ["met"]
    worse = synthetic_run()
    worse.scaling[-1]["cost"]["frame_over_triangles"] = 0.021
    assert [row[3] for row in rows_of(targets(worse)) if "growing" in row[0]] == ["missed"]
    # What moves has a row of its own.
    worse.scaling[-1]["moving"] = {"cost": {"frame_over_triangles": 0.019}, "error": synthetic_error(0.7, 0.24)}
    rows = [row for row in rows_of(targets(worse)) if "growing" in row[0]]
    assert [("moves" in row[0], row[3]) for row in rows] == [(False, "missed"), (True, "met")]
    assert "0.019 at 0.70 degrees (2.24) and 0.24 px" in rows[1][2]
    # At rest the fastest setting counts that is good enough.
    worse.scaling[-1]["coarser"] = {
        "r_inner": 32.0, "cost": {"frame_over_triangles": 0.018}, "error": synthetic_error(0.7, 0.24),
    }  # fmt: skip
    rest, moving = [row for row in rows_of(targets(worse)) if "growing" in row[0]]
    assert (rest[3], moving[3]) == ("met", "met")
    assert "0.018 at 0.70 degrees" in rest[2]
    assert "r_inner 32" in rest[2]
    assert "r_inner 32" not in moving[2]
    worse.scaling[-1]["coarser"]["error"] = synthetic_error(0.9, 0.24)
    rest, _ = [row for row in rows_of(targets(worse)) if "growing" in row[0]]
    assert "0.021" in rest[2]
    # As fast, but not at the same error.
    worse = synthetic_run()
    worse.scaling[-1]["error"]["silhouette"]["mean"] = 0.26
    assert [row[3] for row in rows_of(targets(worse)) if "growing" in row[0]] == ["missed"]
    run.scaling[-1]["error"]["normal_degrees"]["p95"] = 2.6
    assert [row[3] for row in rows_of(targets(run)) if "growing" in row[0]] == ["missed"]


def test_bounds_count_the_views_on_which_a_promise_was_kept(run):
    entry = {"model": "igea.ply", "view": "front", "goal": "1 degree", "promised": {"degrees": 1.0, "pixels": None}}
    bounds = [{**entry, "measured": {"degrees": measured, "pixels": 0.2}} for measured in (0.25, 0.5, 1.25)]
    (row,) = rows_of(BLOCKS["bounds"](Run(run.environment, run.settings, bounds=bounds)))
    assert row == ["igea.ply", "1 degree", "degrees", "", "2 of 3", "1.00", "1.25", "0.50", "1.25"]
    # Whether the goal could be promised is said where there was one.
    bounds = [entry | {"keeps": keeps} for entry, keeps in zip(bounds, (True, True, False), strict=True)]
    (row,) = rows_of(BLOCKS["bounds"](Run(run.environment, run.settings, bounds=bounds)))
    assert row[3] == "2 of 3"


def test_a_bar_in_a_cell_does_not_end_it():
    assert table(("a",), [("x | y",)]).splitlines()[-1] == "| x \\| y |"
    assert table(("a", "b"), []) == ""
