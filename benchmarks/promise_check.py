"""Whether pictures keep what is promised of them, and how much better they are: entries of a run file's "bounds".

    {"model", "view", "goal": text, "r_sil", "r_inner", "w_s", "keeps": the promise lies within the goal,
     "promised": {"degrees", "pixels"}, "measured": {"degrees", "pixels"}}

Degrees are the mean angle between normals, pixels the mean displacement of the outline; None where there is no outline.
"""

from __future__ import annotations

from app.option_values import TEXELS
from benchmarks.error import measure
from benchmarks.measurement import Picture, Workbench
from benchmarks.methods import METHODS
from benchmarks.reference import Reference
from benchmarks.run_file import Json, Record, Setting
from hierarchy.goals import ErrorGoal, Promise, detail_for_goal, promise_of_cut
from hierarchy.lod import select_cut
from hierarchy.view import View

METHOD = "surfelscope"
# A demanding one, the viewer's own, and an easy one.
GOALS = (ErrorGoal(0.5, 0.3), ErrorGoal(1.0, 0.5), ErrorGoal(3.0, 1.0))
OF_THE_SWEEP = "settings of the sweep"


def describe_goal(goal: ErrorGoal) -> str:
    """Return a goal as "goal" says it."""
    return f"at most {goal.degrees:g} degrees, {goal.pixels:g} px"


def check_goal(bench: Workbench, name: str, view: View, goal: ErrorGoal, truth: Reference) -> Json:
    """Draw a view, called `name`, with the detail that follows from a goal, and measure it; return the entry."""
    hierarchy = bench.subject.hierarchy(points=False)
    detail, promise = detail_for_goal(hierarchy, view, goal, texels=TEXELS)
    setting = Setting(bench.subject.name, name, METHOD, detail.r_sil, detail.r_inner, detail.texels)
    picture = bench.draw(METHODS[METHOD], setting, view)
    keeps = promise.degrees <= goal.degrees and promise.pixels <= goal.pixels
    return _entry(setting, describe_goal(goal), promise, _measured(picture, truth)) | {"keeps": keeps}


def check_record(bench: Workbench, view: View, record: Record) -> Json:
    """Compare what is promised of a setting that was measured with what was measured; return the entry."""
    setting = record.setting
    hierarchy = bench.subject.hierarchy(points=False)
    cut = select_cut(hierarchy, view, setting.r_sil, setting.r_inner)
    promise = promise_of_cut(hierarchy, view, cut, setting.w_s)
    measured = {"degrees": record.value("error.normal_degrees.mean"), "pixels": record.value("error.silhouette.mean")}
    return _entry(setting, OF_THE_SWEEP, promise, measured)


def _entry(setting: Setting, goal: str, promise: Promise, measured: Json) -> Json:
    return {
        "model": setting.model,
        "view": setting.view,
        "goal": goal,
        "r_sil": setting.r_sil,
        "r_inner": setting.r_inner,
        "w_s": setting.w_s,
        "promised": {"degrees": promise.degrees, "pixels": promise.pixels},
        "measured": measured,
    }


def _measured(picture: Picture, truth: Reference) -> Json:
    error = measure(picture.normal, picture.depth, picture.coverage, truth)
    return {"degrees": error.normal_degrees.mean, "pixels": error.silhouette.mean}
