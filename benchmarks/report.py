"""Put the tables of a run into a page between markers, and draw its plots; the prose around them stays.

<!-- bench:scaling -->
what stands here is replaced
<!-- /bench:scaling -->
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from app.errors import OutputError, UsageError
from benchmarks import tables
from benchmarks.plots import draw_plots
from benchmarks.run_file import Run
from benchmarks.targets_table import targets

BLOCKS: dict[str, Callable[[Run], str]] = {
    "machine": tables.machine,
    "targets": targets,
    "methods": tables.methods,
    "sweep": tables.sweep,
    "fitted-tiles": tables.fitted_tiles,
    "normal-mapping": tables.normal_mapping,
    "silhouette": tables.silhouette,
    "scaling": tables.scaling,
    "paper": tables.paper,
    "bounds": tables.bounds,
    "views": tables.views,
}
NOTHING = "*Not measured in this run.*"

_MARKER = re.compile(r"^<!-- (/?)bench:([\w-]+) -->[ \t]*$", re.MULTILINE)


def write_report(run: Run, page: Path) -> list[Path]:
    """Fill in the page's tables and draw the plots into the folder `plots` beside it; return the files written.

    Raises UsageError where the page's markers do not pair up or matplotlib is missing, OutputError where a file cannot
    be read or written.
    """
    try:
        text = page.read_text("utf-8")
        filled = fill_in(text, run)
        plots = draw_plots(run, page.parent / "plots")
        page.write_text(filled, "utf-8")
    except ValueError as error:
        raise UsageError(f"{page}: {error}") from error
    except OSError as error:
        raise OutputError(f"{error.filename or page}: {error.strerror or error}") from error
    return [page, *plots]


def fill_in(text: str, run: Run) -> str:
    """Return the page with what stands between markers replaced.

    Raises ValueError where a marker has an unknown name, or is not closed before the next one.
    """
    parts = []
    done = 0
    markers = list(_MARKER.finditer(text))
    if len(markers) % 2:
        raise ValueError(f"the marker {markers[-1].group(0).strip()} stands alone")
    for opening, closing in zip(markers[::2], markers[1::2], strict=True):
        name = opening.group(2)
        if opening.group(1) or not closing.group(1) or closing.group(2) != name:
            raise ValueError(f"the marker {opening.group(0).strip()} is followed by {closing.group(0).strip()}")
        if name not in BLOCKS:
            raise ValueError(f"there is no table {name!r}; there are {', '.join(BLOCKS)}")
        parts += [text[done : opening.end()], "\n\n", BLOCKS[name](run) or NOTHING, "\n\n"]
        done = closing.start()
    return "".join([*parts, text[done:]])
