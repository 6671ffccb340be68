"""The truth of every view of a subject, cast once and kept in files."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np

from app.errors import OutputError
from benchmarks.environment import ROOT
from benchmarks.rays import RayCaster
from benchmarks.reference import Reference, load_reference, save_reference
from benchmarks.shading import PictureShader, cast_with_picture
from benchmarks.subject import Subject
from hierarchy.view import View

# The code that decides what a reference holds.
CASTING = (
    "benchmarks/rays.py",
    "benchmarks/reference.py",
    "benchmarks/shading.py",
    "renderer/resolve_passes.py",
    "renderer/settings.py",
    "shaders/**/*.*",
)


class TruthCache:
    """Casts references, or finds them in a folder where the same mesh was cast before with the same code."""

    def __init__(self, folder: Path, subject: Subject, shader: PictureShader, samples: int) -> None:
        """samples : rays along one side of a pixel."""
        self._folder, self._subject, self._shader, self._samples = folder, subject, shader, samples
        self._caster: RayCaster | None = None
        files = [path for pattern in CASTING for path in sorted(ROOT.glob(pattern)) if path.suffix != ".pyc"]
        self._code = _digest(*(path.read_bytes() for path in files))
        self._last: tuple[Path, Reference] | None = None

    def holds(self, view: View) -> bool:
        """Tell whether the view need not be cast."""
        return self._path(view).is_file()

    def get(self, view: View) -> Reference:
        """Return the truth of a view; raises OutputError where it cannot be kept."""
        path = self._path(view)
        if self._last is not None and self._last[0] == path:
            return self._last[1]
        reference = load_reference(path)
        if reference is None:
            if self._caster is None:
                self._caster = RayCaster(self._subject.mesh)
            two_sided = not self._subject.mesh.closed
            reference = cast_with_picture(self._caster, view, self._shader, self._samples, two_sided=two_sided)
            try:
                self._folder.mkdir(parents=True, exist_ok=True)
                save_reference(path, reference)
            except OSError as error:
                raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from error
        self._last = path, reference
        return reference

    def _path(self, view: View) -> Path:
        """Name a reference by all that it depends on."""
        lens = [view.view_angle, view.parallel_scale or 0.0, view.width, view.height]
        numbers = [*view.eye_from_model.ravel(), *lens, self._samples]
        key = _digest(self._code.encode(), self._subject.digest.encode(), np.array(numbers, np.float64).tobytes())
        return self._folder / f"{self._subject.name}-{key}.npz"


def _digest(*parts: bytes) -> str:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part)
    return digest.hexdigest()[:16]
