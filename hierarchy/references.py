"""The files that a model refers to: only those of its own folder and below are opened."""

from __future__ import annotations

from pathlib import Path


def inside_folder(folder: Path, name: str) -> Path:
    """Return the path that a model in `folder` means by `name`.

    Names with drives, backslashes or folders of another machine are common: where the name itself is not there,
    its last component is tried in the model's folder.
    Raises FileNotFoundError where there is none, PermissionError where the name leads out of the folder (by "..",
    as an absolute path or through a link).
    """
    root = folder.resolve()
    plain = name.strip().replace("\\", "/")
    outside = False
    for candidate in (plain, plain.rsplit("/", 1)[-1]):
        if not candidate or "\0" in candidate:
            continue
        path = (root / candidate).resolve()
        if not path.is_relative_to(root):
            outside = True
        elif path.is_file():
            return path
    if outside:
        raise PermissionError(f"{plain!r} leads out of the model's folder")
    raise FileNotFoundError(plain)
