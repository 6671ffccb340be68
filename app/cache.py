"""The cache: hierarchies of models that have been opened before.

What a hierarchy is called follows from what it was made of: the bytes of the model's file and of every file that it
refers to, how it was built, and the code that built it (inputs.py). So nothing in the cache is ever out of date, only
out of use. Nothing here raises: without a cache, or with a damaged one, models are built, and `say` is told why.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from app.cache_folder import MOST_BYTES, cached_files, make_room, touch
from app.inputs import Inputs, digests_of, entry_of, same_references, start_of_entry
from app.known_digests import KnownDigests
from hierarchy.atomic_file import sweep

if TYPE_CHECKING:
    from app.scene import ModelSource
    from hierarchy.hierarchy import Hierarchy

Progress = Callable[[float], None]

SUFFIX = ".safetensors"


@dataclass(frozen=True, eq=False)
class Found:
    """A hierarchy out of the cache, what its entry is called, and the notes that were kept with it."""

    hierarchy: Hierarchy
    entry: str
    notes: dict[str, str]


class Cache:
    """The entries in one folder, which is made when something is to be kept.

    say : told in one line what was found or kept, and why something was not
    most_bytes : that the folder may hold
    """

    def __init__(
        self, folder: Path, say: Callable[[str], None] = lambda what: None, most_bytes: int = MOST_BYTES
    ) -> None:
        self.folder = folder
        self.say = say
        self.most_bytes = most_bytes

    def find(self, source: ModelSource) -> Found | None:
        """Map the hierarchy of a model; None: it has to be built."""
        try:
            sweep(self.folder)
            known = KnownDigests(self.folder, source.path) if source.path is not None else None
            start = self._start_of_entry(source, known)
            for path in self._models(start) if start else ():
                found = self._open(path, source, known)
                if found is not None:
                    if known is not None:
                        self._remember(known)
                    return found
        except (OSError, MemoryError) as error:
            self.complain("not used", error)
        return None

    def entry(self, source: ModelSource, inputs: Inputs) -> tuple[str, dict[str, str]]:
        """Return what to call that which was built from the inputs, "": it cannot be kept; and the notes to keep."""
        if source.path is None:
            return entry_of(source, 0, "", "", ()), {}
        digests = digests_of(source, inputs)
        if digests is None or inputs.model is None:
            self.say("cache: not kept, a file changed while it was read")
            return "", {}
        model, texture, references = digests
        known = KnownDigests(self.folder, source.path)
        known.learn(inputs.model, model)
        self._remember(known)
        notes = {"references": json.dumps(references)}
        return entry_of(source, inputs.model.state.size, model, texture, references), notes

    def keep(self, entry: str, hierarchy: Hierarchy, notes: Mapping[str, str], progress: Progress) -> bool:
        """Write a hierarchy and notes to the cache, those of `entry` among them; False: it is not there.

        progress : called with the fraction written; an exception that it raises ends the work and is passed on
        """
        from hierarchy.store import save_hierarchy

        try:
            self._make_folder()
            if not make_room(self.folder, hierarchy.nbytes, self.most_bytes):
                size = hierarchy.nbytes / 1e6
                self.say(f"cache: not kept, {size:.0f} MB are too many for it or for the disk")
                return False
            path = self.path_of(entry)
            written = save_hierarchy(path, hierarchy, notes, progress)
        except (OSError, ValueError, MemoryError) as error:
            self.complain("not kept", error)
            return False
        self.say(f"cache: kept {written / 1e6:.1f} MB in {path}")
        return True

    def path_of(self, entry: str) -> Path:
        """Return where the hierarchy of an entry is, if it is kept."""
        return self.folder / f"{entry}{SUFFIX}"

    def _start_of_entry(self, source: ModelSource, known: KnownDigests | None) -> str:
        """Return what the names of a model's entries begin with, "": there are none. Raises OSError."""
        if source.path is None or known is None:
            return start_of_entry(source, 0, "", "")
        # Only what is as long as an entry's model need be read to learn whether it is that model.
        size = source.path.stat().st_size
        if not self._models(f"{size:x}-"):
            return ""
        texture = "" if source.texture is None else known.digest(source.texture)
        return start_of_entry(source, size, known.digest(source.path), texture)

    def _models(self, start: str) -> list[Path]:
        """Return the hierarchies whose names begin with something, the one used last first."""
        files = [file for file in cached_files(self.folder) if file.is_model and file.path.name.startswith(start)]
        return [file.path for file in reversed(files)]

    def _open(self, path: Path, source: ModelSource, known: KnownDigests | None) -> Found | None:
        """Map a hierarchy; None: the model refers to other files by now, or the entry is damaged. Raises OSError."""
        from hierarchy.store import load_hierarchy, read_notes
        from hierarchy.tensor_file import DamagedFile

        try:
            references = json.loads(read_notes(path).get("references", "[]"))
            if known is not None and not same_references(source, references, known):
                return None
            hierarchy, notes = load_hierarchy(path)
        except FileNotFoundError:
            # Another process has just removed it.
            return None
        except (DamagedFile, ValueError, OSError, MemoryError) as error:
            self.complain(f"{path.name} is not used", error)
            return None
        touch(path)
        self.say(f"cache: found in {path}")
        return Found(hierarchy, path.name.removesuffix(SUFFIX), notes)

    def _make_folder(self) -> None:
        self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)

    def _remember(self, known: KnownDigests) -> None:
        try:
            self._make_folder()
            known.save()
        except OSError as error:
            self.complain("digests are not kept", error)

    def complain(self, what: str, error: BaseException) -> None:
        """Say in one line what an error kept the cache from."""
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        self.say(f"cache: {what}: {' '.join((reason or type(error).__name__).split())}")
