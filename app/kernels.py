"""Where compiled kernels are kept: in the user's cache folder, apart for every state of the program's code.

numba looks whether the file of a kernel has changed, not whether those of the kernels that it calls have. After an
update it would go on with parts of the program as it was.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import shutil
import sys
import tempfile
import time
from pathlib import Path

from app.cache_folder import user_cache_folder

# What numba reads; whoever sets it decides.
VARIABLE = "NUMBA_CACHE_DIR"
# The rooms with kernels.
ROOMS = ("hierarchy", "benchmarks")
# Kernels of programs that have not been started for so long (seconds) are removed.
FORGOTTEN = 30 * 24 * 3600.0


def keep_kernels_apart(parent: Path | None = None) -> None:
    """Let numba keep its kernels in a folder of this code's own; called before numba is imported.

    parent : where to make that folder; None: in the user's cache folder. Where that cannot be written, the kernels are
        compiled for this process alone
    """
    if os.environ.get(VARIABLE):
        return
    if parent is None:
        cache = user_cache_folder()
        parent = None if cache is None else cache / "kernels"
    folder = None if parent is None else parent / state_of_code()
    if parent is None or folder is None or not _is_usable(folder):
        # numba would give up where it finds no place at all.
        folder = Path(tempfile.mkdtemp(prefix="surfelscope-kernels-"))
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
    else:
        _forget_others(parent, folder)
    os.environ[VARIABLE] = str(folder)


def spare_blas() -> None:
    """Keep numba from importing scipy's linear algebra, 0.17 s, before the first kernel: none multiplies matrices."""
    from numba.np import linalg

    def refuse() -> None:
        raise ImportError

    # What numba does without is looked for once, when it is first needed.
    linalg.ensure_blas = refuse


def state_of_code() -> str:
    """Return what differs whenever a file with kernels does: 16 letters and digits."""
    digest = hashlib.blake2b(sys.version.encode(), digest_size=8)
    root = Path(__file__).resolve().parents[1]
    for room in ROOMS:
        for file in sorted((root / room).glob("*.py")):
            status = file.stat()
            digest.update(f"{room}/{file.name} {status.st_size} {status.st_mtime_ns}\n".encode())
    return digest.hexdigest()


def _is_usable(folder: Path) -> bool:
    """Make a folder, note that it is used, and tell whether it can be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
    except OSError:
        return False
    return os.access(folder, os.W_OK | os.X_OK)


def _forget_others(parent: Path, folder: Path) -> None:
    """Remove what other states of the code have left, if that was long ago."""
    try:
        for other in parent.iterdir():
            if other != folder and other.stat().st_mtime < time.time() - FORGOTTEN:
                shutil.rmtree(other, ignore_errors=True)
    except OSError:
        return
