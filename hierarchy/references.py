"""The files that a model refers to: only those of its own folder and below are opened."""

from __future__ import annotations

from pathlib import Path, PureWindowsPath
from urllib.parse import unquote

from hierarchy.recording import recorded


@recorded
def inside_folder(folder: Path, name: str) -> Path:
    """Return the path that a model in `folder` means by `name`.

    Names with drives, backslashes, percent-encoding or folders of another machine are common: where the name itself is
    not there, its last component is tried in the model's folder.
    Raises FileNotFoundError where there is none, PermissionError where the name leads out of the folder (by "..",
    as an absolute path or through a link). Nothing outside is touched to find out.
    """
    root = folder.resolve()
    plain = name.strip().replace("\\", "/")
    outside = False
    for spelled in dict.fromkeys((plain, unquote(plain).replace("\\", "/"))):
        for candidate in (spelled, spelled.rsplit("/", 1)[-1]):
            if not candidate or "\0" in candidate:
                continue
            path = _inside(root, candidate)
            if path is None:
                outside = True
            elif _is_file(path):
                return path
    if outside:
        raise PermissionError(f"{plain!r} leads out of the model's folder")
    raise FileNotFoundError(plain)


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:
        # The name is longer than names can be.
        return False


def _inside(root: Path, name: str) -> Path | None:
    """Return where `name` leads to, links resolved, or None where that is not below `root`."""
    joined = root / name
    # A drive or a server is not asked, whatever this system makes of the name.
    if PureWindowsPath(name).anchor and not joined.is_relative_to(root):
        return None
    try:
        path = joined.resolve()
    except RuntimeError:
        # Links that lead in a circle, before Python 3.13.
        return None
    return path if path.is_relative_to(root) else None
