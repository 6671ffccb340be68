"""The run itself: every setting that has no record yet is measured, and recorded at once."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import moderngl

from app.errors import OutputError, UsageError
from benchmarks.environment import describe_environment
from benchmarks.error import measure, normal_error_image
from benchmarks.heat_map import draw_heat_map
from benchmarks.measurement import Picture, Workbench
from benchmarks.methods import METHODS
from benchmarks.options import BenchOptions
from benchmarks.paper_table import MODEL as PAPER_MODEL
from benchmarks.paper_table import VIEW as PAPER_VIEW
from benchmarks.paper_table import measure_paper_table
from benchmarks.picture_quality import picture_quality
from benchmarks.progress import Progress
from benchmarks.reference import Reference
from benchmarks.resume import check_same, check_same_model
from benchmarks.run_file import Json, Record, Run, Setting, read_run, write_run
from benchmarks.scaling import ScalingError, measure_apart, missing_sizes
from benchmarks.shading import PictureShader
from benchmarks.subject import Subject
from benchmarks.sweep import R_INNER, R_SIL, TEXELS, settings_of, swept_views
from benchmarks.truth_cache import TruthCache
from benchmarks.views import VIEW_ANGLE_DEGREES, views_of
from hierarchy.view import View

# Kinds of steps.
RECORD, CAST, MAP, TABLE, SIZE = "record", "cast", "map", "table", "size"
FRONT = "front"
# A surface of the scaling from its making to its measuring, on two cores.
SECONDS_A_TRIANGLE = 1e-5


@dataclass(frozen=True, eq=False)
class Plan:
    """What is to be measured of a subject: settings without a record, by the names of its views."""

    subject: Subject
    views: dict[str, View]
    truths: TruthCache
    settings: list[Setting]
    paper: bool

    @property
    def steps(self) -> Counter[str]:
        """The work by its kinds."""
        uncast = {setting.view for setting in self.settings if not self.truths.holds(self.views[setting.view])}
        return Counter(
            {RECORD: len(self.settings), CAST: len(uncast), MAP: int(bool(self.settings)), TABLE: int(self.paper)}
        )


def measure_all(options: BenchOptions, ctx: moderngl.Context) -> Run:
    """Measure what the command line asks for and the run file does not have; return the whole run.

    The file is put anew after every record, so that an end at any moment loses one.
    Raises RunFileError, UsageError, OutputError, ModelError or GraphicsError, each with one line.
    """
    run = open_run(options, ctx)
    shader = PictureShader(ctx)
    subjects = _subjects(options)
    plans = [_plan(subject, options, run, shader, first=subject is subjects[0]) for subject in subjects]
    subjects.clear()
    sizes = missing_sizes(run.scaling) if options.scaling else []
    guesses = {f"{SIZE} {size}": size * SECONDS_A_TRIANGLE for size in sizes}
    progress = Progress(sum((plan.steps for plan in plans), Counter(guesses.keys())), guesses)
    # What cannot be written is better known now than after the first record.
    write_run(options.output, run)
    while plans:
        # What is done with is let go of.
        _measure_subject(plans.pop(0), options, ctx, shader, run, progress)
    shader.release()
    for size in sizes:
        progress.begin(f"{SIZE} {size}", f"surface of {size} triangles")
        try:
            run.scaling.append(measure_apart(size, options.resolution, options.rounds, options.samples))
        except ScalingError as error:
            # A machine with little memory has the smaller ones.
            progress.warn(str(error))
        write_run(options.output, run)
    progress.close()
    return run


def open_run(options: BenchOptions, ctx: moderngl.Context) -> Run:
    """Return the run to go on with, or a new one; raises RunFileError where what is there is of another kind."""
    environment = describe_environment(ctx)
    settings: Json = {
        "resolution": list(options.resolution),
        "rounds": options.rounds,
        "samples": options.samples,
        "view_angle": VIEW_ANGLE_DEGREES,
    }
    if options.restart or not options.output.exists():
        return Run(environment, settings)
    run = read_run(options.output)
    check_same(options.output, run, environment, settings)
    return run


def _subjects(options: BenchOptions) -> list[Subject]:
    """Load the models before anything is measured, so that a bad one is known at once."""
    subjects = [Subject(path) for path in dict.fromkeys(options.models)]
    for name, count in Counter(subject.name for subject in subjects).items():
        if count > 1:
            raise UsageError(f"two models are called {name}: measure them in runs of their own")
    return subjects


def _plan(subject: Subject, options: BenchOptions, run: Run, shader: PictureShader, *, first: bool) -> Plan:
    check_same_model(options.output, run, subject.name, subject.info["content"])
    views = views_of(subject.mesh, options.resolution)
    wanted = settings_of(
        subject.name,
        views,
        swept_views(options.views, views),
        closed=subject.mesh.closed,
        quick=options.quick,
        everywhere=first or not options.quick,
    )
    done = run.measured()
    truths = TruthCache(options.output.parent / "references", subject, shader, options.samples)
    paper = subject.name == PAPER_MODEL and not run.paper
    return Plan(subject, views, truths, [setting for setting in wanted if setting not in done], paper)


def _measure_subject(
    plan: Plan, options: BenchOptions, ctx: moderngl.Context, shader: PictureShader, run: Run, progress: Progress
) -> None:
    """Measure all settings of a plan, draw its heat map, and measure the paper's table where it is of this model."""
    if not plan.settings and not plan.paper:
        return
    subject = plan.subject
    bench = Workbench(ctx, subject, shader, options.resolution)
    for setting in plan.settings:
        view = plan.views[setting.view]
        if not plan.truths.holds(view):
            progress.begin(CAST, f"{subject.name}, {setting.view}: casting rays")
        truth = plan.truths.get(view)
        progress.begin(RECORD, describe(setting))
        cost, picture = bench.measure(METHODS[setting.method], setting, view, options.rounds)
        run.records.append(Record(setting, cost, error_of(picture, truth)))
        _keep(run, subject)
        write_run(options.output, run)
    if options.plots:
        progress.begin(MAP, f"{subject.name}: heat map of the error")
        _draw_map(bench, plan, options)
    if plan.paper:
        progress.begin(TABLE, f"{subject.name}: the paper's figure 10")
        run.paper = measure_paper_table(bench, plan.views[PAPER_VIEW], options.rounds)
        _keep(run, subject)
        write_run(options.output, run)
    progress.end()
    bench.release()


def _draw_map(bench: Workbench, plan: Plan, options: BenchOptions) -> None:
    """Draw where the error of the viewer's own setting sits, seen from the front."""
    name = bench.subject.name
    setting = Setting(name, FRONT, "surfelscope", R_SIL, R_INNER, TEXELS)
    view = plan.views[FRONT]
    _, picture = bench.measure(METHODS[setting.method], setting, view, 1)
    degrees = normal_error_image(picture.normal, picture.coverage, plan.truths.get(view))
    path = options.plot_folder / f"heat-map-{Path(name).stem}.png"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        draw_heat_map(path, picture.color, degrees, f"{name}, r_sil {R_SIL:g}, r_inner {R_INNER:g}, w_s {TEXELS}")
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from error


def error_of(picture: Picture, truth: Reference) -> Json:
    """Return what separates a picture from the truth, for a record."""
    assert truth.picture is not None
    geometry = measure(picture.normal, picture.depth, picture.coverage, truth)
    return geometry.to_dict() | picture_quality(picture.color, truth.picture).to_dict()


def _keep(run: Run, subject: Subject) -> None:
    """Add to the run what the subject knows by now; what an earlier part of the run measured stays."""
    kept = run.models.setdefault(subject.name, {})
    for name, value in subject.info.items():
        if isinstance(value, dict):
            kept[name] = {**value, **kept.get(name, {})}
        else:
            kept.setdefault(name, value)


def describe(setting: Setting) -> str:
    """Return a setting in words."""
    words = f"{setting.model}, {setting.view}: {setting.method}"
    if METHODS[setting.method].radii:
        words += f", r_sil {setting.r_sil:g}, r_inner {setting.r_inner:g}"
    return words + (f", w_s {setting.w_s}" if setting.w_s else "")
