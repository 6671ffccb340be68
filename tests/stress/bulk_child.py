"""A process that builds a hierarchy over very many leaves in one Morton cell, and says what that took.

Run as `python bulk_child.py LEAVES`; writes a line of JSON: nodes, leaves, whether all of them are finite, seconds, and
bytes at the peak beyond what the model took.
"""

from __future__ import annotations

import json
import resource
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1]), str(HERE), str(HERE.parent / "reference")]


def main() -> None:
    """Build it."""
    import numpy as np
    from test_bulk_build import one_cell

    from hierarchy.build import build_hierarchy

    rng = np.random.default_rng(1)
    # Load what is compiled.
    build_hierarchy(one_cell(rng, 50))
    model = one_cell(rng, int(sys.argv[1]))
    before = _peak()
    start = time.perf_counter()
    hierarchy = build_hierarchy(model)
    took = time.perf_counter() - start
    finite = all(bool(np.isfinite(hierarchy.nodes[name]).all()) for name in hierarchy.nodes.dtype.names)
    said = {"nodes": hierarchy.node_count, "leaves": hierarchy.leaf_count, "finite": finite, "seconds": took}
    print(json.dumps({**said, "bytes": _peak() - before}))


def _peak() -> int:
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


if __name__ == "__main__":
    main()
