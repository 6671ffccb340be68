"""How much a file may unpack to: a bomb promises far more than it holds."""

from __future__ import annotations

from hierarchy.part import UnreadableFile

# Scanners' files take 2 bytes a point at the very least, and mostly 5 to 20; what is computed, such as a raster, may
# take less. A small file gets as many points and faces as load in a few seconds, a larger one eight a byte more.
MOST_OF_SMALL = 1_000_000
SMALL = 1_000_000
MOST_PER_BYTE = 8


def most_elements(size: int) -> int:
    """Return how many points or faces a file of `size` bytes may hold."""
    return MOST_OF_SMALL + MOST_PER_BYTE * max(size - SMALL, 0)


def check_unpacked(count: int, size: int) -> None:
    """Raise UnreadableFile where a file of `size` bytes claims more points or faces than it may hold."""
    if count > most_elements(size):
        raise UnreadableFile(f"it unpacks to {count:,} points or faces, too many for {size:,} bytes")
