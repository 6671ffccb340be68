"""The child process of `contained.py`: reads one file and writes its parts to the standard output.

Run as `python -m hierarchy.contained_child PATH KIND MEMORY SECONDS`, where the readers of this module may crash, loop
or reserve memory without harm.
"""

from __future__ import annotations

import math
import os
import signal
import sys
import threading
from pathlib import Path
from typing import BinaryIO

from hierarchy.load import reason
from hierarchy.part import Part, UnreadableFile
from hierarchy.part_stream import send_message, send_part
from hierarchy.plain_text import plain_line
from hierarchy.recording import as_json, recording


def main() -> None:
    """Read the file that the arguments name, and send messages: progress, warnings, parts, and how it ended."""
    path, kind, memory, seconds = Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]), float(sys.argv[4])
    # Ctrl-C goes to both processes; what it means is for the parent to decide.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # What libraries print must not get between the messages.
    with os.fdopen(os.dup(1), "wb") as stream:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        threading.Thread(target=_end_with_parent, daemon=True).start()
        limit_resources(memory, seconds)
        _answer(stream, path, kind)
        stream.flush()
        # Threads of a library that went wrong must not hold up the end.
        os._exit(0)


def _end_with_parent() -> None:
    """Wait until the parent closes its end of the standard input, or is gone."""
    sys.stdin.buffer.read()
    os._exit(1)


def limit_resources(memory: int, seconds: float) -> None:
    """Limit this process to `memory` bytes of address space and `seconds` of processor time, of all threads together.

    Where the platform has no such limits nothing happens.
    """
    try:
        import resource
    except ImportError:
        return
    for what, limit in (("RLIMIT_AS", memory), ("RLIMIT_CPU", math.ceil(seconds)), ("RLIMIT_CORE", 0)):
        try:
            number = getattr(resource, what)
            _, hard = resource.getrlimit(number)
            soft = limit if hard == resource.RLIM_INFINITY else min(limit, hard)
            resource.setrlimit(number, (soft, hard))
        except (AttributeError, ValueError, OSError):
            # macOS, for one, has a limit for address space that it does not let anybody set.
            continue


def _answer(stream: BinaryIO, path: Path, kind: str) -> None:
    import numpy as np

    warnings: list[str] = []
    try:
        with np.errstate(all="ignore"):
            for part in _read(stream, path, kind, warnings):
                send_part(stream, part)
        for warning in warnings:
            send_message(stream, {"warning": plain_line(warning)})
        send_message(stream, {"done": True})
    except MemoryError:
        send_message(stream, {"memory": True})
    except BaseException as error:
        # BaseException, because a panic in Rust code is no Exception.
        send_message(stream, {"unreadable": reason(error, kind)})


def _read(stream: BinaryIO, path: Path, kind: str, warnings: list[str]) -> list[Part]:
    def progress(stage: str, fraction: float) -> None:
        send_message(stream, {"progress": fraction})

    if kind in ("las", "laz"):
        from hierarchy.las import read_laz

        return read_laz(path, progress)
    from hierarchy.trimesh_files import read_with_trimesh, trimesh_reads

    if not trimesh_reads(kind):
        raise UnreadableFile(f"unknown kind of file ({path.suffix or 'no suffix'})")
    with recording() as looked_for:
        parts = read_with_trimesh(path, kind, warnings)
    for reference in looked_for.values():
        send_message(stream, {"looked_for": as_json(reference)})
    return parts


if __name__ == "__main__":
    main()
