"""Whether a run that was interrupted may go on here: nothing of two machines, codes or models in one run."""

from __future__ import annotations

from pathlib import Path

from benchmarks.environment import SAME
from benchmarks.run_file import Json, Run, RunFileError, plain

CALLED = {
    "code": "with other code",
    "cpu": "on another processor",
    "cores": "with another number of cores",
    "os": "on another system",
    "gl_renderer": "with another OpenGL",
    "gl_version": "with another version of OpenGL",
}


def check_same(path: Path, run: Run, environment: Json, settings: Json) -> None:
    """Raise RunFileError, one line, where the run was measured elsewhere or otherwise."""
    for name in SAME:
        before, now = run.environment.get(name), plain(environment[name])
        if before != now:
            how = CALLED.get(name, f"with another version of {name}")
            if name == "code":
                before = f"{before} of commit {run.environment.get('commit')}"
                now = f"{now} of commit {environment['commit']}"
            raise RunFileError(_refusal(path, how, before, now))
    for name, value in plain(settings).items():
        if run.settings.get(name) != value:
            raise RunFileError(_refusal(path, f"with other {name}", run.settings.get(name), value))


def check_same_model(path: Path, run: Run, name: str, content: str) -> None:
    """Raise RunFileError where a model of that name has another content in the run."""
    before = run.models.get(name, {}).get("content", content)
    if before != content:
        raise RunFileError(_refusal(path, f"of another {name}", before[:12], content[:12]))


def _refusal(path: Path, how: str, before: object, now: object) -> str:
    return f"{path}: was measured {how} ({before}, here {now}); --restart begins anew"
