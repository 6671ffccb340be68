"""Libraries that only the benchmarks use, imported when they are needed."""

from __future__ import annotations

import importlib
from typing import Any

from app.errors import UsageError


def require(module: str, package: str) -> Any:
    """Import and return a module of the optional dependencies.

    module : dotted name to import
    package : what the package index calls it
    Raises UsageError, one line, where it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise UsageError(f"benchmarks need {package}: pip install 'surfelscope[bench]' ({error})") from error
