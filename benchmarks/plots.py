"""The plots of docs/benchmarks.md, drawn from a run.

Colours are those of Okabe and Ito (2008), which people with any common colour blindness tell apart; every series also
has a marker of its own and its name beside it.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from benchmarks.extras import require
from benchmarks.findings import (
    Axis,
    Point,
    main_model,
    of_method,
    pareto_front,
    points_of,
    savings,
    with_refinement,
    without_refinement,
)
from benchmarks.run_file import Run
from benchmarks.scaling import overtaking
from benchmarks.setting_text import count
from benchmarks.sweep import R_SIL

BLACK, ORANGE, SKY, GREEN, BLUE, RED, PURPLE, GREY = (
    "#000000", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00", "#CC79A7", "#767676",
)  # fmt: skip
# Colour and marker of every method; one that is missing here is drawn in grey.
STYLES = {
    "surfelscope": (BLUE, "o"),
    "not blended": (BLUE, "d"),
    "no tiles": (ORANGE, "s"),
    "one radius": (GREEN, "^"),
    "base surfels flat": (PURPLE, "P"),
    "base surfels blended": (PURPLE, "X"),
    "point sprites": (SKY, "v"),
    "printed cone test": (RED, "D"),
    "triangles": (BLACK, "*"),
    "triangles, culled": (GREY, "*"),
}
STYLE = {
    "figure.figsize": (7.2, 4.6),
    "figure.constrained_layout.use": True,
    "font.size": 10.0,
    "axes.titlesize": 11.0,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": GREY,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#E4E4E4",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 9.0,
    "lines.linewidth": 1.6,
    "lines.markersize": 5.5,
    "savefig.facecolor": "white",
    # The same run gives the same file.
    "svg.hashsalt": "surfelscope",
}


def draw_plots(run: Run, folder: Path, *, suffix: str = ".svg") -> list[Path]:
    """Draw every plot that the run has records for, and return the files.

    folder : made where it is missing
    suffix : ".svg" or ".png"
    Raises UsageError without matplotlib, OSError where a file cannot be written.
    """
    require("matplotlib", "matplotlib").use("Agg")
    folder.mkdir(parents=True, exist_ok=True)
    model = main_model(run)
    points = [] if model is None else points_of(run, model)
    drawings: dict[str, Callable[[Any], bool]] = {
        "error-over-time": lambda axes: draw_time(axes, points),
        "error-over-splats": lambda axes: draw_splats(axes, points),
        "error-over-tile-bytes": lambda axes: draw_bytes(axes, points),
        "displacement-over-primitives": lambda axes: draw_silhouette(axes, points),
        "time-over-size": lambda axes: draw_scaling(axes, run),
    }
    return [path for name, draw in drawings.items() if (path := _draw(folder / f"{name}{suffix}", draw)) is not None]


def _draw(path: Path, draw: Callable[[Any], bool]) -> Path | None:
    """Draw one plot and write it; None where there is nothing to draw."""
    pyplot = require("matplotlib.pyplot", "matplotlib")
    with pyplot.rc_context(STYLE):
        figure, axes = pyplot.subplots()
        try:
            if not draw(axes):
                return None
            buffer = io.BytesIO()
            metadata = {"Date": None} if path.suffix == ".svg" else None
            figure.savefig(buffer, format=path.suffix[1:], dpi=160, metadata=metadata)
        finally:
            pyplot.close(figure)
    path.write_bytes(buffer.getvalue())
    return path


def draw_time(axes: Any, points: Sequence[Point]) -> bool:
    """Draw the mean error of every setting over its frame time, and the Pareto front."""
    if not points:
        return False
    methods = {point.setting.method for point in points}
    for method in [*(m for m in STYLES if m in methods), *sorted(methods - STYLES.keys())]:
        _scatter(axes, of_method(points, method), method, lambda p: p.ms)
    front = pareto_front(points, lambda p: p.ms, lambda p: p.error)
    axes.step([p.ms for p in front], [p.error for p in front], where="post", color=BLUE, lw=1.2, alpha=0.6, zorder=1)
    for point in _apart([p for p in front if p.setting.r_inner > 0.0], lambda p: p.ms, lambda p: p.error):
        s = point.setting
        text = f"{s.r_sil:g} / {s.r_inner:g}" + (f" / {s.w_s}" if s.w_s else "")
        _note(axes, text, point.ms, point.error, (-6, -9), "right")
    triangles = of_method(points, "triangles")
    if triangles:
        axes.axvline(triangles[0].ms, color=BLACK, lw=0.8, ls=":", zorder=0)
    _scales(axes, "log", "log")
    axes.set_xlim(left=0.6 * min(p.ms for p in points))
    axes.set_xlabel("frame time, ms")
    axes.set_ylabel("mean normal error, degrees")
    axes.set_title(_title("Error over frame time", points))
    axes.plot([], [], color=BLUE, lw=1.2, alpha=0.6, label="Pareto front (r_sil / r_inner / w_s)")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    axes.figure.set_size_inches(8.4, 4.6)
    return True


def draw_splats(axes: Any, points: Sequence[Point]) -> bool:
    """Draw the mean error over what is drawn, with and without normal mapping, and how many times fewer that is."""
    methods = {"surfelscope": "with normal mapping", "no tiles": "without"}
    fronts = {m: pareto_front(of_method(points, m), _primitives, _error) for m in methods}
    if not all(fronts.values()):
        return False
    for method, text in methods.items():
        color, marker = STYLES[method]
        front = fronts[method]
        axes.plot([_primitives(p) for p in front], [_error(p) for p in front], color=color, marker=marker, label=text)
        _scatter(axes, of_method(points, method), None, _primitives, method=method, alpha=0.35)
    for saving in savings(fronts["surfelscope"], fronts["no tiles"], _primitives, _error, (0.5, 0.8, 1.2, 2.0)):
        axes.annotate(
            "", (saving.using, saving.error), (saving.without, saving.error),
            arrowprops={"arrowstyle": "->", "color": GREY, "lw": 1.0, "shrinkA": 0, "shrinkB": 0},
        )  # fmt: skip
        middle = (saving.using * saving.without) ** 0.5
        _note(axes, f"{saving.factor:.1f} times fewer at {saving.error:g}°", middle, saving.error, (0, 4), "center")
    _scales(axes, "log", "log")
    axes.set_xlabel("splats and leaf triangles drawn")
    axes.set_ylabel("mean normal error, degrees")
    axes.set_title(_title("What normal mapping saves", points))
    axes.legend(loc="lower left")
    return True


def draw_bytes(axes: Any, points: Sequence[Point]) -> bool:
    """Draw the mean error over the bytes of all tiles, a curve for each r_inner and a point for each w_s."""
    swept = [p for p in of_method(points, "surfelscope", r_sil=R_SIL) if p.setting.w_s]
    radii = sorted({p.setting.r_inner for p in swept})
    curves = {r: sorted(of_method(swept, "surfelscope", r_inner=r), key=lambda p: p.setting.w_s) for r in radii}
    curves = {r: curve for r, curve in curves.items() if len(curve) > 1}
    if not curves:
        return False
    colormap = require("matplotlib", "matplotlib").colormaps["viridis"]
    for index, curve in enumerate(curves.values()):
        color = colormap(0.9 * index / max(len(curves) - 1, 1))
        axes.plot([p.tile_bytes / 1e6 for p in curve], [_error(p) for p in curve], color=color, marker="o")
    for last, text in _joined({f"{r_inner:g}": curve[-1] for r_inner, curve in curves.items()}):
        _note(axes, f"r_inner {text}", last.tile_bytes / 1e6, last.error, (7, -3), "left")
    top = max(curves.values(), key=lambda curve: curve[0].error)
    for point in top:
        _note(axes, f"w_s {point.setting.w_s}", point.tile_bytes / 1e6, point.error, (0, 7), "center")
    _scales(axes, "log", "log")
    axes.set_xlabel("tiles of the whole model, MB")
    axes.set_ylabel("mean normal error, degrees")
    axes.set_title(_title(f"Which w_s pays for which r_inner (r_sil {R_SIL:g})", points))
    axes.margins(x=0.22)
    return True


def draw_silhouette(axes: Any, points: Sequence[Point]) -> bool:
    """Draw the outline's displacement over what is drawn, with a silhouette that is refined and with one radius."""
    series = {
        "refined (r_sil / r_inner)": (with_refinement(points), BLUE, "o"),
        "one radius": (without_refinement(points), RED, "D"),
        "surfels of one radius, as QSplat": (of_method(points, "one radius"), GREEN, "^"),
    }
    if not series["refined (r_sil / r_inner)"][0] or not series["one radius"][0]:
        return False
    for text, (members, color, marker) in series.items():
        if not members:
            continue
        surfels_only = text.startswith("surfels")
        front = pareto_front(members, _primitives, lambda p: p.displacement)
        xs, ys = [_primitives(p) for p in front], [p.displacement for p in front]
        axes.plot(xs, ys, color=color, marker=marker, label=text)
        for point in _apart(front, _primitives, lambda p: p.displacement):
            s = point.setting
            label = f"{s.r_sil:g}" if s.r_sil == s.r_inner else f"{s.r_sil:g} / {s.r_inner:g}"
            offset, align = ((-5, -11), "right") if surfels_only else ((5, 5), "left")
            _note(axes, label, _primitives(point), point.displacement, offset, align, color=color)
    floor = of_method(points, "triangles")
    if floor:
        axes.axhline(floor[0].displacement, color=BLACK, lw=0.8, ls=":", zorder=0)
        at = (0.01, floor[0].displacement)
        place = {"xycoords": ("axes fraction", "data"), "xytext": (0, -4), "textcoords": "offset points"}
        axes.annotate("plain triangles, one sample a pixel", at, va="top", fontsize=8.5, **place)
    _scales(axes, "log", "log")
    axes.set_xlabel("splats and leaf triangles drawn")
    axes.set_ylabel("displacement of the outline, px")
    axes.set_title(_title("What silhouette refinement saves", points))
    axes.legend(loc="upper right")
    return True


def draw_scaling(axes: Any, run: Run) -> bool:
    """Draw the frame time of splats and plain triangles over the size of the model, both axes logarithmic."""
    entries = sorted(run.scaling, key=lambda entry: entry["triangles"])
    if len(entries) < 2:
        return False
    sizes = [entry["triangles"] for entry in entries]
    # All sizes at one speed of the machine: that of the splats drawn beside each of them.
    speed = sum(entry["cost"]["yardstick_ms"]["median"] for entry in entries) / len(entries)
    frames = [entry["cost"]["frame_over_yardstick"] * speed for entry in entries]
    triangles = [frame / entry["cost"]["frame_over_triangles"] for frame, entry in zip(frames, entries, strict=True)]
    axes.plot(sizes, triangles, color=BLACK, marker="s")
    _note(axes, "plain triangles", sizes[-1], triangles[-1], (-16, -3), "right", color=BLACK, size=10.0)
    axes.plot(sizes, frames, color=BLUE, marker="o")
    _note(axes, "splats", sizes[-1], frames[-1], (-4, -15), "right", color=BLUE, size=10.0)
    crossing = overtaking(entries)
    if crossing is not None:
        axes.axvline(crossing, color=GREY, lw=0.8, ls=":", zorder=0)
        place = {"xycoords": ("data", "axes fraction"), "xytext": (5, 0), "textcoords": "offset points"}
        axes.annotate(f"splats are faster\nfrom {count(crossing)} triangles", (crossing, 0.88), fontsize=9, **place)
    last = entries[-1]["cost"]["frame_over_triangles"]
    _note(axes, f"{1.0 / last:.0f} times", sizes[-1], (frames[-1] * triangles[-1]) ** 0.5, (-6, -4), "right")
    axes.annotate(
        "", (sizes[-1], frames[-1]), (sizes[-1], triangles[-1]),
        arrowprops={"arrowstyle": "->", "color": GREY, "lw": 1.0, "shrinkA": 5, "shrinkB": 5},
    )  # fmt: skip
    _scales(axes, "log", "log", x_text=count)
    axes.set_xlabel("triangles of the model")
    axes.set_ylabel("frame time, ms")
    axes.set_title("Frame time over the size of the model: one surface, one view, one setting")
    return True


def _primitives(point: Point) -> float:
    return point.primitives


def _error(point: Point) -> float:
    return point.error


def _title(text: str, points: Sequence[Point]) -> str:
    setting = points[0].setting
    views = setting.view.split(", ")
    return f"{text}: {setting.model}, " + (f"view {views[0]}" if len(views) == 1 else f"mean of {len(views)} views")


def _scatter(
    axes: Any, points: Iterable[Point], label: str | None, x: Axis, *, method: str | None = None, alpha: float = 1.0
) -> None:
    """Draw the points of a method, without a line."""
    points = list(points)
    color, marker = STYLES.get(method or label or "", (GREY, "o"))
    size = 11.0 if marker == "*" else 6.0
    axes.plot(
        [x(p) for p in points], [p.error for p in points], ls="", marker=marker, color=color, ms=size, alpha=alpha,
        mec="white", mew=0.5, label=label,
    )  # fmt: skip


def _apart(points: Iterable[Point], x: Axis, y: Axis, factor: float = 1.2) -> list[Point]:
    """Return those of the points that differ by a factor in x or y from all that were taken before them."""
    taken: list[Point] = []
    for point in points:
        if all(max(x(point) / x(t), x(t) / x(point), y(point) / y(t), y(t) / y(point)) > factor for t in taken):
            taken.append(point)
    return taken


def _joined(ends: dict[str, Point]) -> list[tuple[Point, str]]:
    """Return where to write the names of curves: those that end at about the same place share one text."""
    groups: list[list[str]] = []
    for text in sorted(ends, key=lambda text: ends[text].error):
        first = ends[groups[-1][0]] if groups else None
        if first and first.tile_bytes == ends[text].tile_bytes and ends[text].error < 1.05 * first.error:
            groups[-1].append(text)
        else:
            groups.append([text])
    return [(ends[group[0]], ", ".join(group)) for group in groups]


def _note(
    axes: Any, text: str, x: float, y: float, offset: tuple[int, int], align: str, *, color: str = "#303030",
    size: float = 8.5,
) -> None:  # fmt: skip
    """Write beside a point; the offset is in points of type."""
    axes.annotate(text, (x, y), xytext=offset, textcoords="offset points", ha=align, fontsize=size, color=color)


def _scales(axes: Any, x: str, y: str, x_text: Callable[[float], str] | None = None) -> None:
    """Set the scales; logarithmic axes get plain numbers, the more the fewer powers of ten."""
    ticker = require("matplotlib.ticker", "matplotlib")
    axes.set_xscale(x)
    axes.set_yscale(y)
    for axis, scale, text in ((axes.xaxis, x, x_text), (axes.yaxis, y, None)):
        if scale != "log":
            continue
        low, high = axis.get_view_interval()
        many, some = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0), (1.0, 2.0, 5.0)
        subs = many if high / low < 12.0 else some if high / low < 300.0 else (1.0,)
        axis.set_major_locator(ticker.LogLocator(subs=subs))
        axis.set_minor_locator(ticker.NullLocator())
        write = text or count
        axis.set_major_formatter(ticker.FuncFormatter(lambda value, _, write=write: write(value)))
