"""Pictures against golden ones: everything that the settings switch, on small built-in models.

The golden pictures were drawn by llvmpipe and are compared on it alone; elsewhere the frames are drawn all the same.
`pytest --update-goldens` draws them anew: look at them before they are committed.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import moderngl
import numpy as np
import pytest
from PIL import Image

from hierarchy.build import build_hierarchy
from hierarchy.geodesic_sphere import geodesic_sphere
from hierarchy.hierarchy import Hierarchy
from hierarchy.lod import Cut
from hierarchy.meteoroid import make_meteoroid
from hierarchy.model import Mesh
from hierarchy.normal_tiles import NormalTiles, bake_tiles
from hierarchy.view import look_at
from renderer.frame import Frame
from renderer.settings import MATERIALS, Settings

GOLDENS = Path(__file__).parent / "goldens"
SIZE = (256, 256)
# One llvmpipe draws the same bytes every time. Another version, or another processor's vector units, rounds otherwise:
# a grey level or two, and where an edge passes through a pixel's centre that pixel.
LEVELS = 2
SHARE_OF_OTHERS = 0.005
MEAN_LEVELS = 0.25

Scene = tuple[Hierarchy, NormalTiles]
Draw = Callable[..., tuple[Frame, Cut]]


@pytest.fixture(scope="module")
def rock() -> Scene:
    hierarchy = build_hierarchy(make_meteoroid(8_000))
    return hierarchy, bake_tiles(hierarchy, 16)


@pytest.fixture(scope="module")
def rock_of_surfels() -> Scene:
    hierarchy = build_hierarchy(make_meteoroid(8_000), points=True)
    return hierarchy, bake_tiles(hierarchy, 16)


@pytest.fixture(scope="module")
def open_rock() -> Scene:
    """The lower two thirds of the rock: one looks at its inside."""
    mesh = make_meteoroid(8_000)
    kept = mesh.positions[mesh.faces].mean(axis=1)[:, 1] < 0.3
    faces = np.ascontiguousarray(mesh.faces[kept])
    hierarchy = build_hierarchy(Mesh("open rock", mesh.origin, mesh.positions, faces, mesh.normals))
    return hierarchy, bake_tiles(hierarchy, 16)


@pytest.fixture(scope="module")
def painted_sphere() -> Scene:
    """A chequered sphere with a yellow cap."""
    directions, faces = geodesic_sphere(32)
    positions = directions.astype(np.float32)
    longitude = np.arctan2(directions[:, 0], directions[:, 2])
    colors = np.full((len(positions), 4), 255, np.uint8)
    chequered = np.sin(6.0 * longitude) * np.sin(8.0 * directions[:, 1]) > 0.0
    colors[:, :3] = np.where(chequered[:, None], [214, 82, 48], [40, 110, 170])
    colors[directions[:, 1] > 0.75, :3] = 240, 220, 120
    mesh = Mesh("painted sphere", np.zeros(3), positions, faces, positions, colors, closed=True)
    hierarchy = build_hierarchy(mesh)
    return hierarchy, bake_tiles(hierarchy, 16)


# Name of the golden, fixture of the scene, settings.
PICTURES: list[tuple[str, str, Settings]] = [
    *((material, "rock", Settings(material=material)) for material in MATERIALS),
    ("silhouette", "rock", Settings(silhouette_overlay=True)),
    ("outlines", "rock", Settings(splat_outlines=True)),
    ("lod_colors", "rock", Settings(lod_colors=True)),
    ("all_overlays", "rock", Settings(silhouette_overlay=True, splat_outlines=True, lod_colors=True)),
    ("ground", "rock", Settings(ground=True)),
    ("orthographic", "rock", Settings(ground=True)),
    ("no_normal_mapping", "rock", Settings(normal_mapping=False)),
    ("sprites", "rock", Settings(splat="sprite", splat_outlines=True)),
    ("unblended", "rock", Settings(blending=False)),
    ("surfels", "rock_of_surfels", Settings()),
    ("surfels_outlines", "rock_of_surfels", Settings(splat_outlines=True)),
    ("one_sided", "open_rock", Settings()),
    ("two_sided", "open_rock", Settings(two_sided=True, ground=True)),
    ("colors", "painted_sphere", Settings()),
    ("colors_pearl", "painted_sphere", Settings(material="pearl")),
    ("colors_off", "painted_sphere", Settings(use_colors=False, base_color=(0.55, 0.60, 0.45))),
]


@pytest.mark.parametrize(("name", "scene", "settings"), PICTURES, ids=[picture[0] for picture in PICTURES])
def test_picture(
    name: str,
    scene: str,
    settings: Settings,
    draw: Draw,
    ctx: moderngl.Context,
    request: pytest.FixtureRequest,
    tmp_path: Path,
) -> None:
    hierarchy, tiles = request.getfixturevalue(scene)
    scale = 1.2 if name == "orthographic" else None
    eye = (1.6, 1.3, 2.4)
    view = look_at(eye, (0, 0, 0), (0, 1, 0), 0.72, SIZE, bounds=hierarchy.bounds, parallel_scale=scale)
    frame, _ = draw(view, hierarchy, tiles, settings)
    golden = GOLDENS / f"{name}.png"
    if request.config.getoption("--update-goldens"):
        GOLDENS.mkdir(exist_ok=True)
        Image.fromarray(frame.color[..., :3]).save(golden, optimize=True)
        return
    assert 0.2 < frame.coverage.mean() < 0.9
    assert frame.color[..., :3].std() > 10.0
    if "llvmpipe" not in ctx.info["GL_RENDERER"]:
        pytest.skip(f"drawn, but not compared: the golden pictures are llvmpipe's, this is {ctx.info['GL_RENDERER']}")
    compare(frame.color[..., :3], read_png(golden), tmp_path / name)


def read_png(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        return np.asarray(image)


def compare(color: np.ndarray, golden: np.ndarray, output: Path) -> None:
    """Raise AssertionError where two pictures differ; write both and their difference beside `output` then."""
    assert color.shape == golden.shape
    difference = np.abs(color.astype(np.int16) - golden.astype(np.int16))
    others = float((difference.max(axis=-1) > LEVELS).mean())
    if others <= SHARE_OF_OTHERS and difference.mean() <= MEAN_LEVELS:
        return
    amplified = np.minimum(16 * difference, 255).astype(np.uint8)
    side_by_side = output.with_suffix(".png")
    Image.fromarray(np.concatenate([golden, color, amplified], axis=1)).save(side_by_side)
    pytest.fail(
        f"{others:.2%} of the pixels differ by more than {LEVELS} levels, {difference.mean():.2f} in the mean; "
        f"golden, drawn, and 16 times the difference: {side_by_side}"
    )


def test_every_golden_has_its_picture() -> None:
    assert {path.stem for path in GOLDENS.glob("*.png")} == {name for name, _, _ in PICTURES}


def test_a_difference_is_found_and_shown(tmp_path: Path) -> None:
    golden = read_png(GOLDENS / "clay.png")
    compare(golden, golden, tmp_path / "same")
    compare(golden + (golden % 8 == 3), golden, tmp_path / "rounded")
    assert not list(tmp_path.iterdir())
    moved = np.roll(golden, 1, axis=1)
    with pytest.raises(pytest.fail.Exception, match="of the pixels differ"):
        compare(moved, golden, tmp_path / "moved")
    assert read_png(tmp_path / "moved.png").shape == (256, 3 * 256, 3)
