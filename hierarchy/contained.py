"""Read a file in a child process, for readers that crash, loop or reserve memory without bound on damaged files.

The child (`contained_child.py`) has limits of time and memory that grow with the file. Its parts come back through a
pipe, so that nothing is written to disk; it ends with this process, whatever ends this process.
"""

from __future__ import annotations

import os
import queue
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any, BinaryIO

from hierarchy.model import Progress, ignore_progress
from hierarchy.part import Part, UnreadableFile
from hierarchy.part_stream import BrokenStream, receive_message, receive_part
from hierarchy.recording import from_json, note

# Of processor time: on a busy machine a good file takes as much of it as ever. Starting takes 0.2 to 0.6 seconds and
# reading a megabyte 0.05 to 0.5.
SECONDS, SECONDS_PER_BYTE = 5.0, 2e-6

# A reader that waits instead of working, or one on a platform that cannot limit processor time, ends after this many
# times as long.
WAITING = 10.0 if sys.platform != "win32" else 2.0

# Of address space, of which libraries reserve 0.4 GB at once. A byte of LAZ becomes about 20 bytes of arrays, and is
# held twice for a moment.
MEMORY, MEMORY_PER_BYTE = 1_400_000_000, 100

# How often the user is asked whether to go on.
PATIENCE = 0.1

# A library of linear algebra would reserve memory for every core, and the allocator for every thread.
ENVIRONMENT = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MALLOC_ARENA_MAX": "2", "RUST_BACKTRACE": "0"}
MOST_THREADS = 8

TOO_LONG = "damaged: reading it takes far longer than a file of its size should"

# What the interpreter is started with. -P: nothing is imported from the folder that the user happens to be in.
CHILD = ("-P", "-m", "hierarchy.contained_child")


def time_limit(size: int) -> float:
    """Return how many seconds of processor time a file of `size` bytes may take."""
    return SECONDS + SECONDS_PER_BYTE * size


def memory_limit(size: int) -> int:
    """Return how many bytes of memory a file of `size` bytes may take."""
    return MEMORY + MEMORY_PER_BYTE * size


def read_contained(
    path: Path, kind: str, warnings: list[str], progress: Progress = ignore_progress, *, seconds: float | None = None
) -> list[Part]:
    """Read the parts of a file with lazrs ("las", "laz") or trimesh (any other kind) in a process of its own.

    warnings : gets what the reader warns of
    progress : called with "load" and up to 0.3 about ten times a second, so that it can cancel at any time
    seconds : a limit of processor time in place of `time_limit`
    Raises UnreadableFile, also where the reader crashes, takes too long or too much memory; OSError.
    """
    size = path.stat().st_size
    seconds = seconds or time_limit(size)
    child = _start(path, kind, memory_limit(size), seconds)
    assert child.stdout is not None
    messages: queue.SimpleQueue[Any] = queue.SimpleQueue()
    receiver = threading.Thread(target=_receive, args=(child.stdout, messages, memory_limit(size) // 2), daemon=True)
    try:
        receiver.start()
        return _collect(child, messages, warnings, progress, time.monotonic() + WAITING * seconds)
    finally:
        child.kill()
        child.wait()
        # The pipe ends with the child, and with the pipe the thread.
        receiver.join()
        child.stdout.close()
        if child.stdin is not None:
            child.stdin.close()


def _start(path: Path, kind: str, memory: int, seconds: float) -> subprocess.Popen[bytes]:
    room = Path(__file__).resolve().parents[1]
    threads = {"RAYON_NUM_THREADS": str(min(os.cpu_count() or 1, MOST_THREADS))}
    paths = os.pathsep.join(filter(None, [str(room), os.environ.get("PYTHONPATH")]))
    return subprocess.Popen(
        [sys.executable, *CHILD, str(path), kind, str(memory), str(seconds)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, **ENVIRONMENT, **threads, "PYTHONPATH": paths},
        # A program with windows would open a console for its child.
        creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
    )


def _receive(stream: BinaryIO, messages: queue.SimpleQueue[Any], most_bytes: int) -> None:
    """Put messages and parts into the queue, and at the end what ended it: None, or a MemoryError of this process."""
    end: MemoryError | None = None
    try:
        while True:
            message = receive_message(stream)
            if "part" in message:
                part, size = receive_part(stream, message, most_bytes)
                most_bytes -= size
                messages.put(part)
            else:
                messages.put(message)
    except MemoryError as error:
        end = error
    except (BrokenStream, OSError):
        pass
    messages.put(end)


def _collect(
    child: subprocess.Popen[bytes],
    messages: queue.SimpleQueue[Any],
    warnings: list[str],
    progress: Progress,
    deadline: float,
) -> list[Part]:
    """Wait for all parts. Raises UnreadableFile, MemoryError and what `progress` raises."""
    parts: list[Part] = []
    fraction = 0.0
    while True:
        try:
            message = messages.get(timeout=PATIENCE)
        except queue.Empty:
            message = {}
        match message:
            case Part():
                parts.append(message)
            case None:
                raise UnreadableFile(_why_it_ended(child))
            case MemoryError():
                raise message
            case {"unreadable": str(reason)}:
                raise UnreadableFile(reason)
            case {"memory": True}:
                raise UnreadableFile("damaged, or it unpacks to far more than a file of its size should")
            case {"progress": float(fraction)}:
                pass
            case {"looked_for": list(values)}:
                note(from_json(values))
            case {"warning": str(sentence)}:
                warnings.append(sentence)
            case {"done": True}:
                return parts
        progress("load", fraction)
        if time.monotonic() > deadline:
            raise UnreadableFile(TOO_LONG)


def _why_it_ended(child: subprocess.Popen[bytes]) -> str:
    """Return the reason for a child that ended without an answer."""
    try:
        code = child.wait(1.0)
    except subprocess.TimeoutExpired:
        code = 0
    if code == -getattr(signal, "SIGXCPU", 0):
        return TOO_LONG
    return "damaged: its reader broke down"
