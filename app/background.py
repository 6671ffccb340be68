"""Work on a thread of its own, watched and cancelled from the main thread."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from hierarchy.model import Cancelled, Progress

T = TypeVar("T")


class BackgroundTask(Generic[T]):
    """One piece of work that runs in the background.

    The work reports its progress by calling what it is given; that call raises `Cancelled` once the task has been
    cancelled. Everything else here is for the thread that made the task, which polls `finished` and takes `result`.

    work : called once, on the new thread, with its progress callback
    on_change : called on the new thread after every report and at the end, to wake whoever waits for events
    after : a task that has to end first. The parallel kernels may run on one thread at a time only, and a cancelled
        task stops at its next report, not at once.
    """

    def __init__(
        self,
        work: Callable[[Progress], T],
        on_change: Callable[[], None],
        after: BackgroundTask[T] | None = None,
    ) -> None:
        self._work = work
        self._on_change = on_change
        self._after = after
        self._cancelled = threading.Event()
        self._done = threading.Event()
        self._progress = ("Waiting", 0.0)
        self._result: T | None = None
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="surfelscope-work", daemon=True)
        self._thread.start()

    @property
    def progress(self) -> tuple[str, float]:
        """What is being done, and how far that is, from 0 to 1."""
        return self._progress

    @property
    def finished(self) -> bool:
        """The work has ended, one way or another."""
        return self._done.is_set()

    @property
    def cancelled(self) -> bool:
        """The work was asked to stop."""
        return self._cancelled.is_set()

    def cancel(self) -> None:
        """Ask the work to stop at its next report of progress."""
        self._cancelled.set()

    def wait(self, timeout: float | None = None) -> None:
        """Wait until the work has ended, or `timeout` seconds."""
        self._done.wait(timeout)

    def result(self) -> T:
        """Wait for the end and return what the work returned; raises what it raised, and Cancelled if it was."""
        self._done.wait()
        if self._cancelled.is_set():
            raise Cancelled
        if self._error is not None:
            raise self._error
        return self._result  # type: ignore[return-value]

    def _run(self) -> None:
        try:
            if self._after is not None:
                self._after.wait()
                # Let go of the other task's result.
                self._after = None
            self._report("Starting", 0.0)
            self._result = self._work(self._report)
        except BaseException as error:
            # lazrs panics with a BaseException; whatever it is, the main thread decides what to do about it.
            self._error = error
        finally:
            self._done.set()
            self._on_change()

    def _report(self, stage: str, fraction: float) -> None:
        if self._cancelled.is_set():
            raise Cancelled
        self._progress = (stage, min(max(fraction, 0.0), 1.0))
        self._on_change()
