"""A process that opens one file after another as the command line would, and says how each ended.

Run as `python file_worker.py`; it reads a line of JSON for each file from its standard input and answers with one.
What the program, its libraries and their compiled parts write to the standard error goes into the answer.
"""

from __future__ import annotations

import json
import os
import resource
import sys
import tempfile
import time
import warnings
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))


# What a process that has loaded all libraries takes, in MB.
FRESH = 200


class ForkedChild:
    """Stands in for the process that `hierarchy.contained` starts: a copy of this one, which is there at once.

    All else is as it would be: the pipes, the limits and the child's own code. `largest` is how many bytes the largest
    child had of its own.
    """

    largest = 0

    def __init__(self, path: Path, kind: str, memory: int, seconds: float) -> None:
        from hierarchy import contained_child

        # A limit of address space counts what this process has already, and so does the size of the child.
        memory += _status("VmSize")
        self.shared = _status("VmRSS")
        inner_in, outer_in = os.pipe()
        outer_out, inner_out = os.pipe()
        self.pid = os.fork()
        if self.pid == 0:
            try:
                os.dup2(inner_in, 0)
                os.dup2(inner_out, 1)
                os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
                os.closerange(3, 256)
                sys.stdin = os.fdopen(0)
                sys.argv = ["child", str(path), kind, str(memory), str(seconds)]
                contained_child.main()
            finally:
                os._exit(3)
        os.close(inner_in)
        os.close(inner_out)
        self.stdin, self.stdout = os.fdopen(outer_in, "wb"), os.fdopen(outer_out, "rb")
        self.returncode: int | None = None

    def kill(self) -> None:
        if self.returncode is None:
            os.kill(self.pid, 9)

    def wait(self, timeout: float | None = None) -> int:
        if self.returncode is None:
            self._end(0)
        assert self.returncode is not None
        return self.returncode

    def poll(self) -> int | None:
        if self.returncode is None:
            self._end(os.WNOHANG)
        return self.returncode

    def _end(self, how: int) -> None:
        pid, status, usage = os.wait4(self.pid, how)
        if pid:
            self.returncode = os.waitstatus_to_exitcode(status)
            ForkedChild.largest = max(ForkedChild.largest, 1024 * usage.ru_maxrss - self.shared)


def _status(field: str) -> int:
    """Return a number of bytes out of this process's status, 0 where the system does not tell."""
    try:
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith(field + ":"):
                return 1024 * int(line.split()[1])
    except OSError:
        pass
    return 0


def _forget_peak() -> None:
    ForkedChild.largest = 0
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        pass


def _peak_megabytes(before: int) -> float:
    """Return the largest size of a process, with its child, that starts afresh for a file.

    before : bytes that this one, which may have compiled kernels, had before the file
    """
    own = _status("VmHWM") or 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return (max(own - before, 0) + ForkedChild.largest) / 1e6 + FRESH


def _seconds_of_work() -> float:
    """Return how long this process and its children have had a core."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def _open(arguments: list[str]) -> tuple[int | str, str]:
    """Return the exit status, or what was raised past the command line."""
    from app.cli import main

    try:
        return main(arguments), ""
    except SystemExit as error:
        return error.code if isinstance(error.code, int) else str(error.code), ""
    except BaseException as error:
        import traceback

        return f"{type(error).__name__}", traceback.format_exc()


def serve() -> None:
    """Answer until the standard input ends."""
    requests, replies = os.fdopen(os.dup(0), "r"), os.fdopen(os.dup(1), "w")
    told, said = tempfile.TemporaryFile(), tempfile.TemporaryFile()  # noqa: SIM115
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(told.fileno(), 1)
    os.dup2(said.fileno(), 2)
    for kind in (RuntimeWarning, UserWarning):
        warnings.simplefilter("always", kind)
    # What the child would import.
    import collada  # noqa: F401
    import laspy  # noqa: F401
    import lazrs  # noqa: F401
    import trimesh

    from hierarchy import contained, contained_child, las, trimesh_files  # noqa: F401

    trimesh.available_formats()
    start_child = contained._start
    for line in requests:
        forked, arguments = json.loads(line)
        contained._start = ForkedChild if forked else start_child
        for stream in (told, said):
            stream.seek(0)
            stream.truncate()
        _forget_peak()
        before = _status("VmRSS")
        start, start_of_work = time.perf_counter(), _seconds_of_work()
        status, trace = _open(arguments)
        # On a machine that does other things as well, what counts is the work.
        seconds = min(time.perf_counter() - start, _seconds_of_work() - start_of_work)
        for text in (sys.stdout, sys.stderr):
            text.flush()
        said.seek(0)
        complaint = said.read(100_000).decode("utf-8", "backslashreplace") + trace
        answer = [status, complaint, os.fstat(told.fileno()).st_size, seconds, _peak_megabytes(before)]
        replies.write(json.dumps(answer) + "\n")
        replies.flush()


if __name__ == "__main__":
    serve()
