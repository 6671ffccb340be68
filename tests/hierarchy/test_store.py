from dataclasses import fields, is_dataclass, replace

import numba
import numpy as np
import pytest

from hierarchy import store
from hierarchy.build import build_hierarchy
from hierarchy.hierarchy import Hierarchy
from hierarchy.leaves import Triangles
from hierarchy.meteoroid import make_meteoroid
from hierarchy.model import Mesh
from hierarchy.soundness import fault_of_hierarchy
from hierarchy.store import load_hierarchy, read_notes, save_hierarchy
from hierarchy.tensor_file import DamagedFile, map_tensors, write_tensors


def nothing(_fraction):
    """Hear of progress."""


def open_mesh() -> Mesh:
    """Half a meteoroid: it has openings."""
    mesh = make_meteoroid(2_000)
    return replace(mesh, faces=mesh.faces[mesh.positions[mesh.faces[:, 0], 2] > 0.0], closed=False)


@pytest.fixture(scope="module")
def hierarchies() -> dict[str, Hierarchy]:
    mesh = make_meteoroid(2_000)
    colors = np.random.default_rng(1).integers(0, 256, (len(mesh.positions), 4), dtype=np.uint8)
    return {
        "closed": build_hierarchy(mesh),
        "open": build_hierarchy(replace(open_mesh(), warnings=("one", "two \n lines"))),
        "coloured": build_hierarchy(replace(mesh, colors=colors, origin=np.array([0.1, 1e7, -1 / 3]), scale=0.25)),
        "points": build_hierarchy(replace(mesh, colors=colors), points=True),
    }


def assert_same(a, b, name="hierarchy"):
    assert type(a) is type(b), name
    if is_dataclass(a):
        for field in fields(a):
            assert_same(getattr(a, field.name), getattr(b, field.name), f"{name}.{field.name}")
    elif isinstance(a, np.ndarray):
        assert a.dtype == b.dtype, name
        assert np.array_equal(a, b), name
        # Or every kernel would be compiled a second time.
        assert numba.typeof(a) == numba.typeof(b), name
    else:
        assert a == b, name


@pytest.mark.parametrize("which", ["closed", "open", "coloured", "points"])
def test_hierarchies_come_back_as_they_were_to_the_last_field(which, hierarchies, tmp_path):
    hierarchy = hierarchies[which]
    save_hierarchy(tmp_path / "h", hierarchy, {"a": "b"}, nothing)
    loaded, notes = load_hierarchy(tmp_path / "h")
    assert_same(hierarchy, loaded)
    assert notes == read_notes(tmp_path / "h") == {"a": "b"}


def test_open_model_has_openings_to_keep(hierarchies):
    assert hierarchies["open"].openings is not None
    assert len(hierarchies["open"].openings.caps) > 0


def test_another_version_is_refused(hierarchies, tmp_path, monkeypatch):
    with monkeypatch.context() as other:
        other.setattr(store, "FORMAT", "surfelscope 0")
        save_hierarchy(tmp_path / "h", hierarchies["closed"], {}, nothing)
    for read in (load_hierarchy, read_notes):
        with pytest.raises(DamagedFile, match="another version"):
            read(tmp_path / "h")


def changed_nodes(hierarchy: Hierarchy, field: str, node: int, value: int) -> Hierarchy:
    nodes = hierarchy.nodes.copy()
    nodes[field][node] = value
    return replace(hierarchy, nodes=nodes)


@pytest.mark.parametrize(
    ("field", "node", "value"),
    [
        ("first_child", 0, 0), ("first_child", 0, 2), ("first_child", 3, -1), ("child_count", 0, 1),
        ("child_count", 0, -1), ("child_count", 0, 3), ("child_count", -1, 2), ("leaf_begin", 0, 1),
        ("leaf_end", 0, 1_000_000), ("leaf_end", 0, 7), ("leaf_begin", 5, -1), ("leaf_end", -1, 1_000_000),
        ("leaf_end", 1, 1_999), ("leaf_begin", 2, 0),
    ],
)  # fmt: skip
def test_nodes_that_kernels_must_not_follow_are_neither_kept_nor_taken(field, node, value, hierarchies, tmp_path):
    hierarchy = changed_nodes(hierarchies["closed"], field, node, value)
    with pytest.raises(ValueError, match=r"node|tree"):
        save_hierarchy(tmp_path / "h", hierarchy, {}, nothing)
    assert list(tmp_path.iterdir()) == []
    save_hierarchy(tmp_path / "h", hierarchies["closed"], {}, nothing)
    tensors, metadata = map_tensors(tmp_path / "h")
    tensors["nodes"][:] = hierarchy.nodes.view(np.float32).reshape(tensors["nodes"].shape)
    rest = {name: text for name, text in metadata.items() if name not in ("blocks", "checksum")}
    write_tensors(tmp_path / "h", tensors, rest)
    with pytest.raises(DamagedFile):
        load_hierarchy(tmp_path / "h")


def test_chain_deeper_than_the_kernels_stacks_is_refused(hierarchies):
    levels = 200
    nodes = np.zeros(levels, hierarchies["closed"].nodes.dtype)
    nodes["first_child"] = np.arange(1, levels + 1)
    nodes["child_count"][:-1] = 1
    nodes["leaf_end"] = hierarchies["closed"].leaf_count
    deep = replace(
        hierarchies["closed"],
        nodes=nodes,
        splats=hierarchies["closed"].splats[:levels],
        spreads=hierarchies["closed"].spreads[:levels],
    )
    assert fault_of_hierarchy(deep) == "too many levels"
    few = replace(deep, nodes=nodes[:100].copy(), splats=deep.splats[:100], spreads=deep.spreads[:100])
    few.nodes["child_count"][-1] = 0
    assert fault_of_hierarchy(few) == ""


@pytest.mark.parametrize("index", [-1, 10**6, -(2**31), 2**31 - 1])
def test_corner_that_is_no_vertex_is_refused(index, hierarchies):
    leaves = hierarchies["closed"].leaves
    assert isinstance(leaves, Triangles)
    indices = leaves.indices.copy()
    indices[17, 1] = index
    bad = replace(hierarchies["closed"], leaves=replace(leaves, indices=indices))
    assert fault_of_hierarchy(bad) == "corners that are no vertices"


def test_arrays_of_unlike_lengths_are_refused(hierarchies):
    closed, points = hierarchies["coloured"], hierarchies["points"]
    for bad in (
        replace(closed, splats=closed.splats[:-1]),
        replace(closed, spreads=closed.spreads[:-1]),
        replace(closed, colors=closed.colors[:-1]),
        replace(closed, leaves=replace(closed.leaves, normals=closed.leaves.normals[:-1])),
        replace(closed, leaves=replace(closed.leaves, colors=closed.leaves.colors[:-1])),
        replace(points, leaves=replace(points.leaves, radii=points.leaves.radii[:-1])),
        replace(points, splats=points.splats[:-1]),
        replace(closed, nodes=closed.nodes[:0], splats=closed.splats[:0], spreads=closed.spreads[:0], colors=None),
        replace(closed, scale=0.0),
        replace(closed, radius=float("nan")),
    ):
        assert fault_of_hierarchy(bad) != ""
