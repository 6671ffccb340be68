"""Fifty thousand damaged files: each opens, or is refused with one line."""

from __future__ import annotations

import itertools
import zlib
from collections.abc import Iterator

import numpy as np
import pytest
from file_seeds import Seed, all_seeds
from file_trials import MOST_MEGABYTES, MOST_SECONDS, Tally, Trial, run_trials
from mutations import mutate

# How the files are shared out. What is read in a child process takes ten times as long as what is not.
SHARES = {"PLY": 11, "OBJ": 9, "images as textures": 5, "STL": 4, "points as text": 4, "LAS": 6, "E57": 6, "LAZ": 2,
          "glTF": 1.5, "GLB": 1.5, "3MF": 1.5, "OFF": 1, "COLLADA": 1, "archives of models": 0.5}  # fmt: skip

# One of so many is drawn.
DRAWN = 100
# One of so many becomes a point hierarchy, for which a few large triangles are cut into 100,000 discs.
POINTS = 499
# One of so many is read by a child process as it always is, which takes a second to start.
REAL = 499


def damaged(seeds: list[Seed], seed: int, cases: int) -> Iterator[Trial]:
    """Yield `cases` damaged files; what each is depends on its kind and number and on `seed` alone."""
    total = sum(SHARES.values())
    for kind, share in SHARES.items():
        of_kind = [each for each in seeds if each.kind == kind]
        contents = [each.files[each.mutated] for each in seeds]
        for number in range(max(1, round(cases * share / total))):
            rng = np.random.default_rng([seed, zlib.crc32(kind.encode()), number])
            whole = of_kind[number % len(of_kind)]
            donor = contents[rng.integers(len(contents))]
            data = whole.pack(mutate(rng, whole.files[whole.mutated], donor, is_text=whole.is_text))
            label = f"damage {number} to {whole.mutated} with --stress-seed {seed}"
            options = ("--no-cache", *(("--points",) if number % POINTS == 3 else ()), *whole.options)
            yield Trial(
                kind,
                {**whole.files, whole.mutated: data},
                whole.name,
                options,
                number % DRAWN == 5,
                label,
                number % REAL != 9,
            )


def interleaved(trials: Iterator[Trial], ways: int) -> Iterator[Trial]:
    """Yield the same trials in another order, so that slow kinds do not all come at the end."""
    everything = list(trials)
    for start in range(ways):
        yield from everything[start::ways]


# What the table says of all of them.
TRIED = "damaged at random, cut off at every line, and made by hand to mean harm"


def report(ledger, tallies: dict[str, Tally]) -> None:
    """Fail with all that is not as promised, else note the slowest and the largest of each kind."""
    failures = list(itertools.chain.from_iterable(tally.failures for tally in tallies.values()))
    assert not failures, f"{len(failures)} failures, of them:\n" + "\n".join(failures[:20])
    for kind, tally in tallies.items():
        ledger.record("files", kind, TRIED, cases=tally.cases, worst=tally.seconds, bound=MOST_SECONDS, unit="s")
    largest = max(tally.megabytes for tally in tallies.values())
    ledger.record(
        "files", "memory", "the largest of all kinds", cases=0, worst=largest, bound=MOST_MEGABYTES, unit="MB"
    )


@pytest.fixture(scope="module")
def seeds() -> list[Seed]:
    return all_seeds()


def test_every_seed_opens_and_can_be_drawn(seeds, amount):
    every = amount(6, 1)
    tallies = run_trials(whole(each, number) for number, each in enumerate(seeds) if number % every == 0)
    assert [kind for kind, tally in tallies.items() if tally.failures or not tally.opened] == []


def whole(seed: Seed, number: int) -> Trial:
    files = {**seed.files, seed.mutated: seed.pack(seed.files[seed.mutated])}
    return Trial(f"{seed.kind} {number}", files, seed.name, ("--no-cache",), True, "whole", number % 10 != 0)


def test_damaged_files_open_or_are_refused_with_one_line(seeds, ledger, amount, pytestconfig):
    seed, cases = pytestconfig.getoption("--stress-seed"), amount(120, 47_000)
    workers = amount(1, 2)
    tallies = run_trials(interleaved(damaged(seeds, seed, cases), 16), workers=workers)
    assert sum(tally.cases for tally in tallies.values()) >= 0.95 * cases
    # Damage that nothing survives would try little, and so would damage that changes nothing.
    opened = sum(tally.opened for tally in tallies.values())
    assert 0.1 * cases < opened < 0.8 * cases
    report(ledger, tallies)
