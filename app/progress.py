"""What the commands without a window say while they work, all of it on standard error."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable


class Reporter:
    """Names each stage of the work when it begins, if wanted, and always passes warnings on."""

    def __init__(self, verbose: bool) -> None:
        self._verbose = verbose
        self._start = time.perf_counter()
        self._stage = ""

    def progress(self, stage: str, fraction: float) -> None:
        """Say that a stage has begun."""
        if stage != self._stage:
            self._stage = stage
            self.say(stage)

    def say(self, what: str) -> None:
        """Say something that only the curious want to know, after the seconds since the start."""
        if self._verbose:
            print(f"{time.perf_counter() - self._start:7.3f} s  {what}", file=sys.stderr)

    def warnings(self, warnings: Iterable[str]) -> None:
        """Pass on what had to be dropped or repaired."""
        for warning in warnings:
            print(f"surfelscope: warning: {warning}", file=sys.stderr)
