"""Rooms grow until what is found fits, and a cut is the caller's own."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numba as nb
import numpy as np
import pytest
from small_models import bumpy_sphere, surfel_sphere

from hierarchy import room
from hierarchy.build import build_hierarchy
from hierarchy.lod import select_cut
from hierarchy.prefetch import prefetch
from hierarchy.view import look_at

MODELS = {"mesh": lambda: bumpy_sphere(4), "cloud": lambda: surfel_sphere(3000)}


def view_of(hierarchy, position=(0.3, 0.4, 3.0)):
    return look_at(position, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.8, (300, 200), bounds=hierarchy.bounds)


def in_a_thread_of_its_own(work):
    """Return the result of a call in a thread that has no rooms yet."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(work).result()


def same(one, other):
    return all(
        np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b
        for a, b in zip(vars(one).values(), vars(other).values(), strict=True)
    )


@pytest.mark.parametrize("radii", [(0.0, 0.0), (1.0, 4.0), (20.0, 50.0)])
@pytest.mark.parametrize("model", MODELS)
def test_a_cut_is_the_same_however_little_room_there_was(model, radii, monkeypatch):
    hierarchy = build_hierarchy(MODELS[model]())
    view = view_of(hierarchy)
    ample = in_a_thread_of_its_own(lambda: select_cut(hierarchy, view, *radii))
    assert len(ample.splats) + len(ample.indices) < room.FIRST, "there was room from the start"
    monkeypatch.setattr(room, "FIRST", 1)
    tight = in_a_thread_of_its_own(lambda: select_cut(hierarchy, view, *radii))
    assert same(ample, tight)
    assert len(tight.splats) + len(tight.indices) > 1


@pytest.mark.parametrize("model", MODELS)
def test_a_cut_outlives_the_next_selection(model):
    hierarchy = build_hierarchy(MODELS[model]())
    first = select_cut(hierarchy, view_of(hierarchy), 2.0, 30.0)
    splats, indices = first.splats.copy(), first.indices.copy()
    assert len(splats) + len(indices) > 50
    second = select_cut(hierarchy, view_of(hierarchy, (3.0, -0.2, 0.1)), 3.0, 20.0)
    assert not same(first, second)
    np.testing.assert_array_equal(first.splats, splats)
    np.testing.assert_array_equal(first.indices, indices)


def test_every_thread_has_rooms_of_its_own():
    mine = room.rooms(2)
    assert room.rooms(2) == mine
    assert room.rooms(1) == mine[:1]
    theirs = in_a_thread_of_its_own(lambda: room.rooms(2))
    assert not set(map(id, mine)) & set(map(id, theirs))


@nb.njit
def sum_ahead(values, ahead):
    total = 0.0
    for i in range(len(values)):
        prefetch(values, i + ahead)
        total += values[i]
    return total


@pytest.mark.parametrize("ahead", [0, 7, -(10**9), 10**12])
def test_fetching_ahead_changes_nothing_and_may_reach_anywhere(ahead):
    assert sum_ahead(np.arange(100.0), ahead) == 4950.0
