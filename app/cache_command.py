"""`surfelscope cache`: where models that have been opened before are kept, how much that is, and off with it."""

from __future__ import annotations

from collections.abc import Callable

from app.cache import Cache
from app.cache_folder import VARIABLE, cached_files, clear, user_cache_folder
from app.errors import OutputError
from app.options import Options


def user_cache(options: Options, say: Callable[[str], None] = lambda what: None) -> Cache | None:
    """Return the user's cache; None: there is none, or it is not wanted.

    say : told in one line what the cache does
    """
    folder = user_cache_folder() if options.cache else None
    return None if folder is None else Cache(folder, say)


def run_cache(options: Options) -> None:
    """Print the folder of the cache and what is in it, or remove that. Raises OutputError."""
    folder = user_cache_folder()
    if folder is None:
        print(f"there is no cache: this user has no home. {VARIABLE} may name a folder for it")
        return
    if options.clear:
        try:
            count, size = clear(folder)
        except OSError as error:
            raise OutputError(f"{folder}: {error.strerror or error}") from error
        print(f"removed {count} files, {size / 1e6:.1f} MB, from {folder}")
        return
    files = cached_files(folder)
    models = sum(file.is_model for file in files)
    print(f"{folder}: {models} models, {sum(file.size for file in files) / 1e6:.1f} MB")
