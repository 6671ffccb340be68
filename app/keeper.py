"""Puts scenes and tiles into the cache in the background, one at a time, while the window goes on."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

from app.cache import Cache
from app.scene import Scene, keep_scene
from app.tile_cache import keep_tiles
from hierarchy.model import Cancelled

if TYPE_CHECKING:
    from hierarchy.tile_shelf import ShownTiles

# Seconds that a window which is being closed waits for what is being written.
PATIENCE = 2.0


class Keeper:
    """Keeps what it is given, on a thread of its own. Nothing here uses parallel kernels, nor raises."""

    def __init__(self, cache: Cache) -> None:
        self._cache = cache
        # None ends the thread.
        self._work: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None
        self._stopped = threading.Event()

    def keep(self, scene: Scene) -> None:
        """Put a scene into the cache."""
        self._put(lambda: keep_scene(scene, self._cache, self._go_on))

    def keep_tiles(self, scene: Scene, shown: ShownTiles) -> None:
        """Put the tiles of a scene's picture into the cache, where the scene is by then."""
        self._put(lambda: keep_tiles(self._cache, scene, shown))

    def _put(self, work: Callable[[], None]) -> None:
        self._work.put(work)
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="surfelscope-keep", daemon=True)
            self._thread.start()

    def close(self, patience: float = PATIENCE) -> None:
        """Let what is being written be finished if that takes no longer than `patience` seconds, else drop it."""
        if self._thread is not None:
            self._work.put(None)
            self._thread.join(patience)
            self._stopped.set()
            self._thread.join()

    def _run(self) -> None:
        while (work := self._work.get()) is not None:
            try:
                work()
            except Cancelled:
                return

    def _go_on(self, _fraction: float) -> None:
        if self._stopped.is_set():
            raise Cancelled
