"""How nodes in breadth-first order are dealt to threads: the first ones are the largest."""

from __future__ import annotations

import numba as nb
import numpy as np

# Nodes that are dealt at once; the first ones are dealt one by one.
BLOCK, ONE_BY_ONE = 256, 1024
# Which of 16 hands is dealt to next: neighbours are as many threads apart as can be, however many there are.
DEALT = np.array([0, 8, 4, 12, 2, 10, 6, 14, 1, 9, 5, 13, 3, 11, 7, 15])


@nb.njit(cache=True, nogil=True, inline="always")
def block_count(nodes):  # type: ignore[no-untyped-def]
    """Return how many blocks there are of some nodes."""
    return ONE_BY_ONE - (-max(nodes - ONE_BY_ONE, 0) // BLOCK)


@nb.njit(cache=True, nogil=True, inline="always")
def nodes_of(block, nodes):  # type: ignore[no-untyped-def]
    """Return the nodes of a block, as the ends of a range; hand k holds the blocks DEALT[k], 16 more, and so on."""
    if block < ONE_BY_ONE:
        return min(block, nodes), min(block + 1, nodes)
    first = ONE_BY_ONE + (block - ONE_BY_ONE) * BLOCK
    return first, min(first + BLOCK, nodes)


@nb.njit(cache=True, nogil=True)
def most_leaves(hand, begin, end):  # type: ignore[no-untyped-def]
    """Return how many leaves the largest node of a hand has."""
    most = 0
    for block in range(DEALT[hand], block_count(len(begin)), len(DEALT)):
        for node in range(*nodes_of(block, len(begin))):
            most = max(most, end[node] - begin[node])
    return most
