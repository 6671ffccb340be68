"""How a frame's time grows with the model: the same surface, view and radii in 10 thousand to 17 million triangles.

Every size is measured in a process of its own, so that its peak of memory is its own and all of it is given back.
An entry of a run file's "scaling":

    {"size", "triangles", "vertices", "nodes", "resolution", "r_sil", "r_inner", "w_s", "rounds", "make_s", "build_s",
     "hierarchy_bytes", "build_peak_mb",
     "cost": {"select_ms", "visibility_ms", "attributes_ms", "resolve_ms", "frame_ms", "triangles_ms", "yardstick_ms",
              "frame_over_triangles", "frame_over_yardstick", "splats", "triangles", "silhouette", "visited_nodes",
              "bake_s", "tile_bytes", "gpu_bytes", "triangles_gpu_bytes", "peak_memory_mb"},
     "error": as of a record, against the mesh of that size,
     "moving": {"r_inner", "cost": {"frame_ms", "frame_over_triangles"}, "error"},
     "coarser": the same}

Tiles are those of the view's cut at r_inner. "moving" is the same without blending, as the window draws a mesh that
moves; "coarser" is blended, at a larger r_inner. Runs before these were measured lack them, or moving's r_inner.
"""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
import threading
from collections.abc import Sequence
from multiprocessing.connection import Connection

from benchmarks.run_file import Json
from benchmarks.surface import SIZES


class ScalingError(Exception):
    """A size could not be measured. The message is one line."""


def missing_sizes(scaling: Sequence[Json], sizes: Sequence[int] = SIZES) -> list[int]:
    """Return the sizes that have no entry yet, in order."""
    measured = {entry["size"] for entry in scaling}
    return [size for size in sizes if size not in measured]


def measure_apart(size: int, resolution: tuple[int, int], rounds: int, samples: int) -> Json:
    """Measure one size in a process of its own, as `surface_cost.measure_size` does.

    Raises ScalingError where that process fails or is ended, by the system for want of memory for example.
    """
    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_work, args=(sender, size, resolution, rounds, samples), daemon=True)
    process.start()
    # Only the other process may hold this end: its death then ends the wait.
    sender.close()
    try:
        kind, answer = receiver.recv()
    except EOFError:
        process.join()
        raise ScalingError(f"surface of {size} triangles: its process ended (status {process.exitcode})") from None
    finally:
        receiver.close()
    process.join()
    if kind == "error":
        raise ScalingError(f"surface of {size} triangles: {answer}")
    entry: Json = answer
    return entry


def _work(sender: Connection, size: int, resolution: tuple[int, int], rounds: int, samples: int) -> None:
    """Run in the other process: send ("entry", entry) or ("error", one line)."""
    # An interrupt from the keyboard reaches both processes; this one has nothing to say.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    _end_with_parent()
    try:
        from benchmarks.surface_cost import measure_size

        answer: tuple[str, object] = ("entry", measure_size(size, resolution, rounds, samples))
    except MemoryError:
        answer = ("error", "there is not enough memory for it")
    except Exception as error:
        answer = ("error", " ".join(str(error).split()) or type(error).__name__)
    sender.send(answer)


def _end_with_parent() -> None:
    """End this process when the one that started it is gone, however it went."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def overtaking(scaling: Sequence[Json]) -> float | None:
    """Return from how many triangles up the splats are faster than the triangles, None where no size says so.

    Between two sizes the ratio is interpolated as a power of the number of triangles.
    """
    points = sorted((entry["triangles"], entry["cost"]["frame_over_triangles"]) for entry in scaling)
    slower = [index for index, (_, ratio) in enumerate(points) if ratio >= 1.0]
    if not points or not slower or slower[-1] == len(points) - 1:
        return None
    (low, high_ratio), (high, low_ratio) = points[slower[-1] : slower[-1] + 2]
    share = math.log(high_ratio) / math.log(high_ratio / low_ratio)
    return float(low * (high / low) ** share)


def growth(scaling: Sequence[Json], start: int = 270_000) -> float | None:
    """Return the frame time at the largest size beyond `start` over that at `start`; None where there is none.

    The latter is that of a surface of `start` triangles which the same process drew in turn.
    """
    grown = {entry["size"]: entry["cost"]["frame_over_yardstick"] for entry in scaling if entry["size"] > start}
    return float(grown[max(grown)]) if grown else None
