"""Ctrl-C ends the program at once, quietly, whatever it is doing."""

from __future__ import annotations

import functools
import os
import signal
import sys
import threading

EXIT_INTERRUPTED = 130


@functools.cache
def end_on_interrupt() -> None:
    """Make an interrupt end the process with EXIT_INTERRUPTED; called on the main thread.

    Python itself looks at signals between two instructions of the main thread, which a parallel kernel can keep waiting
    for seconds. The system's handler writes to a pipe at once, and a thread of its own reads there.
    """
    # Not KeyboardInterrupt: numba turns it into other errors where it strikes while a kernel is being loaded.
    signal.signal(signal.SIGINT, lambda _signal, _frame: _end_at_once())
    if sys.platform == "win32":
        # There it would have to be a socket.
        return
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    threading.Thread(target=_wait, args=(reader,), name="surfelscope-interrupt", daemon=True).start()


def _wait(reader: int) -> None:
    while number := os.read(reader, 1):
        if number[0] == signal.SIGINT:
            _end_at_once()


def _end_at_once() -> None:
    try:
        # Only where something may have been written.
        writing = sys.modules.get("hierarchy.atomic_file")
        if writing is not None and hasattr(writing, "remove_unfinished"):
            writing.remove_unfinished()
    finally:
        os._exit(EXIT_INTERRUPTED)
