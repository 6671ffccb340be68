"""The bar counts, keeps its line and estimates what is left; without a terminal there is a line a step."""

from __future__ import annotations

import io
from collections import Counter

import pytest

from benchmarks.progress import Progress, duration


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def clock(monkeypatch):
    now = [100.0]
    monkeypatch.setattr("benchmarks.progress.time.perf_counter", lambda: now[0])
    return now


def test_without_a_terminal_every_step_has_a_line(clock):
    stream = io.StringIO()
    progress = Progress(Counter(cast=1, record=2), stream=stream)
    for kind, text, seconds in (("cast", "front: casting", 4.0), ("record", "a", 1.0), ("record", "b", 2.0)):
        progress.begin(kind, text)
        clock[0] += seconds
    progress.close()
    assert stream.getvalue().splitlines() == ["1/3  front: casting  4.0 s", "2/3  a  1.0 s", "3/3  b  2.0 s"]


def test_the_rest_is_estimated_from_steps_of_the_same_kind(clock):
    progress = Progress(Counter(cast=2, record=10, size=1), {"size": 50.0}, io.StringIO())
    assert progress.remaining_s == 2 * 3.0 + 10 * 3.0 + 50.0
    for kind, seconds in (("cast", 8.0), ("record", 1.0), ("record", 2.0)):
        progress.begin(kind, "")
        clock[0] += seconds
    progress.end()
    assert progress.remaining_s == 1 * 8.0 + 8 * 1.5 + 50.0


def test_a_terminal_keeps_one_line(clock, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    stream = Terminal()
    progress = Progress(Counter(record=2), stream=stream)
    progress.begin("record", "a" * 100)
    progress.begin("record", "short")
    progress.close()
    text = stream.getvalue()
    assert text.count("\n") == 1
    assert all(len(line) == 59 for line in text.rstrip("\n").split("\r")[1:])
    assert "[####################] 2/2" in text
    assert "\x1b" not in text


def test_a_warning_has_a_line_of_its_own():
    stream = Terminal()
    progress = Progress(Counter(record=1), stream=stream)
    progress.begin("record", "something")
    progress.warn("it failed")
    assert stream.getvalue().endswith("\rsurfelscope: warning: it failed\n")


@pytest.mark.parametrize(
    ("seconds", "text"), [(0.4, "0 s"), (59.4, "59 s"), (90.0, "2 min"), (3540.0, "59 min"), (7380.0, "2 h 3 min")]
)
def test_durations(seconds, text):
    assert duration(seconds) == text
