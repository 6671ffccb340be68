import threading
import time

import pytest

from app import keeper as keeper_module
from app.keeper import Keeper


@pytest.fixture
def kept(monkeypatch):
    """The scenes that a keeper has kept; each takes as long as an event tells."""
    kept = []
    go_on = threading.Event()

    def keep(scene, cache, progress):
        while not go_on.wait(0.01):
            progress(0.5)
        kept.append(scene)

    monkeypatch.setattr(keeper_module, "keep_scene", keep)
    return kept, go_on


def test_scenes_are_kept_in_their_order_and_closing_waits_for_them(kept):
    scenes, go_on = kept
    keeper = Keeper(None)
    for number in range(3):
        keeper.keep(number)
    go_on.set()
    keeper.close(30.0)
    assert scenes == [0, 1, 2]


def test_closing_drops_what_takes_too_long(kept):
    scenes, _ = kept
    keeper = Keeper(None)
    keeper.keep(0)
    keeper.keep(1)
    start = time.monotonic()
    keeper.close(0.05)
    assert time.monotonic() - start < 5.0
    assert scenes == []


def test_keeper_without_work_has_no_thread_to_end():
    keeper = Keeper(None)
    keeper.close()
    assert keeper._thread is None


def test_tiles_are_kept_after_the_scene_that_they_are_of(kept, monkeypatch):
    scenes, go_on = kept
    monkeypatch.setattr(keeper_module, "keep_tiles", lambda cache, scene, shown: scenes.append((scene, shown)))
    keeper = Keeper(None)
    keeper.keep(0)
    keeper.keep_tiles(0, "tiles")
    go_on.set()
    keeper.close(30.0)
    assert scenes == [0, (0, "tiles")]
