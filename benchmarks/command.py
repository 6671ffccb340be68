"""`surfelscope bench`: measure what a run file does not have yet, then show it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from app.errors import OutputError, UsageError
from app.export import check_writable
from benchmarks.extras import require
from benchmarks.options import BenchOptions, parse_bench_options
from benchmarks.run_file import Run, RunFileError, read_run, table_path

# Modules and what the package index calls them.
EXTRAS = {
    "embreex": "embreex",
    "flip_evaluator": "flip-evaluator",
    "matplotlib": "matplotlib",
    "skimage": "scikit-image",
}


def run_bench(arguments: Sequence[str]) -> int:
    """Run the command line behind `surfelscope bench`.

    Return 1 where a comparison was asked for and found something slower or worse, else 0.
    Raises UsageError, OutputError, ModelError, ContextError or GraphicsError, each with one line.
    """
    options = parse_bench_options(arguments)
    for module, package in EXTRAS.items():
        require(module, package)
    make_folder(options.output)
    check_inputs(options)
    from benchmarks.bench import measure_all
    from renderer.context import create_headless_context

    try:
        ctx = create_headless_context()
        try:
            run = measure_all(options, ctx)
        finally:
            ctx.release()
        for path in [options.output, table_path(options.output), *show(run, options)]:
            print(path)
        return compare_with(options.compare, options.output) if options.compare else 0
    except RunFileError as error:
        raise UsageError(str(error)) from error


def check_inputs(options: BenchOptions) -> None:
    """Find out before the measuring what can be shown after it; raises UsageError or OutputError."""
    if options.compare:
        try:
            read_run(options.compare)
        except RunFileError as error:
            raise UsageError(str(error)) from error
    if options.report:
        if not options.report.is_file():
            raise UsageError(f"{options.report}: there is no such page")
        check_writable(options.report)


def show(run: Run, options: BenchOptions) -> list[Path]:
    """Draw the plots and fill in the page; return the files written."""
    if options.report:
        from benchmarks.report import write_report

        return write_report(run, options.report)
    if not options.plots:
        return []
    from benchmarks.plots import draw_plots

    try:
        return draw_plots(run, options.plot_folder)
    except OSError as error:
        raise OutputError(f"{options.plot_folder}: {error.strerror or error}") from error


def compare_with(old: Path, new: Path) -> int:
    """Print what became slower or worse; return the exit status."""
    from benchmarks.compare import compare

    comparison = compare(old, new)
    print(comparison.text())
    return comparison.status


def make_folder(output: Path) -> None:
    """Make the folder of an output; raises OutputError where nothing can be written to it."""
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{output}: cannot be written ({error.strerror})") from error
    check_writable(output)
