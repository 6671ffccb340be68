"""Ctrl-C at any moment: quiet, at once, and nothing is left behind that the next start does not put right."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from cache_models import same, small_model

from app import scene
from app.cache import Cache
from app.scene import ModelSource, Scene, open_scene

ROOT = Path(__file__).parents[2]

# A shell says 130 of both: a process that ends so by itself, and one that the signal ended before it could.
INTERRUPTED = (130, -signal.SIGINT)
# What bench says of its progress, which is no complaint.
PROGRESS = re.compile(r"^\d+/\d+  .*\n", re.MULTILINE)


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> Scene:
    return open_scene(ModelSource(small_model(tmp_path_factory.mktemp("model") / "small.ply", 5_000)))


def run(line: list[str], delay: float | None, folder: Path) -> tuple[int, str, float]:
    """Run a command and interrupt it; return its status, what it complained of and how long it went on after that."""
    process = subprocess.Popen(
        [sys.executable, "-m", "app.cli", *line],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    if delay is not None:
        time.sleep(delay)
        process.send_signal(signal.SIGINT)
    start = time.monotonic()
    _, said = process.communicate(timeout=300)
    return process.returncode, PROGRESS.sub("", said), time.monotonic() - start


def struck_before_the_program(complaints: str) -> bool:
    """Tell whether Python itself was interrupted, before it had come to the program's first line."""
    return "KeyboardInterrupt" in complaints and "in main" not in complaints


def test_interrupts(ledger, amount, rng, built, cache_folder, tmp_path):
    model = str(built.source.path)
    picture = tmp_path / "a.png"
    commands = {
        "info": ["info", model, "--w-s", "2"],
        "render": ["render", model, "--w-s", "2", "--resolution", "300,300", "--output", str(picture)],
        "cache": ["cache"],
        "bench": ["bench", model, "--quick", "--output", str(tmp_path / "run.json")],
    }
    # Uninterrupted and without a cache: how long that takes, and what the picture is.
    start = time.monotonic()
    assert run(commands["render"], None, tmp_path)[:2] == (0, "")
    longest = time.monotonic() - start
    whole = picture.read_bytes()
    took = {"info": longest, "render": longest, "cache": 0.5 * longest, "bench": 2.0 * longest}
    wrong, cases = [], 0
    for name, line in commands.items():
        for _ in range(amount(int(name == "render"), {"info": 25, "render": 20}.get(name, 6))):
            cases += 1
            if rng.random() < 0.5:
                for path in cache_folder.glob("*.safetensors"):
                    path.unlink()
            delay = rng.uniform(0.0, 1.1 * took[name])
            status, complaints, seconds = run(line, delay, tmp_path)
            if status not in (0, *INTERRUPTED) or (complaints and not struck_before_the_program(complaints)):
                wrong.append(f"{name} after {delay:.3f} s: {status} {complaints}")
            if seconds > 10.0 and status != 0:
                wrong.append(f"{name} after {delay:.3f} s: went on for {seconds:.1f} s")
            opened = scene._find(built.source, Cache(cache_folder))
            if opened is not None and not same(opened.hierarchy, built.hierarchy):
                wrong.append(f"{name} after {delay:.3f} s: a damaged cache")
            left = [path.name for path in cache_folder.glob(".*.part")] + [
                path.name for path in tmp_path.glob(".*.part")
            ]
            if left or picture.read_bytes() != whole:
                wrong.append(f"{name} after {delay:.3f} s: left {left}")
    assert wrong == []
    ledger.record(
        "faults", "Ctrl-C", "info, render, cache and bench interrupted at random moments, half of them without a cache",
        cases=cases, worst=len(wrong), bound=0, unit="loud, late, lost or left",
    )  # fmt: skip
