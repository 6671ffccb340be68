"""What a file was when it was looked at, and whether it still is: files change while they are read."""

from __future__ import annotations

import hashlib
import stat
import time
from dataclasses import dataclass
from pathlib import Path

# File systems count time in steps of up to two seconds (nanoseconds). A file that has just changed may change again
# within the same step, and only what it holds tells.
FRESH = 2_000_000_000


@dataclass(frozen=True)
class FileState:
    """What tells, without reading it, that a file has not changed; times in nanoseconds."""

    size: int
    modified: int
    changed: int
    inode: int
    device: int

    @property
    def is_fresh(self) -> bool:
        """The file may change once more without this changing."""
        return self.changed > time.time_ns() - FRESH


@dataclass(frozen=True)
class Seen:
    """A file as it was before it was read; `digest` is "" unless it was fresh."""

    path: Path
    state: FileState
    digest: str


def state_of(path: Path) -> FileState:
    """Return a file's present state. Raises OSError, also where it is a pipe or a device, which reading may not end."""
    found = path.stat()
    if not stat.S_ISREG(found.st_mode):
        raise OSError("not a regular file")
    return FileState(found.st_size, found.st_mtime_ns, found.st_ctime_ns, found.st_ino, found.st_dev)


def digest_of(path: Path) -> str:
    """Return the SHA-256 of what a file holds, in hexadecimal; 1 s a gigabyte. Raises OSError."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def see(path: Path) -> Seen:
    """Take down what a file is, before it is read. Raises OSError."""
    state = state_of(path)
    return Seen(path, state, digest_of(path) if state.is_fresh else "")


def digest_of_seen(seen: Seen) -> str | None:
    """Return the digest of what has been read since the file was seen; None where it has changed since, or is gone."""
    try:
        if state_of(seen.path) != seen.state:
            return None
        digest = digest_of(seen.path)
        if state_of(seen.path) != seen.state or seen.digest not in ("", digest):
            return None
    except OSError:
        return None
    return digest
