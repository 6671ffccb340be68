"""The renderer's laws: what it draws depends on what it is given, and arrays mean what `Frame` says."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from contextlib import nullcontext

import moderngl
import numpy as np
import numpy.typing as npt
import pytest

from benchmarks.error import angle_degrees
from hierarchy.build import build_hierarchy
from hierarchy.drawn_rows import records_of
from hierarchy.hierarchy import SPLAT, Hierarchy
from hierarchy.leaves import Triangles
from hierarchy.lod import Cut, select_cut
from hierarchy.meteoroid import make_meteoroid
from hierarchy.model import PointCloud
from hierarchy.normal_tiles import NormalTiles, bake_tiles
from hierarchy.spans import STRIP, reached_spans
from hierarchy.view import View, look_at
from renderer import leaf_buffers
from renderer.allocation import GpuError, allocating
from renderer.cut_buffers import RECORDS_IN_ROW, CutBuffers
from renderer.frame import Frame
from renderer.leaf_buffers import Pages
from renderer.renderer import Renderer
from renderer.resolve_passes import CRACK_REACH
from renderer.settings import Settings
from renderer.tile_pages import OF_LAYER
from renderer.tile_places import LAYER_WIDTH

Draw = Callable[..., tuple[Frame, Cut]]
Scene = tuple[Hierarchy, NormalTiles]


def view_of(hierarchy: Hierarchy, size: tuple[int, int] = (64, 48), eye: npt.ArrayLike = (1, 2, 3)) -> View:
    return look_at(np.asarray(eye), (0, 0, 0), (0, 1, 0), 0.8, size, bounds=hierarchy.bounds)


def same(a: Frame, b: Frame) -> bool:
    return all(np.array_equal(getattr(a, each.name), getattr(b, each.name)) for each in dataclasses.fields(Frame))


@pytest.fixture(scope="module")
def discs() -> Hierarchy:
    """Three discs: one above, facing +z; one below to the right, facing right; one behind them. An asymmetric model."""
    positions = np.array([[0, 0.6, 0], [0.6, -0.6, 0.2], [-0.2, 0, -0.8]], np.float32)
    normals = np.array([[0, 0, 1], [0.6, 0, 0.8], [0, 0.28, 0.96]], np.float32)
    origin, radii = np.array([10.0, 20, 30]), np.full(3, 0.3, np.float32)
    return build_hierarchy(PointCloud("discs", origin, positions, normals, radii))


def all_of(hierarchy: Hierarchy) -> Cut:
    leaves = np.arange(hierarchy.node_count, len(hierarchy.splats), dtype=np.uint32)
    return Cut(leaves, np.empty((0, 3), np.uint32), 0, 0, hierarchy.node_count)


EMPTY = Cut(np.empty(0, np.uint32), np.empty((0, 3), np.uint32), 0, 0, 0)


def test_before_there_is_a_model_nothing_is_drawn(ctx: moderngl.Context, renderer: Renderer, discs: Hierarchy) -> None:
    with pytest.raises(RuntimeError, match="set_hierarchy"):
        renderer.draw(EMPTY, view_of(discs), Settings(), ctx.simple_framebuffer((64, 48)))
    with pytest.raises(RuntimeError, match="draw comes before"):
        renderer.read_arrays()
    assert renderer.depth_at(3, 4) == float("inf")


def test_an_empty_cut_is_the_background(draw: Draw, discs: Hierarchy) -> None:
    frame, _ = draw(view_of(discs), discs, cut=EMPTY)
    assert not frame.coverage.any()
    assert not frame.normal.any()
    assert np.isinf(frame.depth).all()
    assert (frame.color[..., 3] == 255).all()
    # A gradient from Settings.background_top down to background_bottom.
    rows = frame.color[..., :3].astype(np.float64).mean(axis=1)
    assert (np.diff(rows, axis=0) < 0.5).all()
    top, bottom = (255.0 * np.asarray(c) for c in (Settings().background_top, Settings().background_bottom))
    assert np.abs(rows[0] - top).max() < 2.0
    assert np.abs(rows[-1] - bottom).max() < 2.0


def test_row_0_is_the_top_and_axes_are_the_files(draw: Draw, discs: Hierarchy) -> None:
    frame, _ = draw(view_of(discs, (60, 60), (0, 0, 4)), discs, cut=all_of(discs))
    # Eye space: the first disc is above the middle, the second at the lower right, the third left of the middle.
    middle = {"above": (18, 30), "right": (43, 42), "left": (30, 26)}
    normals = {name: frame.normal[at] for name, at in middle.items()}
    assert np.allclose(normals["above"], [0, 0, 1], atol=2e-3)
    assert np.allclose(normals["right"], [0.6, 0, 0.8], atol=2e-3)
    assert np.allclose(normals["left"], [0, 0.28, 0.96], atol=2e-3)
    assert frame.depth[middle["above"]] == pytest.approx(4.0, rel=1e-5)
    assert not frame.coverage[:, :8].any()
    # Seen from elsewhere, rolled: the same normals, in the file's axes.
    rolled = look_at((1.5, -1, 3.5), (0, 0, 0), (1, 0.2, 0), 0.9, (60, 60), bounds=discs.bounds)
    other, _ = draw(rolled, discs, cut=all_of(discs))
    seen = other.normal[other.coverage > 0]
    for normal in ([0, 0, 1], [0.6, 0, 0.8], [0, 0.28, 0.96]):
        assert (angle_degrees(seen, np.asarray(normal)) < 0.2).sum() > 30


def test_arrays_are_what_a_frame_says(draw: Draw, meteoroid: Scene) -> None:
    frame, _ = draw(view_of(meteoroid[0]), *meteoroid)
    shapes = {"normal": (48, 64, 3), "depth": (48, 64), "coverage": (48, 64), "color": (48, 64, 4)}
    for name, shape in shapes.items():
        array = getattr(frame, name)
        assert array.shape == shape
        assert array.dtype == (np.uint8 if name == "color" else np.float32)
    drawn = frame.coverage > 0
    assert 0.2 < drawn.mean() < 0.9
    assert set(np.unique(frame.coverage)) == {0.0, 1.0}
    assert np.allclose(np.linalg.norm(frame.normal[drawn], axis=-1), 1.0, atol=1e-5)
    assert not frame.normal[~drawn].any()
    assert np.isinf(frame.depth[~drawn]).all()
    view = view_of(meteoroid[0])
    assert view.near < frame.depth[drawn].min() < frame.depth[drawn].max() < view.far
    # A closed surface is seen from its outside; normals lean away from the eye at the outline only.
    assert ((frame.normal[drawn] @ view.eye_from_model[2, :3]) > -0.3).all()
    assert frame.color[~drawn, :3].astype(int).std(axis=0).max() < 40


def test_depth_at_is_the_depth_but_for_epsilon(draw: Draw, renderer: Renderer, meteoroid: Scene) -> None:
    hierarchy, tiles = meteoroid
    frame, cut = draw(view_of(hierarchy), hierarchy, tiles)
    thickest = float((hierarchy.splats["thickness"][cut.splats] + hierarchy.splats["radius"][cut.splats]).max())
    for row in range(1, 48, 6):
        for column in range(2, 64, 6):
            depth = renderer.depth_at(column, row)
            if frame.coverage[row, column] > 0.0:
                assert frame.depth[row, column] * (1.0 - 1e-3) < depth < frame.depth[row, column] + 2.0 * thickest
            else:
                assert depth == float("inf")


def test_a_splat_that_is_pushed_beyond_the_far_plane_is_drawn(draw: Draw, renderer: Renderer, meteoroid: Scene) -> None:
    hierarchy, tiles = meteoroid
    root = Cut(np.zeros(1, np.uint32), np.empty((0, 3), np.uint32), 0, 0, 1)
    view = view_of(hierarchy)
    frame, _ = draw(view, hierarchy, tiles, cut=root)
    drawn = np.argwhere(frame.coverage > 0.0)
    assert len(drawn) > 100
    push = 2.0 * hierarchy.splats["thickness"][0]
    assert frame.depth[frame.coverage > 0.0].min() + push > view.far
    assert all(renderer.depth_at(column, row) <= view.far for row, column in drawn[::20])


def test_the_same_frame_twice_gives_the_same_bytes(draw: Draw, meteoroid: Scene) -> None:
    first, cut = draw(view_of(meteoroid[0]), *meteoroid)
    draw(view_of(meteoroid[0], eye=(3, 0, 1)), *meteoroid)
    again, _ = draw(view_of(meteoroid[0]), *meteoroid, cut=cut)
    assert same(first, again)


@pytest.mark.parametrize("splat", ["quad", "sprite"])
@pytest.mark.parametrize("blending", [True, False])
@pytest.mark.parametrize("points", [True, False])
def test_nothing_is_left_of_the_frames_before(
    draw: Draw, renderer: Renderer, points: bool, blending: bool, splat: str
) -> None:
    hierarchy = build_hierarchy(make_meteoroid(2_000), points=points)
    settings = Settings(splat=splat, blending=blending, splat_outlines=True)
    eyes = [(1, 2, 3), (0.4, 0.2, 1.5), (8, 1, 1), (-1.5, 0, 1)]
    views = [view_of(hierarchy, (110, 90), eye) for eye in eyes]
    pictures = [draw(view, hierarchy, settings=settings)[0] for view in views]
    assert renderer._targets is not None
    for view, after_others in zip(views, pictures, strict=True):
        renderer._release_targets()
        frame, cut = draw(view, hierarchy, settings=settings)
        assert same(frame, after_others)
        # Sums are zero outside of the spans that they are erased in before the next frame.
        spans = reached_spans(records_of(hierarchy, cut.splats), hierarchy.leaves, cut.indices, view, CRACK_REACH)
        rows, columns = np.mgrid[:90, :110]
        inside = (columns >= spans[rows // STRIP, 0]) & (columns < spans[rows // STRIP, 1])
        for texture in renderer._targets.sums.values():
            sums = np.frombuffer(texture.read(), np.float32).reshape(90, 110, -1)
            assert sums[inside].any()
            assert not sums[~inside].any()


def test_models_and_tiles_can_be_exchanged(draw: Draw, renderer: Renderer, meteoroid: Scene, discs: Hierarchy) -> None:
    hierarchy, tiles = meteoroid
    view, other_view = view_of(hierarchy), view_of(discs)
    with_tiles, _ = draw(view, hierarchy, tiles)
    other, _ = draw(other_view, discs)
    assert not same(other, with_tiles)
    # The tiles went with the model that they belong to.
    without, _ = draw(view, hierarchy)
    plain, _ = draw(view, hierarchy, tiles, Settings(normal_mapping=False))
    assert same(without, plain)
    assert not np.array_equal(without.normal, with_tiles.normal)
    assert same(draw(view, hierarchy, tiles)[0], with_tiles)
    assert same(draw(other_view, discs)[0], other)
    # What was drawn before the exchange is nobody's frame any more.
    renderer.set_tiles(None)
    with pytest.raises(RuntimeError, match="draw comes before"):
        renderer.read_arrays()
    assert renderer.depth_at(32, 24) == float("inf")


def test_more_texels_come_nearer_to_the_leaves(draw: Draw, meteoroid: Scene) -> None:
    hierarchy = meteoroid[0]
    view = view_of(hierarchy)
    exact, _ = draw(view, hierarchy, r_sil=0.0, r_inner=0.0)
    errors = []
    for texels in (2, 4, 8, 16, 32):
        frame, _ = draw(view, hierarchy, bake_tiles(hierarchy, texels), r_sil=2.0, r_inner=8.0)
        both = (frame.coverage > 0) & (exact.coverage > 0)
        errors.append(angle_degrees(frame.normal[both], exact.normal[both]).mean())
    # From 16 texels on they are finer than the pixels.
    assert errors[0] > 1.2 * errors[1] > 1.2 * errors[2] > 1.1 * errors[3]
    assert errors[4] < 1.05 * errors[3]


def layers_of(renderer: Renderer) -> int:
    assert renderer._tiles is not None
    return renderer._tiles.normals.layers


def test_tiles_in_many_layers_are_found(renderer: Renderer, draw: Draw, meteoroid: Scene) -> None:
    hierarchy, _ = meteoroid
    view = view_of(hierarchy)
    tiles = bake_tiles(hierarchy, LAYER_WIDTH)
    expected, cut = draw(view, hierarchy, tiles)
    layers = layers_of(renderer)
    assert layers > 4
    # Those that are drawn alone, elsewhere and in fewer layers.
    some = bake_tiles(hierarchy, LAYER_WIDTH, nodes=cut.splats[cut.splats < hierarchy.node_count])
    frame, _ = draw(view, hierarchy, some)
    assert layers_of(renderer) < layers
    assert np.abs(frame.color.astype(int) - expected.color).max() <= 1
    np.testing.assert_allclose(frame.normal, expected.normal, atol=0.01)


def test_tiles_wider_than_a_layer_are_an_error(renderer: Renderer, meteoroid: Scene) -> None:
    renderer.set_hierarchy(meteoroid[0])
    with pytest.raises(ValueError, match="at most 32 texels"):
        renderer.make_pages(LAYER_WIDTH + 1)


def test_what_does_not_fit_leaves_the_old_one_in_place(
    ctx: moderngl.Context, draw: Draw, renderer: Renderer, meteoroid: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    hierarchy, tiles = meteoroid
    before, cut = draw(view_of(hierarchy), hierarchy, tiles)
    held = renderer.gpu_bytes
    with monkeypatch.context() as patch:
        patch.setattr("renderer.allocation._read_errors", lambda ctx: ["GL_OUT_OF_MEMORY"])
        with pytest.raises(GpuError, match="does not hold the model"):
            renderer.set_hierarchy(hierarchy)
        with pytest.raises(GpuError, match="smaller w_s"):
            renderer.set_tiles(tiles)
    assert renderer.gpu_bytes == held
    assert same(draw(view_of(hierarchy), hierarchy, tiles, cut=cut)[0], before)


def test_large_models_are_brought_as_far_as_they_are_drawn(
    ctx: moderngl.Context, draw: Draw, monkeypatch: pytest.MonkeyPatch
) -> None:
    hierarchy = build_hierarchy(make_meteoroid(40_000))
    views = [view_of(hierarchy, (200, 150), eye) for eye in ((1, 2, 3), (0.3, 0.2, 1.2), (-3, 0, 0))]
    radii = {"r_sil": 1.0, "r_inner": 4.0}
    whole = [draw(view, hierarchy, **radii)[0] for view in views]
    brought: list[tuple[Pages, int]] = []
    bring = Pages._bring

    def noted(pages: Pages, wanted: np.ndarray) -> None:
        brought.extend((pages, page) for page in np.flatnonzero(wanted).tolist())
        bring(pages, wanted)

    monkeypatch.setattr(leaf_buffers, "WHOLE", 0)
    monkeypatch.setattr(leaf_buffers, "VERTICES", 64)
    monkeypatch.setattr(Pages, "_bring", noted)
    # The same hierarchy anew.
    hierarchy = dataclasses.replace(hierarchy)
    assert isinstance(hierarchy.leaves, Triangles)
    pages = -(-len(hierarchy.leaves.positions) // 64)
    for view, expected in zip(views, whole, strict=True):
        frame, cut = draw(view, hierarchy, **radii)
        assert cut.triangle_count > 0
        assert same(frame, expected)
        assert set(np.unique(cut.indices // 64)) <= {page for _, page in brought}
        # None of them twice; of positions and normals, and of colours where there are any.
        assert len(set(brought)) == len(brought) <= 3 * pages
    before = len(brought)
    assert before > 0
    draw(views[0], hierarchy, **radii)
    assert len(brought) == before


def test_pages_are_brought_once_and_side_by_side() -> None:
    brought: list[tuple[int, int]] = []
    pages = Pages(95, 10, lambda first, end: brought.append((first, end)))
    pages.bring(np.array([[5, 94], [12, 13]], np.uint32))
    pages.bring(np.array([25, 12, 90], np.uint32))
    pages.bring(np.empty(0, np.uint32))
    pages.bring_all()
    pages.bring(np.arange(95, dtype=np.uint32))
    assert brought == [(0, 2), (9, 10), (2, 3), (3, 9)]


def test_page_that_could_not_be_brought_is_tried_again() -> None:
    brought: list[int] = []

    def write(first: int, end: int) -> None:
        brought.append(first)
        if len(brought) == 1:
            raise MemoryError

    pages = Pages(30, 10, write)
    with pytest.raises(MemoryError):
        pages.bring(np.array([11]))
    pages.bring(np.array([12]))
    pages.bring(np.array([13]))
    assert brought == [1, 1]


def test_more_splats_than_a_texture_has_rows_for_are_an_error(ctx: moderngl.Context, renderer: Renderer) -> None:
    buffers = CutBuffers(ctx, dataclasses.replace(renderer.limits, texture_size=2))
    for count, fits in ((2 * RECORDS_IN_ROW, True), (2 * RECORDS_IN_ROW + 1, False), (5, True)):
        cut = Cut(np.arange(count, dtype=np.uint32), np.empty((0, 3), np.uint32), 0, 0, 0)
        with nullcontext() if fits else pytest.raises(GpuError, match="2,049 splats in one frame are too many: 2,048"):
            buffers.upload(cut, np.zeros(count, SPLAT), None, None)
    buffers.release()


def test_memory_that_is_not_there_is_an_error(ctx: moderngl.Context) -> None:
    with allocating(ctx, "nothing"):
        pass
    # 64 GB: 2,048 layers are the least that every OpenGL has, and 256 at least in 3.3.
    layers = ctx.info["GL_MAX_ARRAY_TEXTURE_LAYERS"]
    message = ""
    try:
        with allocating(ctx, "the model") as held:
            held.add(ctx.texture_array((2048, 2048, layers), 4, dtype="f4"))
        held.release()
    except GpuError as error:
        message = str(error)
    if not message:
        pytest.skip(f"{ctx.info['GL_RENDERER']} has so much memory")
    assert "does not hold the model" in message
    with allocating(ctx, "nothing"):
        pass


def test_what_it_costs(ctx: moderngl.Context, draw: Draw, renderer: Renderer, meteoroid: Scene) -> None:
    hierarchy, tiles = meteoroid
    assert renderer.timings == {}
    draw(view_of(hierarchy), hierarchy)
    assert set(renderer.timings) == {"visibility", "attributes", "resolve"}
    assert all(0.0 < milliseconds < 10_000.0 for milliseconds in renderer.timings.values())
    without = renderer.gpu_bytes
    assert without > hierarchy.leaves.positions.nbytes + hierarchy.leaves.normals.nbytes
    renderer.set_tiles(tiles)
    nbytes = layers_of(renderer) * OF_LAYER * (2 if renderer.limits.fine_filter else 4)
    assert nbytes > tiles.nbytes
    assert renderer.gpu_bytes == without + nbytes
    cut = select_cut(hierarchy, view_of(hierarchy, (640, 480)), 2.0, 16.0)
    framebuffer = ctx.simple_framebuffer((640, 480))
    renderer.draw(cut, view_of(hierarchy, (640, 480)), Settings(), framebuffer)
    assert renderer.gpu_bytes > without + nbytes + 16 * (640 * 480 - 64 * 48)


def test_after_release_there_is_nothing(ctx: moderngl.Context, meteoroid: Scene) -> None:
    renderer = Renderer(ctx)
    renderer.set_hierarchy(meteoroid[0])
    view, framebuffer = view_of(meteoroid[0]), ctx.simple_framebuffer((64, 48))
    renderer.draw(select_cut(meteoroid[0], view, 2.0, 16.0), view, Settings(), framebuffer)
    renderer.release()
    with pytest.raises(RuntimeError, match="set_hierarchy"):
        renderer.draw(EMPTY, view, Settings(), framebuffer)
    with pytest.raises(RuntimeError, match="draw comes before"):
        renderer.read_arrays()
