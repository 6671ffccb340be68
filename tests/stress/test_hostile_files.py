"""A corpus of files that mean harm: each opens, or is refused with one line, soon and without much memory."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from file_seeds import all_seeds
from file_trials import Trial, run_trials
from hostile_files import far_points, misnamed, names, not_files, obj_files, other_files, ply_files, truncated
from hostile_scenes import archives, bomb_textures, gltf_files, mf_files, numbers_in, xml_files
from test_fuzz import report


def corpus(rng) -> dict[str, Iterator[Trial]]:
    """Return all trials by what they have in common."""
    seeds = all_seeds()
    return {
        "cut off at every line and at random": truncated(seeds, rng, 25),
        "contents under other names, zipped, gzipped": misnamed(seeds),
        "PLY headers that lie": ply_files(),
        "OBJ files that ask for much or for files elsewhere": obj_files(),
        "STL, OFF and text that lie": other_files(),
        "names of several lines, of control characters, of no text": names(),
        "pipes, devices, folders and links": not_files(),
        "sizes from 1e-320 to 1e300": far_points(),
        "glTF that lies": gltf_files(),
        "images that unpack to gigabytes": bomb_textures(),
        "XML that grows, nests or asks for files": xml_files(seeds),
        "3MF that refers in circles or unpacks without end": mf_files(),
        "archives in archives, bombs": archives(),
        "numbers in LAS, LAZ and E57 headers": numbers_in(seeds, ("LAS", "LAZ", "E57"), 420),
    }


GROUPS = list(corpus(np.random.default_rng(1)))


@pytest.mark.parametrize("group", GROUPS)
def test_files_that_mean_harm(group, rng, ledger, amount):
    trials = list(corpus(rng)[group])
    tallies = run_trials(trials[:: amount(max(1, len(trials) // 6), 1)])
    report(ledger, tallies)
