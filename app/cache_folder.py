"""The folder of the cache: where it is, what is in it, how large it may become, and how it is emptied.

Only files that the cache has named are ever counted or removed, whatever else is in the folder.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from hierarchy.atomic_file import sweep

# Names the folder in place of the user's own cache folder.
VARIABLE = "SURFELSCOPE_CACHE"

# A hierarchy takes some 90 bytes a triangle: more than thirty models of 3 M triangles.
MOST_BYTES = 10_000_000_000
# All names are looked through at every start.
MOST_FILES = 2_000
# The share of a disk that is left to others.
RESERVE = 0.01

# The tiles of a picture lie beside the hierarchy, called after it and the number of texels along one side.
_ENTRY = re.compile(r"[0-9a-f]+-[0-9a-f]{32}-[0-9a-f]{16}-[0-9a-f]{12}(\.tiles\d+)?\.safetensors")
_OURS = re.compile(rf"{_ENTRY.pattern}|[0-9a-f]{{32}}\.known")


@dataclass(frozen=True)
class CachedFile:
    """A file of the cache; `used` is when it was last used, seconds since 1970."""

    path: Path
    size: int
    used: float

    @property
    def is_model(self) -> bool:
        """It holds a hierarchy."""
        return self.path.suffix == ".safetensors" and ".tiles" not in self.path.name


def user_cache_folder() -> Path | None:
    """Return the folder that the environment names, or else the user's cache folder; None: the user has none."""
    chosen = os.environ.get(VARIABLE)
    if chosen:
        return Path(chosen).absolute()
    from platformdirs import user_cache_path

    folder = user_cache_path("surfelscope", appauthor=False)
    # Without a home it may be something like "~/.cache".
    return folder if folder.is_absolute() else None


def cached_files(folder: Path) -> list[CachedFile]:
    """Return the files of the cache, those that have not been used for longest first; none where it cannot be read."""
    # A file system's clock may stand still for some milliseconds: hierarchies come after tiles used at the same time.
    return sorted(_files(folder), key=lambda file: (file.used, file.is_model))


def _files(folder: Path) -> Iterator[CachedFile]:
    try:
        with os.scandir(folder) as entries:
            for entry in entries:
                if _OURS.fullmatch(entry.name):
                    try:
                        status = entry.stat(follow_symlinks=False)
                        if entry.is_file(follow_symlinks=False):
                            yield CachedFile(Path(entry.path), status.st_size, status.st_mtime)
                    except FileNotFoundError:
                        # Another process has just removed it.
                        continue
    except OSError:
        return


def make_room(folder: Path, size: int, most_bytes: int, spared: Path | None = None) -> bool:
    """Remove what has not been used for longest until `size` more bytes fit; False: they do not, and nothing is lost.

    spared : a file that stays
    Raises OSError where the folder's disk tells nothing.
    """
    disk = shutil.disk_usage(folder)
    files = cached_files(folder)
    present = sum(file.size for file in files)
    allowed = min(most_bytes, disk.free + present - int(RESERVE * disk.total))
    if size + sum(file.size for file in files if file.path == spared) > allowed:
        return False
    count = len(files)
    for file in files:
        if file.path == spared:
            continue
        if present + size <= allowed and count < MOST_FILES:
            break
        file.path.unlink(missing_ok=True)
        present, count = present - file.size, count - 1
    return True


def clear(folder: Path) -> tuple[int, int]:
    """Remove all that the cache has put into a folder; return how many files and bytes. Raises OSError."""
    files = cached_files(folder)
    for file in files:
        file.path.unlink(missing_ok=True)
    sweep(folder)
    # Another process may have cleared it just now, or begun to fill it again.
    with suppress(FileNotFoundError):
        if files and not any(folder.iterdir()):
            folder.rmdir()
    return len(files), sum(file.size for file in files)


def touch(path: Path) -> None:
    """Note that a file has been used. A folder that is only read from does not keep the order."""
    try:
        os.utime(path)
    except OSError:
        return
