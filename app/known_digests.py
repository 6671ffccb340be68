"""Digests of files that have been read before: a gigabyte need not be read again to learn that it has not changed."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import astuple
from pathlib import Path

from hierarchy.atomic_file import replacing
from hierarchy.file_state import FileState, Seen, digest_of, state_of

SUFFIX = ".known"


class KnownDigests:
    """The digests of a model's file and of those that it refers to, remembered in the cache's folder.

    A file counts as unchanged as long as its size, its times and its place on the disk are the same, unless it was
    changed a moment before they were taken.
    """

    def __init__(self, folder: Path, model: Path) -> None:
        """Read what is remembered; nothing, where that is damaged or missing."""
        name = hashlib.sha256(os.fsencode(model.absolute())).hexdigest()[:32]
        self.path = folder / f"{name}{SUFFIX}"
        self._states: dict[str, tuple[FileState, str]] = {}
        self._changed = False
        try:
            text, _, digest = self.path.read_bytes().rpartition(b"\n")
            if hashlib.sha256(text).hexdigest().encode() == digest:
                self._states = {path: (FileState(*state), known) for path, (*state, known) in json.loads(text).items()}
        except (OSError, ValueError, TypeError, AttributeError):
            self._states = {}

    def digest(self, path: Path) -> str:
        """Return a file's digest, without reading it where it is known. Raises OSError."""
        state = state_of(path)
        known = self._states.get(str(path.absolute()))
        if known is not None and known[0] == state:
            return known[1]
        digest = digest_of(path)
        if state_of(path) == state:
            self.learn(Seen(path, state, ""), digest)
        return digest

    def learn(self, seen: Seen, digest: str) -> None:
        """Remember the digest of a file as it was seen."""
        if not seen.state.is_fresh:
            self._states[str(seen.path.absolute())] = seen.state, digest
            self._changed = True

    def save(self) -> None:
        """Write down what is new. Raises OSError."""
        if self._changed:
            known = {path: [*astuple(state), digest] for path, (state, digest) in self._states.items()}
            text = json.dumps(known).encode()
            with replacing(self.path) as file:
                file.write(text + b"\n" + hashlib.sha256(text).hexdigest().encode())
            self._changed = False
