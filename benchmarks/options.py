"""The command line of `surfelscope bench`."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from app.errors import UsageError
from benchmarks.subject import BUILT_IN

MAX_RESOLUTION = 8192


@dataclass(frozen=True)
class BenchOptions:
    """What to measure.

    models : paths of meshes, None: the built-in model
    quick : sweep in few steps
    views : names of `sweep.VIEW_SETS`: the views that the whole sweep is measured on
    output : the run file
    restart : begin anew where the run file is there
    resolution : width and height in pixels
    rounds : frames of which the medians are taken
    samples : rays along one side of a pixel
    scaling : measure frame time against model size, too
    plots : draw plots of the run
    report : a page whose tables are filled in; its plots lie beside it
    compare : an older run file to compare with
    """

    models: tuple[Path | None, ...] = (None,)
    quick: bool = False
    views: str = "all"
    output: Path = Path("bench/run.json")
    restart: bool = False
    resolution: tuple[int, int] = (1024, 1024)
    rounds: int = 9
    samples: int = 4
    scaling: bool = True
    plots: bool = True
    report: Path | None = None
    compare: Path | None = None

    @property
    def plot_folder(self) -> Path:
        """Where plots go: beside the page, or beside the run file."""
        return (self.report or self.output).parent / "plots"


class _Parser(argparse.ArgumentParser):
    """Answers a bad command line with one line instead of the whole usage."""

    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message} (see {self.prog} --help)")


def parse_bench_options(arguments: Sequence[str]) -> BenchOptions:
    """Read what follows `surfelscope bench`; raises UsageError. `--help` prints and raises SystemExit(0)."""
    values = vars(_parser().parse_args(list(arguments)))
    models = tuple(None if name == BUILT_IN else Path(name) for name in values.pop("models") or [BUILT_IN])
    views = values.pop("views", "one" if values.get("quick") else "all")
    return BenchOptions(models=models, views=views, **values)


def _parser() -> _Parser:
    parser = _Parser(
        prog="surfelscope bench",
        description="Measure run time against error, for settings and methods, and write what was found as JSON, as a "
        "table and as plots. It can be interrupted: the same command goes on where it stopped.",
        argument_default=argparse.SUPPRESS,
    )
    parser.add_argument(
        "models", nargs="*", metavar="MODEL", default=[], help=f"meshes to measure; {BUILT_IN}: the meteoroid (default)"
    )
    parser.add_argument("--output", metavar="FILE.json", type=_output, help="the run (bench/run.json)")
    parser.add_argument("--restart", action="store_true", help="begin anew instead of going on")
    parser.add_argument("--compare", metavar="OLD.json", type=Path, help="say what became slower or worse since")
    sweep = parser.add_argument_group("what is measured")
    sweep.add_argument("--quick", action="store_true", help="fewer settings, and few views: minutes, not hours")
    sweep.add_argument(
        "--views", choices=("one", "few", "all"), help="views of the whole sweep (all; with --quick: one)"
    )
    sweep.add_argument("--resolution", metavar="W,H", type=_resolution, help="size of the pictures (1024,1024)")
    sweep.add_argument("--rounds", metavar="N", type=_whole(1, 1000), help="frames to take the medians of (9)")
    sweep.add_argument("--samples", metavar="N", type=_whole(1, 16), help="rays along one side of a pixel (4)")
    sweep.add_argument("--no-scaling", dest="scaling", action="store_false", help="leave out the growing surface")
    parser.add_argument("--no-plots", dest="plots", action="store_false", help="leave out the plots")
    parser.add_argument("--report", metavar="PAGE.md", type=Path, help="fill in the tables of a page, draw its plots")
    return parser


def _whole(least: int, most: int) -> Callable[[str], int]:
    def parse(text: str) -> int:
        if not text.isdecimal() or not least <= int(text) <= most:
            raise argparse.ArgumentTypeError(f"{text!r} is no whole number between {least} and {most}")
        return int(text)

    return parse


def _resolution(text: str) -> tuple[int, int]:
    parts = text.split(",")
    if len(parts) != 2 or not all(part.isdecimal() and 8 <= int(part) <= MAX_RESOLUTION for part in parts):
        raise argparse.ArgumentTypeError(f"{text!r} is no width and height W,H between 8 and {MAX_RESOLUTION}")
    return int(parts[0]), int(parts[1])


def _output(text: str) -> Path:
    path = Path(text)
    if path.suffix != ".json":
        raise argparse.ArgumentTypeError(f"{text!r} does not end in .json")
    return path
