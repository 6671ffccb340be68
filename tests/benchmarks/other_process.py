"""What another process may do instead of measuring; in a module of its own, so that a fresh interpreter finds it."""

from __future__ import annotations

import os
from multiprocessing.connection import Connection

from benchmarks.run_file import Json


def end(sender: Connection, *_: object) -> None:
    """Be ended, as by a system that is out of memory."""
    os._exit(9)


def fail(sender: Connection, *_: object) -> None:
    """Send an error."""
    sender.send(("error", "no memory"))


def answer(sender: Connection, size: int, *_: object) -> None:
    """Send an entry."""
    entry: Json = {"size": size, "process": os.getpid()}
    sender.send(("entry", entry))
