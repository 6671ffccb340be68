"""The octree's shape: every leaf on one path, ranges nested, few small nodes, bounded depth."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steps_of_codes import steps_of

from hierarchy.morton import SAME_PLACE
from hierarchy.octree import LEVELS_PER_HALVING, MIN_LEAVES, SPARE_LEVELS, build_octree, generations, most_levels

LAWS = settings(derandomize=True, deadline=None, max_examples=100)

# Clumps: many leaves in one cell, cells that share long prefixes, codes all over.
codes = st.lists(
    st.one_of(st.integers(0, 2**63 - 1), st.integers(0, 7), st.integers(0, 62).map(lambda bit: 1 << bit)),
    min_size=1,
    max_size=120,
).map(lambda values: np.array(sorted(values), np.uint64))


def children_of(octree, node):
    first = octree.first_child[node]
    return range(first, first + octree.child_count[node])


def depths_of(octree):
    depths = np.zeros(len(octree.first_child), int)
    for node in range(len(depths)):
        for child in children_of(octree, node):
            depths[child] = depths[node] + 1
    return depths


def assert_well_formed(octree, leaf_count, min_leaves):
    nodes = len(octree.first_child)
    parents = np.full(nodes, -1)
    owners = np.zeros(leaf_count, int)
    expected_first = 1
    for node in range(nodes):
        # Breadth-first: the children of consecutive nodes follow each other, behind their parents.
        assert octree.first_child[node] == expected_first
        assert octree.first_child[node] > node
        expected_first += octree.child_count[node]
        begin, end = octree.leaf_begin[node], octree.leaf_end[node]
        direct = end - begin
        assert direct >= 1
        place = begin
        for child in children_of(octree, node):
            parents[child] = node
            low, high = octree.leaf_begin[child], octree.leaf_end[child]
            # Children lie in the parent's range, one behind the other, and none is the parent again.
            assert place <= low < high <= end
            assert high - low < end - begin
            assert high - low >= min_leaves
            owners[place:low] += 1
            direct -= high - low
            place = high
        owners[place:end] += 1
        # What is left over was too few for a node.
        assert direct < 2 * min_leaves
    assert expected_first == nodes
    assert (octree.leaf_begin[0], octree.leaf_end[0]) == (0, leaf_count)
    # Every node but the root has a parent, every leaf hangs on exactly one node: one path leads to it.
    assert (parents[1:] >= 0).all()
    assert (owners == 1).all()
    assert depths_of(octree).max() < most_levels(leaf_count) < 128


@LAWS
@given(codes, st.integers(2, 9))
def test_any_leaves_make_a_well_formed_tree(codes, min_leaves):
    assert_well_formed(build_octree(steps_of(codes), min_leaves), len(codes), min_leaves)


@LAWS
@given(codes)
def test_nodes_are_cells_and_their_children_the_halves(codes):
    octree = build_octree(steps_of(codes), 2)
    for node in range(len(octree.first_child)):
        below = [int(c) for c in codes[octree.leaf_begin[node] : octree.leaf_end[node]]]
        split = (below[0] ^ below[-1]).bit_length()
        for child in children_of(octree, node):
            low, high = int(octree.leaf_begin[child]), int(octree.leaf_end[child])
            if split == 0:
                continue
            # All leaves of the child lie in one half of the cell, and no leaf outside it does.
            half = {int(c) >> (split - 1) for c in codes[low:high]}
            assert len(half) == 1
            others = [int(c) for k, c in enumerate(codes) if not low <= k < high]
            assert half.isdisjoint(c >> (split - 1) for c in others)


@LAWS
@given(codes)
def test_generations_are_runs_of_nodes_none_of_which_is_anothers_child(codes):
    octree = build_octree(steps_of(codes), 2)
    nodes, ends = len(octree.first_child), generations(octree.first_child, octree.child_count)
    assert (ends[0], ends[-1]) == (nodes, 0)
    assert (np.diff(ends) < 0).all()
    for node in range(nodes):
        run = np.flatnonzero(ends > node)[-1]
        assert all(child >= ends[run] for child in children_of(octree, node))
    # As few as can be: one for every level.
    assert len(ends) - 1 == depths_of(octree).max() + 1


def test_one_leaf():
    octree = build_octree(steps_of(np.array([5], np.uint64)))
    assert_well_formed(octree, 1, MIN_LEAVES)
    assert len(octree.first_child) == 1


def test_two_leaves():
    octree = build_octree(steps_of(np.array([5, 9], np.uint64)))
    assert_well_formed(octree, 2, MIN_LEAVES)
    assert len(octree.first_child) == 1


def test_all_in_one_cell():
    octree = build_octree(steps_of(np.full(100_000, 42, np.uint64)))
    assert_well_formed(octree, 100_000, MIN_LEAVES)
    # Split by number: the tree is balanced.
    assert depths_of(octree).max() <= 17


def test_clusters_in_clusters_a_thousand_levels_deep_make_a_shallow_tree():
    # Every bit of sixteen codes splits off a few leaves, and the last cell holds a hundred thousand.
    chain = np.repeat(np.arange(1000, dtype=np.uint16), MIN_LEAVES)[::-1]
    steps = np.concatenate([np.full(100_000, SAME_PLACE, np.uint16), chain])
    octree = build_octree(steps)
    assert_well_formed(octree, len(steps), MIN_LEAVES)
    depths = depths_of(octree)
    assert SPARE_LEVELS < depths.max() < most_levels(len(steps))
    # The work: how many nodes a leaf lies below, on average.
    below = (octree.leaf_end - octree.leaf_begin).sum() / len(steps)
    assert below <= SPARE_LEVELS + LEVELS_PER_HALVING * np.log2(len(steps))


def test_the_largest_models_paths_fit_the_traversals_stacks():
    assert most_levels(2**31 - 1) < 128


def test_a_chain_that_sheds_a_leaf_at_every_level():
    codes = np.concatenate([np.zeros(4, np.uint64), np.uint64(1) << np.arange(20, dtype=np.uint64)])
    octree = build_octree(steps_of(codes), 4)
    assert_well_formed(octree, len(codes), 4)
    # 24 leaves: the root, and one child fewer by one leaf at a time, down to 4 leaves.
    assert len(octree.first_child) == 21
    assert (octree.child_count[:-1] == 1).all()


def test_min_leaves_trades_nodes_for_loose_leaves():
    codes = np.sort(np.random.default_rng(2).integers(0, 2**63, 4000, dtype=np.uint64))
    nodes = [len(build_octree(steps_of(codes), n).first_child) for n in (2, 4, 8, 16)]
    assert nodes == sorted(nodes, reverse=True)
    # A binary tree over cells of two leaves or more.
    assert 1000 < nodes[0] < 4000
    assert nodes[3] < nodes[0] / 5


def test_fewer_than_two_leaves_make_no_node():
    codes = np.arange(16, dtype=np.uint64)
    for few in (-3, 0, 1):
        np.testing.assert_array_equal(
            build_octree(steps_of(codes), few).leaf_end, build_octree(steps_of(codes), 2).leaf_end
        )


def test_an_octree_needs_a_leaf():
    with pytest.raises(ValueError, match="at least one leaf"):
        build_octree(np.empty(0, np.uint16))
