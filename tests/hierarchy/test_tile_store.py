"""Tiles come back from a file as they were, and nothing comes back that is none."""

from dataclasses import replace

import numpy as np
import pytest
from same_tiles import assert_same_tiles

from hierarchy import tile_store
from hierarchy.build import build_hierarchy
from hierarchy.meteoroid import make_meteoroid
from hierarchy.normal_tiles import TileBaker
from hierarchy.tensor_file import DamagedFile, map_tensors, write_tensors
from hierarchy.tile_parts import chosen
from hierarchy.tile_shelf import ShownTiles
from hierarchy.tile_sizes import sides_of
from hierarchy.tile_store import load_tiles, save_tiles

TEXELS = 8


def hierarchy_of(*, colored):
    mesh = make_meteoroid(2_000)
    colors = np.random.default_rng(1).integers(0, 256, (len(mesh.positions), 4), dtype=np.uint8)
    return build_hierarchy(replace(mesh, colors=colors if colored else None))


@pytest.fixture(scope="module")
def hierarchies():
    return {"plain": hierarchy_of(colored=False), "coloured": hierarchy_of(colored=True)}


def shown_of(hierarchy):
    nodes = np.arange(1, hierarchy.node_count, 3, dtype=np.uint32)
    most = np.random.default_rng(2).choice(sides_of(TEXELS), len(nodes)).astype(np.int32)
    return ShownTiles(TEXELS, TileBaker(hierarchy, TEXELS).fitted(nodes, most))


@pytest.mark.parametrize("which", ["plain", "coloured"])
def test_tiles_come_back_as_they_were(which, hierarchies, tmp_path):
    hierarchy = hierarchies[which]
    shown = shown_of(hierarchy)
    assert len(shown.tiles.normals) > 1
    size = save_tiles(tmp_path / "t", shown, hierarchy, "entry")
    assert size == (tmp_path / "t").stat().st_size
    loaded = load_tiles(tmp_path / "t", hierarchy, TEXELS, "entry")
    assert loaded.texels == TEXELS
    assert_same_tiles(loaded.tiles, shown.tiles)


def test_nodes_without_tiles_come_back_too(hierarchies, tmp_path):
    hierarchy = hierarchies["plain"]
    tiles = shown_of(hierarchy).tiles
    for places in (np.flatnonzero(tiles.sides == 0), np.arange(0)):
        shown = ShownTiles(TEXELS, chosen(tiles, places))
        save_tiles(tmp_path / "t", shown, hierarchy, "entry")
        assert_same_tiles(load_tiles(tmp_path / "t", hierarchy, TEXELS, "entry").tiles, shown.tiles)


def test_tiles_of_something_else_are_refused(hierarchies, tmp_path, monkeypatch):
    hierarchy = hierarchies["plain"]
    path = tmp_path / "t"
    save_tiles(path, shown_of(hierarchy), hierarchy, "entry")
    for texels, entry in ((TEXELS, "other"), (16, "entry")):
        with pytest.raises(DamagedFile, match="something else"):
            load_tiles(path, hierarchy, texels, entry)
    # The same name, as no program would give it.
    with pytest.raises(DamagedFile, match="not as many texels"):
        load_tiles(path, hierarchies["coloured"], TEXELS, "entry")
    small = build_hierarchy(make_meteoroid(200))
    with pytest.raises(DamagedFile, match="nodes"):
        load_tiles(path, replace(small, leaves=replace(small.leaves, colors=None)), TEXELS, "entry")
    monkeypatch.setattr(tile_store, "FORMAT", "surfelscope tiles 0")
    with pytest.raises(DamagedFile, match="another version"):
        load_tiles(path, hierarchy, TEXELS, "entry")


def changes(tensors):
    """Return by what is wrong with them arrays of tiles, None: one that is left out."""
    nodes, most, sides = tensors["nodes"], tensors["most"], tensors["sides"]
    largest = tensors[f"normals.{sides.max()}"]
    return {
        "node twice": {"nodes": np.where(nodes == nodes[5], nodes[4], nodes)},
        "nodes out of order": {"nodes": nodes[::-1].copy()},
        "node beyond the last": {"nodes": np.where(nodes == nodes[-1], np.uint32(2**32 - 1), nodes)},
        "nodes of another kind": {"nodes": nodes.astype(np.int32)},
        "fewer nodes": {"nodes": nodes[1:]},
        "nodes in two columns": {"nodes": np.stack([nodes, nodes], axis=1)},
        "size that no tile may have": {"most": np.full_like(most, 3)},
        "size below none": {"sides": np.full_like(sides, -1)},
        "size that no tile has": {"sides": np.where(sides == 2, 3, sides)},
        "more texels than allowed": {"most": np.full_like(most, 2)},
        "spreads of three": {"spreads": tensors["spreads"][:, :3].copy()},
        "no spreads": {"spreads": None},
        "no texels": {f"normals.{sides.max()}": None},
        "one tile too few": {f"normals.{sides.max()}": largest[1:]},
        "tiles that are not square": {f"normals.{sides.max()}": largest[:, 1:].copy()},
        "texels as floats": {f"normals.{sides.max()}": largest.astype(np.float32)},
        "colours where there are none": {f"colors.{sides.max()}": np.repeat(largest, 2, axis=-1)},
    }


def test_arrays_that_are_no_tiles_are_refused(hierarchies, tmp_path):
    """With checksums that fit: as a program that is wrong could write them."""
    hierarchy = hierarchies["plain"]
    save_tiles(tmp_path / "t", shown_of(hierarchy), hierarchy, "entry")
    tensors, metadata = map_tensors(tmp_path / "t")
    kept = {name: text for name, text in metadata.items() if name not in ("checksum", "blocks")}
    write_tensors(tmp_path / "same", tensors, kept)
    load_tiles(tmp_path / "same", hierarchy, TEXELS, "entry")
    for what, change in changes(tensors).items():
        changed = {name: array for name, array in {**tensors, **change}.items() if array is not None}
        write_tensors(tmp_path / "changed", changed, kept)
        try:
            load_tiles(tmp_path / "changed", hierarchy, TEXELS, "entry")
        except DamagedFile:
            continue
        pytest.fail(f"{what} was believed")


def test_tiles_that_could_not_be_used_again_replace_nothing(hierarchies, tmp_path):
    hierarchy = hierarchies["plain"]
    shown = shown_of(hierarchy)
    save_tiles(tmp_path / "t", shown, hierarchy, "entry")
    good = (tmp_path / "t").read_bytes()
    wrong = ShownTiles(TEXELS, replace(shown.tiles, nodes=shown.tiles.nodes[::-1].copy()))
    with pytest.raises(ValueError, match="nodes"):
        save_tiles(tmp_path / "t", wrong, hierarchy, "entry")
    assert (tmp_path / "t").read_bytes() == good
