"""Where a run was measured: the code, the machine, the libraries and the OpenGL, as a run file says it."""

from __future__ import annotations

import hashlib
import os
import platform
import subprocess
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path

import moderngl

from benchmarks.run_file import Json

ROOT = Path(__file__).resolve().parents[1]

# Rooms whose code decides what a measurement says, and the files among them that only choose or show it.
MEASURED = ("hierarchy", "renderer", "shaders", "benchmarks")
SHOWN = (
    "command.py", "compare.py", "findings.py", "heat_map.py", "options.py", "plan.py", "plots.py", "progress.py",
    "report.py", "resume.py", "setting_text.py", "sweep.py", "tables.py", "targets_table.py",
)  # fmt: skip
SUFFIXES = (".py", ".glsl", ".vert", ".frag", ".geom")

# What two parts of one run must have in common. The commit may differ where the code that is measured does not.
SAME = ("code", "cpu", "cores", "os", "python", "numpy", "numba", "moderngl", "gl_renderer", "gl_version")


def describe_environment(ctx: moderngl.Context) -> Json:
    """Return what stands under "environment" in a run file.

    "code" is a digest of the source files that decide what is measured; "commit" and "dirty" are None outside of a
    checkout. "cores" are those that this process may use.
    """
    commit, dirty = _commit()
    return {
        "commit": commit,
        "dirty": dirty,
        "code": code_digest(ROOT),
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "cpu": _cpu(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "memory_mb": _memory_mb(),
        "os": _os_name(),
        "python": platform.python_version(),
        **{name: metadata.version(name) for name in ("numpy", "numba", "moderngl")},
        "gl_renderer": ctx.info["GL_RENDERER"],
        "gl_version": ctx.info["GL_VERSION"],
    }


def code_digest(root: Path) -> str:
    """Return 16 hexadecimal digits that change with every source file that decides what is measured."""
    digest = hashlib.sha256()
    for room in MEASURED:
        for path in sorted((root / room).rglob("*")):
            shown = room == "benchmarks" and path.name in SHOWN
            if path.suffix in SUFFIXES and not shown:
                digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def _commit() -> tuple[str | None, bool | None]:
    """Return the commit of the checkout that this file belongs to, and whether files in it have changed."""
    # A copy that lies in somebody else's repository is not tracked there.
    if _git("ls-files", "--error-unmatch", str(Path(__file__).resolve())) is None:
        return None, None
    changes = _git("status", "--porcelain", "--untracked-files=no")
    return _git("rev-parse", "--short=12", "HEAD"), None if changes is None else bool(changes)


def _git(*arguments: str) -> str | None:
    """Return what git says about this folder, None where it cannot."""
    try:
        answer = subprocess.run(["git", "-C", str(ROOT), *arguments], capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return answer.stdout.strip()


def _cpu() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.is_file():
        for line in cpuinfo.read_text("utf-8", "replace").splitlines():
            if line.startswith("model name"):
                return " ".join(line.partition(":")[2].split())
    return platform.processor() or platform.machine()


def _memory_mb() -> float | None:
    """Return the machine's memory in MB (1e6 bytes), None where the system does not tell."""
    try:
        return round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e6)
    except (AttributeError, OSError, ValueError):
        return None


def _os_name() -> str:
    try:
        return platform.freedesktop_os_release()["PRETTY_NAME"]
    except (AttributeError, KeyError, OSError):
        return f"{platform.system()} {platform.release()}"
