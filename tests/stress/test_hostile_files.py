"""A corpus of files that mean harm: each opens, or is refused with one line, soon and without much memory."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator

import numpy as np
import pytest
from file_seeds import SKINNED, all_seeds, gltf_scene, picture
from file_trials import Trial, run_trials
from hostile_files import crowds, far_points, misnamed, names, not_files, obj_files, other_files, ply_files, truncated
from hostile_scenes import archives, bomb_textures, gltf_files, mf_files, numbers_in, xml_files
from test_fuzz import report

from hierarchy.load import load_model
from hierarchy.model import ModelError, in_file_space
from hierarchy.part import UnreadableFile
from hierarchy.trimesh_files import read_with_trimesh


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
        "a megabyte of crowds": crowds(),
        "glTF that lies": gltf_files(),
        "images that unpack to gigabytes": bomb_textures(),
        "XML that grows, nests or asks for files": xml_files(seeds),
        "3MF that refers in circles or unpacks without end": mf_files(),
        "archives in archives, bombs": archives(),
        "numbers in LAS, LAZ and E57 headers": numbers_in(seeds, ("LAS", "LAZ", "E57"), 420),
    }


GROUPS = list(corpus(np.random.default_rng(1)))
# What is read in child processes up to their limits takes a while.
SLOW = (
    "a megabyte of crowds",
    "glTF that lies",
    "images that unpack to gigabytes",
    "3MF that refers in circles or unpacks without end",
    "archives in archives, bombs",
)


@pytest.mark.parametrize("group", GROUPS)
def test_files_that_mean_harm(group, rng, ledger, amount):
    if group in SLOW and not amount(0, 1):
        pytest.skip("not in the fast share")
    trials = list(corpus(rng)[group])
    tallies = run_trials(trials[:: amount(max(1, len(trials) // 6), 1)], workers=amount(1, 2))
    report(ledger, tallies)


SECRET = "12345.678"


@pytest.fixture
def beside_a_secret(tmp_path):
    """A folder for a model, beside which are files that no model may show, and a pipe that would be waited for."""
    (tmp_path / "model").mkdir()
    (tmp_path / "secret.txt").write_text(SECRET)
    (tmp_path / "secret.mtl").write_text("newmtl a\nKd 1 0 0\n")
    (tmp_path / "secret.png").write_bytes(picture("PNG"))
    (tmp_path / "secret.bin").write_bytes(gltf_scene()[1])
    os.mkfifo(tmp_path / "pipe.txt")
    (tmp_path / "model" / "link.mtl").symlink_to("../secret.mtl")
    (tmp_path / "model" / "link.bin").symlink_to("../secret.bin")
    return tmp_path / "model"


def ways_out(folder, name):
    """Return how a model in `folder` may call a file beside that folder."""
    outside = str(folder.parent / name)
    return (f"../{name}", outside, f"..\\{name}", f"%2e%2e/{name}", f"..%2f{name}", f"..%5c{name}",
            f"file://{outside}", f"./../{name}", f"../model/../{name}", f"link{name[name.index('.'):]}",
            outside.replace("/", "%2F"))  # fmt: skip


def test_obj_files_get_nothing_from_outside_their_folder(beside_a_secret):
    path = beside_a_secret / "a.obj"
    for name in ways_out(beside_a_secret, "secret.mtl"):
        path.write_text(f"mtllib {name}\nusemtl a\n" + SKINNED)
        assert load_model(path).colors is None, name
    for name in ways_out(beside_a_secret, "secret.png"):
        (beside_a_secret / "a.mtl").write_text(f"newmtl a\nmap_Kd {name}\n")
        path.write_text("mtllib a.mtl\nusemtl a\n" + SKINNED)
        assert load_model(path).colors is None, name
    # The same material file inside the folder is read.
    (beside_a_secret / "a.mtl").write_text("newmtl a\nKd 1 0 0\n")
    assert load_model(path).colors is not None


def test_gltf_files_get_nothing_from_outside_their_folder(beside_a_secret):
    scene, buffer = gltf_scene()
    path = beside_a_secret / "a.gltf"

    def colors_of(**changes):
        path.write_text(json.dumps({**scene, **changes}))
        (part,) = read_with_trimesh(path, "gltf", [])
        return part.texture

    for name in ways_out(beside_a_secret, "secret.bin"):
        with pytest.raises(UnreadableFile, match="is not in its folder"):
            colors_of(buffers=[{"byteLength": len(buffer), "uri": name}])
    inside = [{"byteLength": len(buffer), "uri": "in%20side.bin"}]
    (beside_a_secret / "in side.bin").write_bytes(buffer)
    assert colors_of(buffers=inside) is not None
    # A model does without an image.
    for name in ways_out(beside_a_secret, "secret.png"):
        assert colors_of(buffers=inside, images=[{"uri": name}]) is None, name


@pytest.mark.parametrize("suffix", ["dae", "3mf"])
def test_xml_shows_nothing_from_outside(beside_a_secret, suffix):
    """An entity that stands for a file would put it among the coordinates, and one for a pipe would wait."""
    (seed,) = [each for each in all_seeds() if each.name == f"a.{suffix}" and each.is_text]
    text = seed.files[seed.name].decode()
    number = re.search(r'(?<=[ >"])1(\.0*)?(?=[ <"])', text[text.index("mesh") :])
    assert number is not None
    start = text.index("mesh") + number.start()
    for target in (beside_a_secret.parent / "secret.txt", beside_a_secret.parent / "pipe.txt"):
        for url in (f"file://{target}", target):
            doctype = f'<!DOCTYPE x [<!ENTITY a SYSTEM "{url}">]>'
            changed = text[:start] + "&a;" + text[start + len(number[0]) :]
            at = changed.index("?>") + 2 if changed.startswith("<?xml") else 0
            path = beside_a_secret / f"a.{suffix}"
            path.write_bytes(seed.pack((changed[:at] + doctype + changed[at:]).encode()))
            try:
                mesh = load_model(path)
            except ModelError:
                continue
            assert np.abs(in_file_space(mesh, mesh.positions)).max() < 100.0
