"""Write a file whole or not at all: beside its place under another name, and moved there once it is complete.

Whatever happens on the way (a full disk, an interrupt, a loss of power, another process that writes the same file),
what had the name before stays until the new file is complete. What a killed process leaves beside it is known by its
name, and by the lock that nobody holds on it any more; `sweep` removes it.
"""

from __future__ import annotations

import hashlib
import os
import re
import secrets
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

if sys.platform != "win32":
    import fcntl

_UNFINISHED = re.compile(r"\.(?P<name>.+)\.[0-9a-f]{12}\.part")

# Where a lock cannot tell, what has not been written to for so long (seconds) has been left by its writer.
ABANDONED_AFTER = 86_400.0

LONGEST_LABEL = 200

# What this process has not finished: an interrupt that ends it at once removes them first.
_unfinished: set[Path] = set()


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """Give a binary file to write to, which takes the place of `path` when the block ends without an exception.

    A link is replaced, not what it leads to.
    Raises OSError where there is no room or no permission; `path` is as it was then.
    """
    part, file = _open_part(path)
    try:
        with file:
            yield file
            file.flush()
            # Without this a loss of power may leave the new name with nothing behind it.
            os.fsync(file.fileno())
            if path.exists():
                # The temporary file is for its writer alone; what it replaces may be for others, too.
                part.chmod(path.stat().st_mode & 0o777)
        part.replace(path)
    finally:
        _unfinished.discard(part)
        part.unlink(missing_ok=True)


def sweep(folder: Path, name: str | None = None) -> int:
    """Remove what killed processes have left unfinished in a folder, and return how many files that were.

    name : only what was to become the file of this name
    """
    removed = 0
    try:
        with os.scandir(folder) as entries:
            found = [(Path(entry.path), _UNFINISHED.fullmatch(entry.name)) for entry in entries]
    except OSError:
        return 0
    for part, match in found:
        if match is not None and (name is None or match["name"] == _label(name)):
            removed += _remove_if_abandoned(part)
    return removed


def remove_unfinished() -> None:
    """Remove what this process is writing: for the moment before it ends at once."""
    for part in tuple(_unfinished):
        try:
            part.unlink(missing_ok=True)
        except OSError:
            continue


def _open_part(path: Path) -> tuple[Path, BinaryIO]:
    """Make a new file beside `path`, locked as long as it is open."""
    while True:
        part = path.with_name(f".{_label(path.name)}.{secrets.token_hex(6)}.part")
        _unfinished.add(part)
        try:
            file = _create(part, 0o666 if not path.exists() else 0o600)
        except BaseException:
            _unfinished.discard(part)
            raise
        _lock(file)
        # Another process may have taken it for abandoned before it was locked.
        if part.exists():
            return part, file
        _unfinished.discard(part)
        file.close()


def _label(name: str) -> str:
    """Return what stands for a name in a longer one; file systems allow 255 bytes."""
    return name if len(os.fsencode(name)) <= LONGEST_LABEL else hashlib.sha256(os.fsencode(name)).hexdigest()


def _create(part: Path, mode: int) -> BinaryIO:
    return os.fdopen(os.open(part, os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), mode), "wb")


def _lock(file: BinaryIO) -> bool:
    """Lock a file against `sweep`; False: it is locked, or locks do not work here."""
    if sys.platform == "win32":
        # Nobody can remove a file that is open there.
        return False
    try:
        fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _remove_if_abandoned(part: Path) -> bool:
    try:
        old = time.time() - part.stat().st_mtime > ABANDONED_AFTER
        with part.open("rb+") as file:
            if _lock(file):
                # Removed while it is locked: its name cannot have become another's.
                part.unlink()
                return True
        if old:
            part.unlink()
    except OSError:
        return False
    return old
