"""How much memory this process has needed."""

from __future__ import annotations

import re
import sys
from contextlib import suppress
from pathlib import Path

STATUS = Path("/proc/self/status")


def peak_memory_mb() -> float | None:
    """Return the largest resident size so far in MB (1e6 bytes), None where the system does not tell."""
    if sys.platform == "win32":
        return None
    # On Linux getrusage also counts what the process that started this one had by then.
    with suppress(OSError):
        if peak := re.search(rb"^VmHWM:\s*(\d+) kB$", STATUS.read_bytes(), re.MULTILINE):
            return 1024 * int(peak[1]) / 1e6
    import resource

    largest = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    # Kilobytes, but bytes on macOS.
    return (largest if sys.platform == "darwin" else 1024 * largest) / 1e6
