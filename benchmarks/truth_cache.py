"""The truth of every view of a subject, cast once and kept in files."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np

from benchmarks.rays import RayCaster
from benchmarks.reference import Reference, cast, load_reference, save_reference
from benchmarks.subject import Subject
from hierarchy.view import View

# The files that decide what a reference holds.
CASTING = ("picture_quality.py", "rays.py", "reference.py", "shading.py")


class TruthCache:
    """Casts references, or finds them in a folder where the same mesh was cast before with the same code."""

    def __init__(self, folder: Path, subject: Subject, samples: int) -> None:
        """samples : rays along one side of a pixel."""
        self._folder, self._subject, self._samples = folder, subject, samples
        self._caster: RayCaster | None = None
        self._code = _digest(*(path.read_bytes() for path in _casting_files()))
        self._last: tuple[Path, Reference] | None = None

    def holds(self, view: View) -> bool:
        """Tell whether the view need not be cast."""
        return self._path(view).is_file()

    def get(self, view: View) -> Reference:
        """Return the truth of a view; raises OSError where it cannot be kept."""
        path = self._path(view)
        if self._last is not None and self._last[0] == path:
            return self._last[1]
        reference = load_reference(path)
        if reference is None:
            if self._caster is None:
                self._caster = RayCaster(self._subject.mesh)
            reference = cast(self._caster, view, self._samples)
            self._folder.mkdir(parents=True, exist_ok=True)
            save_reference(path, reference)
        self._last = path, reference
        return reference

    def _path(self, view: View) -> Path:
        """Name a reference by all that it depends on."""
        numbers = [*view.eye_from_model.ravel(), view.view_angle, view.width, view.height, self._samples]
        key = _digest(self._code.encode(), self._subject.digest.encode(), np.array(numbers, np.float64).tobytes())
        return self._folder / f"{self._subject.name}-{key}.npz"


def _casting_files() -> list[Path]:
    folder = Path(__file__).parent
    return [folder / name for name in CASTING]


def _digest(*parts: bytes) -> str:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part)
    return digest.hexdigest()[:16]
