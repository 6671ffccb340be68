"""A child process that uses the cache as several do at once: opens a model, keeps it, damages or clears the cache.

Arguments: MODEL SEED ROUNDS. Prints "wrong ..." for every hierarchy that is not that of the model, at the end "done".
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from cache_models import same

from app import scene
from app.cache import Cache
from app.cache_folder import cached_files, clear, user_cache_folder
from app.scene import ModelSource, keep_scene, open_scene


def main() -> None:
    source, rng, rounds = ModelSource(Path(sys.argv[1])), np.random.default_rng(int(sys.argv[2])), int(sys.argv[3])
    scene.WORTH_KEEPING = -1.0
    folder = user_cache_folder()
    assert folder is not None
    cache = Cache(folder)
    wanted = open_scene(source)
    for _ in range(rounds):
        opened = open_scene(source, cache=cache)
        if not same(opened.hierarchy, wanted.hierarchy):
            print("wrong hierarchy", flush=True)
        keep_scene(opened, cache)
        chance = rng.random()
        if chance < 0.2:
            clear(folder)
        elif chance < 0.5:
            for file in cached_files(folder):
                try:
                    # As a whole: what a colleague has mapped must not shrink under it.
                    data = bytearray(file.path.read_bytes())
                    data[rng.integers(len(data))] ^= 1
                    part = file.path.with_name(f"damage-{sys.argv[2]}")
                    part.write_bytes(data[: rng.integers(1, len(data) + 1)])
                    part.replace(file.path)
                except FileNotFoundError:
                    continue
    print("done", flush=True)


if __name__ == "__main__":
    main()
