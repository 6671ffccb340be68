"""What the benchmarks say while they measure: a bar where somebody watches, a line a step elsewhere."""

from __future__ import annotations

import shutil
import sys
import time
from collections import Counter
from collections.abc import Mapping
from typing import TextIO

BAR_WIDTH = 20
# Seconds that a step is taken to need before one of its kind has been done, if nobody knows better.
FIRST_GUESS = 3.0


class Progress:
    """Counts steps of several kinds, of which each has a duration of its own.

    It neither hides the cursor nor changes anything else of the terminal: the process may end at any moment.
    """

    def __init__(
        self, steps: Counter[str], guesses: Mapping[str, float] | None = None, stream: TextIO | None = None
    ) -> None:
        """Expect some steps of each kind.

        guesses : seconds of a step by its kind
        stream : None: standard error
        """
        self._left = Counter(steps)
        self._guesses = guesses or {}
        self._total = sum(steps.values())
        self._spent: dict[str, list[float]] = {}
        self._stream = sys.stderr if stream is None else stream
        self._bar = self._stream.isatty()
        self._kind, self._text = "", ""
        self._start = 0.0

    def begin(self, kind: str, text: str) -> None:
        """Say what is being done now; it ends the last step."""
        self.end()
        self._kind, self._text, self._start = kind, text, time.perf_counter()
        if self._bar:
            self._draw()

    def end(self) -> None:
        """End the step that was begun last."""
        if not self._kind:
            return
        seconds = time.perf_counter() - self._start
        self._spent.setdefault(self._kind, []).append(seconds)
        self._left[self._kind] = max(self._left[self._kind] - 1, 0)
        if self._bar:
            self._draw()
        else:
            print(f"{self._done}/{self._total}  {self._text}  {seconds:.1f} s", file=self._stream, flush=True)
        self._kind = ""

    def warn(self, text: str) -> None:
        """Say that a step has failed; the line stays."""
        if self._bar:
            print(f"\r{'':<{self._width}}\r", end="", file=self._stream)
        print(f"surfelscope: warning: {text}", file=self._stream, flush=True)

    def close(self) -> None:
        """End the last step and leave the line."""
        self.end()
        if self._bar and self._text:
            print(file=self._stream, flush=True)

    @property
    def remaining_s(self) -> float:
        """Seconds that the steps that are left will take, at the mean of those of their kind so far."""
        return sum(count * self._mean(kind) for kind, count in self._left.items())

    @property
    def _done(self) -> int:
        return self._total - sum(self._left.values())

    @property
    def _width(self) -> int:
        return shutil.get_terminal_size().columns - 1

    def _mean(self, kind: str) -> float:
        spent = self._spent.get(kind)
        return sum(spent) / len(spent) if spent else self._guesses.get(kind, FIRST_GUESS)

    def _draw(self) -> None:
        filled = BAR_WIDTH * self._done // max(self._total, 1)
        bar = "#" * filled + "-" * (BAR_WIDTH - filled)
        line = f"[{bar}] {self._done}/{self._total}  {duration(self.remaining_s)} left  {self._text}"
        # Erase what a longer line left, without wrapping.
        print(f"\r{line[: self._width]:<{self._width}}", end="", file=self._stream, flush=True)


def duration(seconds: float) -> str:
    """Return seconds for people."""
    if seconds < 60.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"
