"""What a hierarchy depends on: the files that it was read from, how it was built, and the program that built it."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from hierarchy.file_state import Seen, digest_of_seen, see
from hierarchy.recording import Reference, recording
from hierarchy.references import inside_folder

if TYPE_CHECKING:
    from app.known_digests import KnownDigests
    from app.scene import ModelSource

# A model that looks for more files than this is not kept.
MOST_REFERENCES = 1_000

T = TypeVar("T")


@dataclass(frozen=True)
class Inputs:
    """The files that a model was loaded from, as they were before; None: there was no such file."""

    model: Seen | None
    texture: Seen | None
    references: tuple[Reference, ...]


def watch(source: ModelSource, load: Callable[[], T]) -> tuple[T, Inputs]:
    """Load a model, and return with it what was read."""
    model, texture = _see(source.path), _see(source.texture)
    with recording() as references:
        loaded = load()
    return loaded, Inputs(model, texture, tuple(references.values()))


def entry_of(source: ModelSource, size: int, model: str, texture: str, references: Sequence[Sequence[str]]) -> str:
    """Return the name of what is built from a source: where names are equal, hierarchies are.

    size, model : bytes of the model's file and its digest, 0 and "" for the built-in model
    texture : digest of the texture that was asked for, "": none
    references : as in `digests_of`
    """
    return f"{start_of_entry(source, size, model, texture)}{_short(references, 12)}"


def start_of_entry(source: ModelSource, size: int, model: str, texture: str) -> str:
    """Return what the names of all entries begin with that differ in the references only; as in `entry_of`."""
    suffix = "" if source.path is None else source.path.suffix.lower()
    return f"{size:x}-{_short(model, 32)}-{_short([program(), suffix, source.points, texture], 16)}-"


def digests_of(source: ModelSource, inputs: Inputs) -> tuple[str, str, list[list[str]]] | None:
    """Return the digests of the model and the texture, and folder, name and digest of all that the model refers to.

    None: one of the files is not what was read any more.
    """
    if source.path is None or inputs.model is None or (source.texture is not None and inputs.texture is None):
        return None
    if len(inputs.references) > MOST_REFERENCES:
        return None
    seen = [inputs.model, inputs.texture, *(reference.seen for reference in inputs.references)]
    digests = ["" if each is None else digest_of_seen(each) for each in seen]
    model, texture, *found = digests
    if model is None or texture is None:
        return None
    references = []
    for reference, digest in zip(inputs.references, found, strict=True):
        if digest is None:
            return None
        references.append([os.path.relpath(reference.folder, source.path.parent), reference.name, digest])
    return model, texture, sorted(references)


def same_references(source: ModelSource, references: Iterable[Iterable[str]], known: KnownDigests) -> bool:
    """Tell whether a model finds today what it found when `references` (as in `digests_of`) were taken."""
    assert source.path is not None
    for folder, name, digest in references:
        try:
            now = known.digest(inside_folder(source.path.parent / folder, name))
        except OSError:
            now = ""
        if now != digest:
            return False
    return True


@cache
def program() -> str:
    """Return what identifies the code that builds: a hierarchy of another version of it is another one."""
    import hierarchy

    digest = hashlib.sha256()
    for file in sorted(Path(folder) / name for folder in hierarchy.__path__ for name in _modules(folder)):
        digest.update(file.read_bytes())
    try:
        version = metadata.version("surfelscope")
    except metadata.PackageNotFoundError:
        version = ""
    return f"{version} {digest.hexdigest()}"


def _modules(folder: str) -> list[str]:
    """Return the names of the source files in a folder; none where the package is in an archive."""
    try:
        return [path.name for path in Path(folder).iterdir() if path.suffix == ".py"]
    except OSError:
        return []


def _see(path: Path | None) -> Seen | None:
    try:
        return None if path is None else see(path)
    except OSError:
        # Whoever loads it will say so.
        return None


def _short(value: object, length: int) -> str:
    return hashlib.sha256(json.dumps(value).encode()).hexdigest()[:length]
