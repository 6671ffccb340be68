"""The run itself: every setting that has no record yet is measured, and recorded at once."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import moderngl

from app.errors import OutputError
from benchmarks.environment import describe_environment
from benchmarks.error import measure, normal_error_image
from benchmarks.heat_map import draw_heat_map
from benchmarks.measurement import Picture, Workbench
from benchmarks.methods import METHODS
from benchmarks.options import BenchOptions
from benchmarks.paper_table import VIEW as PAPER_VIEW
from benchmarks.paper_table import measure_paper_table
from benchmarks.picture_quality import picture_quality
from benchmarks.plan import CAST, GOAL, MAP, RECORD, TABLE, Plan, load_subjects, plan_of
from benchmarks.progress import Progress
from benchmarks.promise_check import METHOD as PROMISED_METHOD
from benchmarks.promise_check import check_goal, check_record, describe_goal
from benchmarks.reference import Reference
from benchmarks.resume import check_same
from benchmarks.run_file import Json, Record, Run, Setting, read_run, write_run
from benchmarks.scaling import ScalingError, measure_apart, missing_sizes
from benchmarks.setting_text import describe
from benchmarks.shading import PictureShader
from benchmarks.subject import Subject
from benchmarks.sweep import R_INNER, R_SIL, TEXELS, is_usual
from benchmarks.views import VIEW_ANGLE_DEGREES
from hierarchy.view import View

# A kind of steps besides those of a plan, and what a surface of the scaling takes from its making on, on two cores.
SIZE = "size"
SECONDS_A_TRIANGLE = 1e-5
FRONT = "front"


def measure_all(options: BenchOptions, ctx: moderngl.Context) -> Run:
    """Measure what the command line asks for and the run file does not have; return the whole run.

    The file is put anew after every record, so that an end at any moment loses one.
    Raises RunFileError, UsageError, OutputError, ModelError or GraphicsError, each with one line.
    """
    run = open_run(options, ctx)
    shader = PictureShader(ctx)
    subjects = load_subjects(options)
    plans = [plan_of(subject, options, run, shader, first=subject is subjects[0]) for subject in subjects]
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


def _measure_subject(
    plan: Plan, options: BenchOptions, ctx: moderngl.Context, shader: PictureShader, run: Run, progress: Progress
) -> None:
    """Do all that is left of a plan."""
    if not plan.steps.total():
        return
    subject = plan.subject
    bench = Workbench(ctx, subject, shader, options.resolution)

    def keep() -> None:
        _keep(run, subject)
        write_run(options.output, run)

    def truth_of(view: str) -> Reference:
        if not plan.truths.holds(plan.views[view]):
            progress.begin(CAST, f"{subject.name}, {view}: casting rays")
        return plan.truths.get(plan.views[view])

    for setting in plan.settings:
        truth, view = truth_of(setting.view), plan.views[setting.view]
        progress.begin(RECORD, describe(setting))
        cost, picture = bench.measure(METHODS[setting.method], setting, view, options.rounds)
        # FLIP takes longer than everything else together.
        flip = not options.quick or is_usual(setting)
        run.records.append(Record(setting, cost, error_of(picture, truth, flip=flip)))
        if setting.method == PROMISED_METHOD:
            run.bounds.append(check_record(bench, view, run.records[-1]))
        keep()
    for name, goal in plan.goals:
        truth = truth_of(name)
        progress.begin(GOAL, f"{subject.name}, {name}: {describe_goal(goal)}")
        run.bounds.append(check_goal(bench, name, plan.views[name], goal, truth))
        keep()
    if plan.plots:
        truth = truth_of(FRONT)
        progress.begin(MAP, f"{subject.name}: heat map of the error")
        _draw_map(bench, plan.views[FRONT], truth, options.plot_folder)
    if plan.paper:
        progress.begin(TABLE, f"{subject.name}: the paper's figure 10")
        run.paper = measure_paper_table(bench, plan.views[PAPER_VIEW], options.rounds)
        keep()
    progress.end()
    bench.release()


def _draw_map(bench: Workbench, view: View, truth: Reference, folder: Path) -> None:
    """Draw where the error of the viewer's own setting sits, seen from the front."""
    name = bench.subject.name
    setting = Setting(name, FRONT, "surfelscope", R_SIL, R_INNER, TEXELS)
    picture = bench.draw(METHODS[setting.method], setting, view)
    degrees = normal_error_image(picture.normal, picture.coverage, truth)
    path = folder / f"heat-map-{Path(name).stem}.png"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        draw_heat_map(path, picture.color, degrees, f"{name}, r_sil {R_SIL:g}, r_inner {R_INNER:g}, w_s {TEXELS}")
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from error


def error_of(picture: Picture, truth: Reference, *, flip: bool) -> Json:
    """Return what separates a picture from the truth, for a record."""
    assert truth.picture is not None
    geometry = measure(picture.normal, picture.depth, picture.coverage, truth)
    return geometry.to_dict() | picture_quality(picture.color, truth.picture, flip=flip).to_dict()


def _keep(run: Run, subject: Subject) -> None:
    """Add to the run what the subject knows by now; what an earlier part of the run measured stays."""
    kept = run.models.setdefault(subject.name, {})
    for name, value in subject.info.items():
        if isinstance(value, dict):
            kept[name] = {**value, **kept.get(name, {})}
        else:
            kept.setdefault(name, value)
