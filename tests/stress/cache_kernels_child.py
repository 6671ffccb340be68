"""A child process that changes hierarchies, stores them with checksums that fit, and runs what is accepted.

Arguments: FOLDER SEED CASES. The folder holds `hierarchy`, as hierarchy.store writes it. Prints "refused"
or "ran" for every case; a crash ends the process, and what has been printed until then tells the case.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np

from hierarchy.lod import select_cut
from hierarchy.normal_tiles import count_tiles
from hierarchy.promises import promised_errors
from hierarchy.store import load_hierarchy
from hierarchy.tensor_file import DamagedFile, map_tensors, write_tensors
from hierarchy.view import View, look_at

INTEGERS = (0, 1, -1, 2, 3, 2**31 - 1, -(2**31), 0x7F800000, 1000)


def damage(array: np.ndarray, rng: np.random.Generator) -> None:
    """Change some elements of an array, bit by bit or to numbers at the limits."""
    words = array.reshape(-1).view({8: np.uint64, 4: np.uint32, 2: np.uint16, 1: np.uint8}[array.itemsize])
    if len(words) == 0:
        return
    for _ in range(rng.integers(1, 4)):
        place = rng.integers(len(words))
        # Of the nodes' columns, the integers are what kernels go by.
        if array.ndim == 2 and array.shape[1] == 20 and rng.random() < 0.7:
            place = rng.integers(len(array)) // (1 if rng.random() < 0.5 else 64) * 20 + 16 + rng.integers(4)
        if array.itemsize == 4 and rng.random() < 0.5:
            words[place] = np.array(rng.choice(INTEGERS), np.int64).astype(np.uint32)
        else:
            words[place] ^= words.dtype.type(1 << int(rng.integers(8 * array.itemsize)))


def reshape(tensors: dict[str, np.ndarray], rng: np.random.Generator) -> None:
    """Drop, shorten or lengthen an array."""
    name = rng.choice(sorted(tensors))
    kind = rng.integers(3)
    if kind == 0:
        del tensors[name]
    elif kind == 1:
        tensors[name] = tensors[name][: rng.integers(len(tensors[name]) + 1)]
    else:
        tensors[name] = np.concatenate([tensors[name], tensors[name][:1]])


def views(hierarchy) -> list[View]:
    eyes = ((0.0, 0.0, 3.0), (0.1, 0.2, 0.3), (50.0, 1.0, 2.0))
    placed = {"origin": hierarchy.origin, "scale": hierarchy.scale, "bounds": hierarchy.bounds}
    looks = []
    for eye in eyes:
        at = hierarchy.origin + hierarchy.scale * np.array(eye)
        try:
            looks.append(
                look_at(at, hierarchy.origin, np.array([0.0, 1.0, 0.0]), math.radians(45.0), (64, 64), **placed)
            )
        except (ValueError, ArithmeticError):
            continue
    return looks


def run(folder: Path, rng: np.random.Generator) -> str:
    """Store a changed hierarchy; run all kernels on it if it is accepted."""
    tensors, metadata = map_tensors(folder / "hierarchy")
    if rng.random() < 0.1:
        reshape(tensors, rng)
    else:
        damage(tensors[rng.choice(sorted(tensors))], rng)
    kept = {k: v for k, v in metadata.items() if k not in ("blocks", "checksum")}
    write_tensors(folder / "changed", tensors, kept)
    try:
        hierarchy, _ = load_hierarchy(folder / "changed")
    except DamagedFile:
        return "refused"
    for view in views(hierarchy):
        for r_sil in (0.1, 3.0):
            cut = select_cut(hierarchy, view, r_sil, 4.0 * r_sil)
            promised_errors(hierarchy, view, cut, (4, 16))
    count_tiles(hierarchy, 4)
    return "ran"


def main() -> None:
    folder, seed, cases = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    with np.errstate(all="ignore"):
        for case in range(cases):
            try:
                print(run(folder, np.random.default_rng([seed, case])), flush=True)
            except (ValueError, ArithmeticError, MemoryError) as error:
                # What is no picture may be refused by numbers; what crashes may not.
                print(f"raised {type(error).__name__}", flush=True)


if __name__ == "__main__":
    main()
