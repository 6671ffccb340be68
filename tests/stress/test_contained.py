"""Readers of scanners' files: damage to LAS and E57, and to LAZ, whose reader works in a child process."""

import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from file_seeds import Seed, e57_seeds, las_seeds, laz_seeds
from mutations import mutate

from hierarchy.contained import read_contained
from hierarchy.e57 import read_e57
from hierarchy.las import is_compressed, read_las
from hierarchy.part import UnreadableFile

# What any file under 1 MB may take, in all.
MOST_SECONDS = 10.0

# What libraries complain of when they are handed rubbish is told to nobody.
pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")


def damaged(rng: np.random.Generator, seeds: list[Seed], cases: int) -> Iterator[bytes]:
    """Yield damaged files made of `seeds`, with checksums put right where the seed says so."""
    for _ in range(cases):
        seed, donor = (seeds[i] for i in rng.integers(len(seeds), size=2))
        yield seed.pack(mutate(rng, seed.files[seed.mutated], donor.files[donor.mutated], is_text=False))


def complaint(read: Callable[[Path], object], path: Path, *also: type[Exception]) -> str:
    """Return "" where a file opens or is refused as it should be, or else what went wrong."""
    try:
        read(path)
    except (UnreadableFile, *also):
        return ""
    except BaseException as error:
        return f"{type(error).__name__}: {error}"
    return ""


def read_plain_las(path: Path) -> None:
    if not is_compressed(path):
        read_las(path)


@pytest.mark.parametrize(
    ("kind", "seeds", "read", "also"),
    [
        ("LAS", las_seeds, read_plain_las, ()),
        # A word in the place of a number.
        ("E57", e57_seeds, lambda path: read_e57(path, []), (ValueError, OverflowError)),
    ],
)
def test_readers_of_our_own_answer_at_once(kind, seeds, read, also, ledger, amount, rng, tmp_path):
    cases, slowest, complaints = amount(150, 8_000), 0.0, []
    path = tmp_path / "damaged"
    # The first call compiles.
    path.write_bytes(seeds()[0].files[seeds()[0].mutated])
    read(path)
    with np.errstate(all="ignore"):
        for data in damaged(rng, seeds(), cases):
            path.write_bytes(data)
            start = time.thread_time()
            complaints.append(complaint(read, path, *also))
            slowest = max(slowest, time.thread_time() - start)
    assert [each for each in complaints if each] == []
    ledger.record(
        "files",
        f"{kind} reader",
        "bits, bytes, numbers, pieces; checksums put right; the reader alone",
        cases=cases,
        worst=slowest,
        bound=MOST_SECONDS,
        unit="s",
    )


def test_the_reader_in_a_child_process_answers_within_its_limits(ledger, amount, rng, tmp_path):
    cases = amount(6, 200)

    def one(numbered: tuple[int, bytes]) -> str:
        path = tmp_path / f"{numbered[0]}.laz"
        path.write_bytes(numbered[1])
        return complaint(lambda path: read_contained(path, "laz", []), path)

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        complaints = [each for each in pool.map(one, enumerate(damaged(rng, laz_seeds(), cases))) if each]
    print(*complaints, sep="\n")
    ledger.record(
        "files",
        "LAZ reader",
        "as LAS, each in a new process with its limits",
        cases=cases,
        worst=len(complaints),
        bound=0,
        unit="without an answer",
    )
