"""Open files in worker processes, and find out what is not as promised.

Promised of every file: it opens, or the command ends with status 2 and one line; within 10 seconds and 2 GB; without a
word of a library on the standard error; and nothing is written but to the cache.
"""

from __future__ import annotations

import atexit
import json
import os
import re
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

MOST_SECONDS, MOST_MEGABYTES = 10.0, 2048.0

# Seconds after which a worker hangs, whatever else the machine does; how long it worked is what it says itself.
PATIENCE = 60.0

# A process that has not come up after this long never will; compiling all kernels takes a minute.
START = 300.0

INTERNALS = re.compile(r"Traceback|numpy|trimesh|laspy|lazrs|lxml|dtype|object at 0x|NoneType|\bpanicked\b|errno", re.I)


@dataclass(frozen=True)
class Trial:
    """One model to be opened.

    files : name -> contents of the model's folder; contents may also be a function that makes the file at a path
    name : the file among them that is opened
    options : after it, for the command `info`
    picture : draw it, too
    label : what it is, for people
    forked : a reader's child is a copy of the worker, which is there at once; else a process as it always is
    """

    kind: str
    files: dict[str, bytes | Callable[[Path], object]]
    name: str
    options: tuple[str, ...] = ()
    picture: bool = False
    label: str = ""
    forked: bool = True


@dataclass(frozen=True)
class Answer:
    """What a worker says: the exit status (or an exception's name), the standard error, and bytes of output."""

    status: int | str
    complaint: str
    output: int
    seconds: float
    megabytes: float


@dataclass
class Tally:
    """What became of the files of one kind."""

    cases: int = 0
    opened: int = 0
    seconds: float = 0.0
    megabytes: float = 0.0
    slowest: str = ""
    failures: list[str] = field(default_factory=list)


class Worker:
    """A worker process with folders of its own, started again whenever it has ended."""

    def __init__(self, root: Path) -> None:
        self.root = root
        for name in ("model", "home", "tmp", "here", "cache", "pictures"):
            (root / name).mkdir(parents=True)
        self.process: subprocess.Popen[str] | None = None

    def ask(self, *arguments: str, limit: float = PATIENCE, forked: bool = True) -> Answer:
        """Have a command run. Raises TimeoutError or ChildProcessError where the worker hangs or dies.

        forked : readers have forked children, not real ones
        """
        if self.process is None:
            self.process = self._start()
        process = self.process
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(json.dumps([forked, arguments]) + "\n")
        process.stdin.flush()
        if not select.select([process.stdout], [], [], limit)[0]:
            self.stop()
            raise TimeoutError(f"no answer after {limit:g} s")
        line = process.stdout.readline()
        if not line:
            status = process.wait()
            self.process = None
            raise ChildProcessError(f"the process died ({signal_name(status)})")
        return Answer(*json.loads(line))

    def _ask_again_if_slow(self, *arguments: str, forked: bool = True) -> Answer:
        """Ask; the first model that needs a kernel waits until it is compiled, but what is slow itself is so again."""
        answer = self.ask(*arguments, forked=forked)
        return self.ask(*arguments, forked=forked) if answer.seconds > MOST_SECONDS else answer

    def _start(self) -> subprocess.Popen[str]:
        kept = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}
        folders = {"HOME": "home", "TMPDIR": "tmp", "XDG_CACHE_HOME": "cache", "XDG_CONFIG_HOME": "home",
                   "SURFELSCOPE_CACHE": "cache"}  # fmt: skip
        environment = {
            **kept,
            **{key: str(self.root / name) for key, name in folders.items()},
            # Of small models the second thread does nothing but wait, which takes a core from the next worker.
            "NUMBA_NUM_THREADS": "1",
        }
        self.process = subprocess.Popen(
            [sys.executable, str(Path(__file__).with_name("file_worker.py"))],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            cwd=self.root / "here",
            env=environment,
            text=True,
            start_new_session=True,
        )
        # The first model takes as long as it takes to load or even to compile the kernels.
        first = self.root / "model" / "first.obj"
        first.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        self.ask("info", str(first), limit=START)
        first.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
        self.ask("info", str(first), limit=START)
        first.unlink()
        return self.process

    def stop(self) -> None:
        """End the process and what it has started."""
        if self.process is not None:
            try:
                os.killpg(self.process.pid, signal.SIGKILL)
            except ProcessLookupError:
                pass
            self.process.communicate()
            self.process = None

    def snapshot(self) -> dict[str, tuple[int, int]]:
        """Return what stands in the folders that nobody may write to: path -> size and time."""
        found = {}
        for name in ("model", "home", "tmp", "here"):
            for folder, _, names in os.walk(self.root / name):
                for each in (folder, *(f"{folder}/{name}" for name in names)):
                    status = os.lstat(each)
                    found[each] = status.st_size, status.st_mtime_ns
        return found

    def run(self, trial: Trial) -> tuple[Answer | None, str]:
        """Open a model; return the answer, if any, and what is not as promised, if anything."""
        folder = self.root / "model"
        write_files(folder, trial.files)
        if self.process is None:
            self.process = self._start()
        before = self.snapshot()
        answer = None
        try:
            path = str(folder / trial.name)
            answer = self._ask_again_if_slow("info", path, *trial.options, forked=trial.forked)
            wrong = judge(answer)
            if not wrong and trial.picture and answer.status == 0:
                picture = self.root / "pictures" / "a.png"
                drawn = self._ask_again_if_slow(
                    "render", path, *trial.options, "--output", str(picture), "--resolution", "48,32"
                )
                wrong = judge(drawn) or ("" if drawn.status == 0 else "opens, and cannot be drawn: " + drawn.complaint)
                picture.unlink(missing_ok=True)
        except (TimeoutError, ChildProcessError) as error:
            wrong = str(error)
        after = self.snapshot()
        if not wrong and after != before:
            wrong = "wrote to " + ", ".join(sorted(key for key, _ in set(after.items()) ^ set(before.items())))
        if wrong and answer is not None and answer.megabytes > MOST_MEGABYTES:
            self.stop()
        return answer, wrong


def write_files(folder: Path, files: dict[str, bytes | Callable[[Path], object]]) -> None:
    """Make a folder hold these files and no others."""
    for entry in list(os.scandir(folder)):
        if entry.is_dir(follow_symlinks=False):
            shutil.rmtree(entry.path)
        else:
            Path(entry.path).unlink()
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if callable(content):
            content(path)
        else:
            path.write_bytes(content)


def judge(answer: Answer) -> str:
    """Return what is not as promised about an answer, or nothing."""
    lines = answer.complaint.splitlines()
    if answer.status not in (0, 2):
        return f"status {answer.status}: {answer.complaint[-2000:]}"
    if answer.status == 2 and (len(lines) != 1 or not lines[0].startswith("surfelscope: ") or answer.output):
        return f"status 2, and not one line but {len(lines)}: {answer.complaint[:2000]!r}"
    if answer.status == 0 and not all(line.startswith("surfelscope: warning: ") for line in lines):
        return f"opens, and somebody says: {answer.complaint[:2000]!r}"
    if not all(line.isprintable() and len(line) <= 400 for line in lines):
        return f"says what no terminal should show: {answer.complaint[:2000]!r}"
    if INTERNALS.search(answer.complaint):
        return f"speaks of its insides: {answer.complaint[:2000]!r}"
    if answer.seconds > MOST_SECONDS:
        return f"took {answer.seconds:.1f} s"
    if answer.megabytes > MOST_MEGABYTES:
        return f"took {answer.megabytes:.0f} MB"
    return ""


def signal_name(status: int) -> str:
    return signal.Signals(-status).name if status < 0 else f"status {status}"


class Pool:
    """Workers that all tests share, as starting one takes some seconds."""

    def __init__(self) -> None:
        self.root = Path(tempfile.mkdtemp(prefix="surfelscope-trials-"))
        self.workers: list[Worker] = []
        atexit.register(self.close)

    def take(self, count: int) -> list[Worker]:
        """Return so many workers."""
        while len(self.workers) < count:
            self.workers.append(Worker(self.root / f"worker{len(self.workers)}"))
        return self.workers[:count]

    def close(self) -> None:
        """End all workers."""
        for worker in self.workers:
            worker.stop()
        shutil.rmtree(self.root, ignore_errors=True)


@cache
def pool() -> Pool:
    """Return the one pool."""
    return Pool()


def run_trials(trials: Iterable[Trial], *, workers: int = 1) -> dict[str, Tally]:
    """Run all trials, and return what became of them by kind; what fails is kept in a folder that failures name."""
    tallies: dict[str, Tally] = {}
    lock = threading.Lock()
    broken: list[BaseException] = []
    waiting = iter(trials)

    def work(worker: Worker) -> None:
        try:
            while not broken:
                with lock:
                    trial = next(waiting, None)
                if trial is None:
                    return
                answer, wrong = worker.run(trial)
                with lock:
                    _count(tallies.setdefault(trial.kind, Tally()), trial, answer, wrong)
        except BaseException as error:
            worker.stop()
            broken.append(error)

    threads = [threading.Thread(target=work, args=(worker,)) for worker in pool().take(workers)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if broken:
        raise broken[0]
    return tallies


def _count(tally: Tally, trial: Trial, answer: Answer | None, wrong: str) -> None:
    tally.cases += 1
    if answer is not None:
        tally.opened += answer.status == 0
        tally.megabytes = max(tally.megabytes, answer.megabytes)
        if answer.seconds > tally.seconds:
            tally.seconds, tally.slowest = answer.seconds, trial.label
    if wrong:
        kept = Path(tempfile.mkdtemp(prefix="surfelscope-failure-"))
        write_files(kept, trial.files)
        tally.failures.append(f"{trial.kind}: {trial.label}: {wrong} (kept in {kept}, opened {trial.name!r})")
