"""What a command line asks for and a run file does not have yet."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from app.errors import UsageError
from benchmarks.options import BenchOptions
from benchmarks.paper_table import MODEL as PAPER_MODEL
from benchmarks.promise_check import GOALS, describe_goal
from benchmarks.resume import check_same_model
from benchmarks.run_file import Run, Setting
from benchmarks.shading import PictureShader
from benchmarks.subject import Subject
from benchmarks.sweep import settings_of, swept_views
from benchmarks.truth_cache import TruthCache
from benchmarks.views import views_of
from hierarchy.goals import ErrorGoal
from hierarchy.view import View

# Kinds of steps.
RECORD, CAST, GOAL, MAP, TABLE = "record", "cast", "goal", "map", "table"


@dataclass(frozen=True, eq=False)
class Plan:
    """What is to be measured of a subject, and was not yet: settings, and goals on views by their names.

    paper : the paper's table is of this model
    plots : draw its heat map, if anything is measured
    """

    subject: Subject
    views: dict[str, View]
    truths: TruthCache
    settings: list[Setting]
    goals: list[tuple[str, ErrorGoal]]
    paper: bool
    plots: bool

    @property
    def steps(self) -> Counter[str]:
        """The work by its kinds."""
        seen = {setting.view for setting in self.settings} | {view for view, _ in self.goals}
        uncast = sum(not self.truths.holds(self.views[view]) for view in seen)
        counts = {RECORD: len(self.settings), CAST: uncast, GOAL: len(self.goals), TABLE: int(self.paper)}
        return Counter(counts | {MAP: int(self.plots and any(counts.values()))})


def load_subjects(options: BenchOptions) -> list[Subject]:
    """Load the models before anything is measured, so that a bad one is known at once."""
    subjects = [Subject(path) for path in dict.fromkeys(options.models)]
    for name, count in Counter(subject.name for subject in subjects).items():
        if count > 1:
            raise UsageError(f"two models are called {name}: measure them in runs of their own")
    return subjects


def plan_of(subject: Subject, options: BenchOptions, run: Run, shader: PictureShader, *, first: bool) -> Plan:
    """Return what is left to measure of a subject.

    first : it is the first of the command line
    Raises RunFileError where the run has another model of that name.
    """
    check_same_model(options.output, run, subject.name, subject.info["content"])
    views = views_of(subject.mesh, options.resolution)
    everywhere = first or not options.quick
    wanted = settings_of(
        subject.name,
        views,
        swept_views(options.views, views),
        closed=subject.mesh.closed,
        quick=options.quick,
        everywhere=everywhere,
    )
    done = run.measured()
    truths = TruthCache(options.output.parent / "references", subject, shader, options.samples)
    checked = {(entry["view"], entry["goal"]) for entry in run.bounds if entry["model"] == subject.name}
    goals = [(view, goal) for view in views for goal in GOALS if (view, describe_goal(goal)) not in checked]
    return Plan(
        subject=subject,
        views=views,
        truths=truths,
        settings=[setting for setting in wanted if setting not in done],
        goals=goals if everywhere else [],
        paper=subject.name == PAPER_MODEL and not run.paper,
        plots=options.plots,
    )
