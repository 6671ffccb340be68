"""Which files a model looks for while it is loaded, those that it does not find as well."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import astuple, dataclass
from functools import wraps
from pathlib import Path
from typing import Any

from hierarchy.file_state import FileState, Seen, see

Find = Callable[[Path, str], Path]

# No file will ever be found by a longer name.
LONGEST_PATH = 4096


@dataclass(frozen=True)
class Reference:
    """What was looked for in `folder` by `name`, before it was read; `seen` is None where nothing was found."""

    folder: Path
    name: str
    seen: Seen | None


_recorded: ContextVar[dict[tuple[Path, str], Reference] | None] = ContextVar("recorded", default=None)


@contextmanager
def recording() -> Iterator[dict[tuple[Path, str], Reference]]:
    """Collect what is looked for within the block, in this thread: the first time of each name."""
    found: dict[tuple[Path, str], Reference] = {}
    token = _recorded.set(found)
    try:
        yield found
    finally:
        _recorded.reset(token)


def recorded(find: Find) -> Find:
    """Make find(folder, name), which raises OSError where there is nothing, note what it is asked for."""

    @wraps(find)
    def find_and_note(folder: Path, name: str) -> Path:
        if _recorded.get() is None:
            return find(folder, name)
        try:
            path = find(folder, name)
            note(Reference(folder, name, see(path)))
        except OSError:
            if len(name) <= LONGEST_PATH:
                note(Reference(folder, name, None))
            raise
        return path

    return find_and_note


def note(reference: Reference) -> None:
    """Add something to what is being recorded."""
    recorded = _recorded.get()
    if recorded is not None:
        recorded.setdefault((reference.folder, reference.name), reference)


def as_json(reference: Reference) -> list[Any]:
    """Return a reference as what JSON knows, to hand it to another process."""
    seen = reference.seen
    found = None if seen is None else [str(seen.path), seen.digest, *astuple(seen.state)]
    return [str(reference.folder), reference.name, found]


def from_json(values: list[Any]) -> Reference:
    """Return the reference that `as_json` made values of."""
    folder, name, found = values
    if found is None:
        return Reference(Path(folder), name, None)
    path, digest, *state = found
    return Reference(Path(folder), name, Seen(Path(path), FileState(*state), digest))
