"""A child process that forks writers: for every line on its input a process that writes a file until it is killed.

Arguments: GOOD TARGET. Writes what the file GOOD holds to TARGET, over and over. Prints the number of each writer. It
imports little, so that forking is safe and fast.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from hierarchy.tensor_file import map_tensors, write_tensors


def main() -> None:
    tensors, metadata = map_tensors(Path(sys.argv[1]))
    rest = {name: text for name, text in metadata.items() if name not in ("blocks", "checksum")}
    for _ in sys.stdin:
        child = os.fork()
        if child == 0:
            while True:
                write_tensors(Path(sys.argv[2]), tensors, rest)
        print(child, flush=True)
        os.waitpid(child, 0)
        print("ended", flush=True)


if __name__ == "__main__":
    main()
