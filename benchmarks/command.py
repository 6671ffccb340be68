"""`surfelscope bench`: measure what a run file does not have yet, then show it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from app.errors import OutputError, UsageError
from app.export import check_writable
from benchmarks.extras import require
from benchmarks.options import parse_bench_options
from benchmarks.run_file import RunFileError, table_path

# Modules and what the package index calls them.
EXTRAS = {
    "embreex": "embreex",
    "flip_evaluator": "flip-evaluator",
    "matplotlib": "matplotlib",
    "skimage": "scikit-image",
}


def run_bench(arguments: Sequence[str]) -> None:
    """Run the command line behind `surfelscope bench`.

    Raises UsageError, OutputError, ModelError, ContextError or GraphicsError, each with one line.
    """
    options = parse_bench_options(arguments)
    for module, package in EXTRAS.items():
        require(module, package)
    make_folder(options.output)
    from benchmarks.bench import measure_all
    from renderer.context import create_headless_context

    try:
        ctx = create_headless_context()
        try:
            measure_all(options, ctx)
        finally:
            ctx.release()
    except RunFileError as error:
        raise UsageError(str(error)) from error
    print(f"{options.output} and {table_path(options.output)}")


def make_folder(output: Path) -> None:
    """Make the folder of an output; raises OutputError where nothing can be written to it."""
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{output}: cannot be written ({error.strerror})") from error
    check_writable(output)
