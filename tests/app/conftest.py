"""Small models that are built in no time."""

from pathlib import Path

import numpy as np
import pytest


def make_torus(
    path: Path,
    *,
    rings: int = 48,
    sides: int = 24,
    bumps: float = 0.0,
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Path:
    """Write a closed torus around the z axis, outer radius 1.3, with bumps of a height, as a binary PLY."""
    u, v = np.meshgrid(np.arange(rings) * 2 * np.pi / rings, np.arange(sides) * 2 * np.pi / sides, indexing="ij")
    tube = 0.3 + bumps * np.sin(24.0 * u) * np.sin(10.0 * v)
    ring = 1.0 + tube * np.cos(v)
    vertices = np.stack([ring * np.cos(u), ring * np.sin(u), tube * np.sin(v)], axis=-1).reshape(-1, 3) + offset
    i, j = np.meshgrid(np.arange(rings), np.arange(sides), indexing="ij")
    a, b = i * sides + j, (i + 1) % rings * sides + j
    c, d = (i + 1) % rings * sides + (j + 1) % sides, i * sides + (j + 1) % sides
    corners = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    faces = np.empty(len(corners), [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, corners
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property double {axis}" for axis in "xyz"]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
    path.write_bytes("\n".join(header).encode() + vertices.astype("<f8").tobytes() + faces.tobytes())
    return path


@pytest.fixture(scope="session")
def write_torus():
    return make_torus


@pytest.fixture(scope="session")
def torus(tmp_path_factory):
    return make_torus(tmp_path_factory.mktemp("models") / "torus.ply")


@pytest.fixture(scope="session")
def far_torus(tmp_path_factory):
    """A torus where a national grid would put it, in metres."""
    return make_torus(tmp_path_factory.mktemp("models") / "far_torus.ply", offset=(4.0e6, 5.5e6, 100.0))
