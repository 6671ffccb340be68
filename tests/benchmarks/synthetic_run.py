"""A run as the benchmarks would write it, its figures from simple laws instead of measurements."""

from __future__ import annotations

import numpy as np

from benchmarks.run_file import Json, Record, Run, Setting
from benchmarks.sweep import settings_of

TRIANGLES = {"igea.ply": 268_686, "bunny.obj": 69_451}
VIEWS = ("front", "orbit 4", "close-up")
TRIANGLES_MS = 64.0
METHOD_ERROR = {"no tiles": 6.0, "one radius": 7.0, "point sprites": 1.2, "printed cone test": 0.9}
METHOD_TIME = {"point sprites": 1.4, "printed cone test": 5.0}


def synthetic_run(seed: int = 3) -> Run:
    """Return a run of two models on three views, with the growing surface, the paper's table and bounds."""
    random = np.random.default_rng(seed)
    run = Run(
        environment={
            "commit": "0123456789ab", "dirty": False, "code": "feedfacefeedface", "date": "2026-11-22T12:00:00+00:00",
            "cpu": "A processor", "cores": 2, "memory_mb": 24000, "os": "Debian", "python": "3.11.7",
            "numpy": "2.3.0", "numba": "0.62.0", "moderngl": "5.13.0", "gl_renderer": "llvmpipe (256 bits)",
            "gl_version": "4.5",
        },
        settings={"resolution": [1024, 1024], "rounds": 9, "samples": 4, "view_angle": 45.0},
    )  # fmt: skip
    for model, triangles in TRIANGLES.items():
        run.models[model] = {"triangles": triangles, "vertices": triangles // 2, "closed": model == "igea.ply",
                             "load_s": 0.6, "build_s": 1.1, "nodes": triangles // 2, "hierarchy_bytes": 80 * triangles,
                             "bake_s": {"16": 2.0}, "tile_bytes": {"16": 256 * triangles},
                             "content": "c0ffee"}  # fmt: skip
        for setting in settings_of(model, VIEWS, VIEWS, closed=True, quick=False, everywhere=True):
            run.records.append(synthetic_record(setting, triangles, random))
    run.scaling = [synthetic_size(size) for size in (10_000, 100_000, 270_000, 1_000_000, 17_000_000)]
    run.paper = [
        {"model": "igea.ply", "view": "front", "w_s": w_s, "tiles": tiles, "r_sil": 2.0, "r_inner": float(w_s),
         "map": [1400, 1400], "texels": 1_960_000, "surfels": 9000, "frame_ms": {"median": 55.0, "min": 52.0,
         "spread": 3.0}, "fps": 18.2, "paper": {"texels": 16.2e6, "surfels": 49_000, "fps": 85.0}}
        for w_s, tiles in ((2, False), (2, True), (16, True))
    ]  # fmt: skip
    return run


def synthetic_record(setting: Setting, triangles: int, random: np.random.Generator) -> Record:
    """Return a record after power laws: error rises with r_inner and falls with w_s, primitives fall with radii."""
    s = setting
    noise = random.uniform(0.97, 1.03)
    if s.r_inner > 0.0:
        of_sil, inside = 12_000.0 / s.r_sil, 400_000.0 / s.r_inner**2
        splats, leaves = 0.7 * of_sil + inside, 0.3 * of_sil
        error = METHOD_ERROR.get(s.method, 1.0) * (s.r_inner / 16.0) ** 0.6 * (0.43 if s.w_s else 1.0)
        error *= (16.0 / s.w_s) ** 0.3 * (s.r_sil / 2.0) ** 0.1 if s.w_s else 0.08 * s.r_sil
        displacement = 0.12 + 0.06 * s.r_sil
        ratio = METHOD_TIME.get(s.method, 1.0) * (0.5 + (splats + leaves) / 30_000.0)
    else:
        mesh = s.method.startswith("triangles")
        splats, leaves = (0.0, float(triangles)) if mesh else (triangles / 3.0, 0.0)
        error, displacement, ratio = (0.08, 0.14, 1.0) if mesh else (0.9, 0.3, 2.8)
    times = {name: {"median": ratio * share * TRIANGLES_MS * noise, "min": ratio * share * 60.0, "spread": 3.0}
             for name, share in (("frame_ms", 1.0), ("select_ms", 0.04), ("visibility_ms", 0.16),
                                 ("attributes_ms", 0.5), ("resolve_ms", 0.3))}  # fmt: skip
    cost: Json = times | {
        "triangles_ms": {"median": TRIANGLES_MS * noise, "min": 60.0, "spread": 3.0},
        "frame_over_triangles": ratio * random.uniform(0.99, 1.01),
        "splats": round(splats), "triangles": round(leaves), "silhouette": round(0.6 * splats),
        "pixels_blended": 2_000_000,
        "gpu_bytes": 30_000_000, "tile_bytes": triangles // 2 * s.w_s**2 * 2, "cut_tile_bytes": 10_000 * s.w_s**2,
        "peak_memory_mb": 500.0,
    }  # fmt: skip
    return Record(setting, cost, synthetic_error(error * random.uniform(0.99, 1.01), displacement))


def synthetic_error(degrees: float, displacement: float) -> Json:
    """Return what measures of a picture would be."""
    normal = {"count": 400_000, "mean": degrees, "median": 0.5 * degrees, "p95": 3.2 * degrees, "p99": 7.0 * degrees,
              "max": 70.0}  # fmt: skip
    return {
        "normal_degrees": normal, "smooth_normal_degrees": normal, "depth_relative": {**normal, "mean": 5e-4},
        "silhouette": {"mean": displacement, "p95": 3.0 * displacement, "hausdorff": 9.0 * displacement},
        "iou": 0.998, "outline_length": 2100.0, "growth": 0.1, "growth_drawn": 0.1, "mismatch": 0.3, "holes": 0,
        "holes_with_border": 12, "spill": 20, "psnr": 38.0, "ssim": 0.98, "flip": 0.03,
    }  # fmt: skip


def synthetic_size(size: int) -> Json:
    """Return an entry of the growing surface: triangles cost in proportion, splats hardly grow."""
    triangles_ms, frame_ms = 20.0 + size * 1.5e-4, 55.0 * (size / 270_000) ** 0.02
    times = {"median": frame_ms, "min": 0.9 * frame_ms, "spread": 0.1 * frame_ms}
    return {
        "size": size, "triangles": size, "vertices": size // 2, "nodes": size // 2, "resolution": [1024, 1024],
        "r_sil": 1.5, "r_inner": 24.0, "w_s": 16, "rounds": 6, "make_s": 0.9e-6 * size, "build_s": 6e-6 * size,
        "hierarchy_bytes": 83 * size, "build_peak_mb": 150 + 2e-4 * size,
        "cost": {
            "frame_ms": times, "select_ms": {**times, "median": 2.0}, "visibility_ms": times, "attributes_ms": times,
            "resolve_ms": times, "triangles_ms": {**times, "median": triangles_ms},
            "yardstick_ms": {**times, "median": 55.0}, "frame_over_triangles": frame_ms / triangles_ms,
            "frame_over_yardstick": frame_ms / 55.0, "splats": 6400, "triangles": 600, "silhouette": 3400,
            "visited_nodes": 15_000, "bake_s": 0.2, "tile_bytes": 3_300_000, "gpu_bytes": 9 * size,
            "triangles_gpu_bytes": 24 * size, "peak_memory_mb": 200 + 3e-4 * size,
        },
        "error": synthetic_error(0.66, 0.23),
    }  # fmt: skip
