"""The tables of docs/benchmarks.md, in Markdown, made from a run. A table that the run has nothing for is empty."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from benchmarks.findings import (
    Point,
    main_model,
    of_method,
    points_of,
    savings,
    with_refinement,
    without_refinement,
)
from benchmarks.methods import METHODS
from benchmarks.run_file import Json, Run
from benchmarks.scaling import growth, overtaking
from benchmarks.setting_text import count
from benchmarks.sweep import R_INNER, R_SIL, TEXELS

# Errors and displacements at which methods are compared.
DEGREES = (0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.5, 2.0, 3.0)
PIXELS = (0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.6, 0.8)


def machine(run: Run) -> str:
    """Return where and how the run was measured."""
    e, s = run.environment, run.settings
    commit = f"commit {e['commit']}{' and changes' if e.get('dirty') else ''}" if e.get("commit") else "no commit"
    memory = f", {e['memory_mb'] / 1e3:.0f} GB" if e.get("memory_mb") else ""
    rows = [
        ("measured", f"{str(e['date'])[:10]}, {commit}, code {e['code']}"),
        ("machine", f"{e['cpu']}, {e['cores']} cores{memory}, {e['os']}"),
        ("OpenGL", f"{e['gl_renderer']}, {e['gl_version']}"),
        ("Python", f"{e['python']}; numpy {e['numpy']}, numba {e['numba']}, moderngl {e['moderngl']}"),
        ("pictures", f"{s['resolution'][0]} x {s['resolution'][1]}, view angle {s['view_angle']:g} degrees"),
        ("times", f"medians of {s['rounds']} rounds, splats and plain triangles drawn in turn"),
        ("truth", f"ray casting of the mesh, {s['samples']} x {s['samples']} samples a pixel"),
    ]
    return table(("", ""), rows)


def methods(run: Run) -> str:
    """Return all methods side by side, each at the viewer's own radii where it has any."""
    points = _main_points(run)
    rows: list[tuple[str, ...]] = []
    for name, method in METHODS.items():
        radius = {"r_sil": R_SIL} if method.radii else {}
        found = of_method(points, name, **radius)
        if method.tiles:
            found = of_method(found, name, w_s=TEXELS)
        if method.radii:
            found = of_method(found, name, r_inner=R_INNER) or of_method(found, name, r_inner=R_SIL)
        rows += [(name, *_setting_cells(p), *_cost_cells(p), *_error_cells(p), *_quality(p)) for p in found]
    header = ("", "r_sil", "r_inner", "w_s", "splats", "triangles", "ms", "/ triangles", "mean", "95 %", "outline",
              "holes", "PSNR", "SSIM", "FLIP", "GPU MB")  # fmt: skip
    return table(header, rows)


def sweep(run: Run) -> str:
    """Return the mean error for every r_inner and w_s at the viewer's r_sil, and what is drawn."""
    points = [p for p in of_method(_main_points(run), "surfelscope", r_sil=R_SIL) if p.setting.w_s]
    texels = sorted({p.setting.w_s for p in points})
    rows = []
    for r_inner in sorted({p.setting.r_inner for p in points}):
        row = {p.setting.w_s: p for p in of_method(points, "surfelscope", r_inner=r_inner)}
        first = next(iter(row.values()))
        times = [point.ratio for point in row.values()]
        rows.append(
            (f"{r_inner:g}", _number(first.primitives), _range(times),
             *(f"{row[w].error:.2f}" if w in row else "" for w in texels))
        )  # fmt: skip
    sizes = [f"{next(p.tile_bytes for p in points if p.setting.w_s == w) / 1e6:.3g} MB" for w in texels]
    header = ("r_inner", "primitives", "frame / triangles", *(f"w_s {w}" for w in texels))
    return table(header, [*rows, ("tiles", "", "", *sizes)]) if rows else ""


def fitted_tiles(run: Run) -> str:
    """Return bytes and error of tiles of as few texels as will do beside those of tiles of one size, of every model."""
    pairs = [
        (model, one, fitted)
        for model in run.models
        for one in of_method(points_of(run, model), "tiles of one size")
        for fitted in of_method(
            points_of(run, model), "surfelscope",
            r_sil=one.setting.r_sil, r_inner=one.setting.r_inner, w_s=one.setting.w_s,
        )
    ]  # fmt: skip
    rows = [
        (model, f"{p.setting.w_s}", f"{one.error:.3f}", f"{p.error:.3f}",
         *_saved(one.tile_bytes, p.tile_bytes), *_saved(one.cut_tile_bytes, p.cut_tile_bytes))
        for model, one, p in pairs
    ]  # fmt: skip
    header = ("", "w_s", "mean error, one size", "fitted", "all tiles, one size", "fitted", "of it",
              "drawn, one size", "fitted", "of it")  # fmt: skip
    return table(header, rows) if rows else ""


def _saved(before: float, after: float) -> tuple[str, str, str]:
    share = f"{after / before:.3f}" if before > 0.0 else ""
    return f"{before / 1e6:.3g} MB", f"{after / 1e6:.3g} MB", share


def normal_mapping(run: Run) -> str:
    """Return what is drawn with and without normal mapping for the same mean error."""
    points = _main_points(run)
    using, without = of_method(points, "surfelscope"), of_method(points, "no tiles")
    rows = [
        (f"{s.error:g}", _number(s.using), _number(s.without), f"{s.factor:.1f}")
        for s in savings(using, without, lambda p: p.primitives, lambda p: p.error, DEGREES)
    ]
    return table(("mean error, degrees", "with tiles", "without", "times fewer"), rows)


def silhouette(run: Run) -> str:
    """Return what is drawn with a refined silhouette and with one radius for the same displacement of the outline."""
    points = _main_points(run)
    refined, one = with_refinement(points), without_refinement(points)
    rows = [
        (f"{s.error:g}", _number(s.using), _number(s.without), f"{s.factor:.1f}")
        for s in savings(refined, one, lambda p: p.primitives, lambda p: p.displacement, PIXELS)
    ]
    return table(("displacement, px", "silhouette refined", "one radius", "times fewer"), rows)


def _moving(entry: Json) -> str:
    """Say what a frame takes of the triangles' time while the model moves."""
    return f"{entry['moving']['cost']['frame_over_triangles']:.3g}" if "moving" in entry else ""


def scaling(run: Run) -> str:
    """Return what every size of the growing surface costs, and from where on splats are faster."""
    rows = []
    for e in sorted(run.scaling, key=lambda entry: entry["triangles"]):
        c, error = e["cost"], e["error"]
        rows.append(
            (_number(e["triangles"]), _number(c["splats"] + c["triangles"]), f"{c['frame_ms']['median']:.0f}",
             f"{c['triangles_ms']['median']:.0f}", f"{c['frame_over_triangles']:.3g}", _moving(e),
             f"{c['frame_over_yardstick']:.2f}", f"{error['normal_degrees']['mean']:.2f}",
             _optional(error["silhouette"]["mean"], "{:.2f}"), f"{e['build_s']:.1f}",
             f"{e['hierarchy_bytes'] / 1e6:.0f}", f"{e['build_peak_mb']:.0f}", f"{c['peak_memory_mb']:.0f}")
        )  # fmt: skip
    header = ("triangles", "primitives", "frame ms", "triangles ms", "/ triangles", "moving", "/ 0.27 M", "mean error",
              "outline px", "build s", "hierarchy MB", "build peak MB", "peak MB")  # fmt: skip
    crossing, grown = overtaking(run.scaling), growth(run.scaling)
    said = []
    if crossing is not None:
        said.append(
            f"Splats are faster than plain triangles from about {count(float(f'{crossing:.2g}'))} triangles up."
        )
    if grown is not None:
        said.append(f"At the largest size the frame takes {grown:.2f} times as long as at 0.27 M.")
    return "\n\n".join(part for part in (table(header, rows), " ".join(said)) if part)


def paper(run: Run) -> str:
    """Return figure 10 of the paper, measured anew, beside what it printed."""
    rows = [
        (f"{row['w_s']}", "yes" if row["tiles"] else "no", f"{row['texels'] / 1e6:.2f}",
         f"{row['paper']['texels'] / 1e6:.2f}", _number(row["surfels"]), _number(row["paper"]["surfels"]),
         f"{row['fps']:.0f}", f"{row['paper']['fps']:.0f}")
        for row in run.paper
    ]  # fmt: skip
    header = ("w_s = r_inner", "normal mapping", "map, M texels", "paper", "surfels", "paper", "fps", "paper")
    return table(header, rows)


def views(run: Run) -> str:
    """Return the viewer's own setting on every view of the main model."""
    model = main_model(run)
    rows = []
    for record in run.records:
        s = record.setting
        if (s.model, s.method, s.r_sil, s.r_inner, s.w_s) == (model, "surfelscope", R_SIL, R_INNER, TEXELS):
            value = record.value
            rows.append(
                (s.view, _number(value("cost.splats")), _number(value("cost.triangles")),
                 f"{value('cost.frame_over_triangles'):.2f}",
                 *(f"{value(f'error.normal_degrees.{k}'):.2f}" for k in ("mean", "p95", "max")),
                 _nan(value("error.silhouette.mean"), "{:.2f}"), _nan(value("error.silhouette.hausdorff"), "{:.1f}"),
                 f"{value('error.holes'):.0f}")
            )  # fmt: skip
    header = ("view", "splats", "triangles", "/ triangles", "mean", "95 %", "max", "outline px", "Hausdorff", "holes")
    return table(header, rows)


def bounds(run: Run) -> str:
    """Return the promised errors beside the measured ones, a row a model and goal; the worst view counts.

    Entries of a run file's "bounds": {"model", "view", "goal": text, "promised": {"degrees", "pixels"},
    "measured": {"degrees", "pixels"}}; a number that was not promised is None.
    """
    rows = []
    groups: dict[tuple[str, str], list[Json]] = {}
    for entry in run.bounds:
        groups.setdefault((entry["model"], entry["goal"]), []).append(entry)
    for (model, goal), entries in groups.items():
        for unit in ("degrees", "pixels"):
            pairs = [(e["promised"].get(unit), e["measured"].get(unit)) for e in entries]
            known = [(p, m) for p, m in pairs if p is not None and m is not None]
            if known:
                kept = sum(m <= p for p, m in known)
                shares = sorted(m / p for p, m in known if p > 0.0)
                worst = max(known, key=lambda pair: pair[1] / pair[0] if pair[0] > 0.0 else math.inf)
                rows.append(
                    (model, goal, unit, _could_be_promised(entries), f"{kept} of {len(known)}", f"{worst[0]:.2f}",
                     f"{worst[1]:.2f}", f"{shares[len(shares) // 2]:.2f}" if shares else "",
                     f"{shares[-1]:.2f}" if shares else "")
                )  # fmt: skip
    header = ("model", "goal", "", "goal could be promised", "promise kept", "tightest: promised", "measured",
              "measured / promised: median", "largest")  # fmt: skip
    return table(header, rows)


def _could_be_promised(entries: Sequence[Json]) -> str:
    """Return in how many pictures the promise lay within the goal; nothing where there was no goal."""
    asked = [entry["keeps"] for entry in entries if "keeps" in entry]
    return f"{sum(asked)} of {len(asked)}" if asked else ""


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table, nothing where there are no rows; a bar in a cell stays a bar."""
    lines = ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows]
    if not lines:
        return ""
    return "\n".join(["| " + " | ".join(header) + " |", "|" + "---|" * len(header), *lines])


def _main_points(run: Run) -> list[Point]:
    model = main_model(run)
    return [] if model is None else points_of(run, model)


def _setting_cells(point: Point) -> tuple[str, str, str]:
    s = point.setting
    return f"{s.r_sil:g}" if s.r_sil else "", f"{s.r_inner:g}" if s.r_inner else "", f"{s.w_s}" if s.w_s else ""


def _cost_cells(point: Point) -> tuple[str, str, str, str]:
    return _number(point.splats), _number(point.triangles), f"{point.ms:.0f}", f"{point.ratio:.2f}"


def _error_cells(point: Point) -> tuple[str, str, str, str]:
    holes = point.mean("error.holes")
    return f"{point.error:.2f}", f"{point.p95:.2f}", _nan(point.displacement, "{:.2f}"), _nan(holes, "{:.0f}")


def _quality(point: Point) -> tuple[str, ...]:
    formats = {"error.psnr": "{:.1f}", "error.ssim": "{:.3f}", "error.flip": "{:.3f}"}
    cells = [_nan(point.mean(path), text) for path, text in formats.items()]
    return *cells, _nan(point.mean("cost.gpu_bytes") / 1e6, "{:.0f}")


def _nan(value: float, text: str) -> str:
    return "" if math.isnan(value) else text.format(value)


def _optional(value: float | None, text: str) -> str:
    return "" if value is None else text.format(value)


def _number(value: float) -> str:
    return f"{value:,.0f}"


def _range(values: Sequence[float]) -> str:
    low, high = f"{min(values):.2f}", f"{max(values):.2f}"
    return low if low == high else f"{low} to {high}"
