"""The triangle baseline draws what the reference rays see, so that its time buys the right picture."""

from __future__ import annotations

import math
from collections.abc import Iterator

import moderngl
import numpy as np
import pytest

from benchmarks.error import measure
from benchmarks.reference import cast
from benchmarks.triangles import TriangleBaseline
from hierarchy.model import Mesh
from hierarchy.view import look_at

pytest.importorskip("embreex", reason="embreex casts the reference rays")

VIEW = look_at((2.2, 1.1, 2.0), (0.1, 0, 0), (0, 1, 0), math.radians(45), (160, 120), bounds=((0, 0, 0), 1.5))


def torus(around: int = 96, across: int = 48) -> Mesh:
    """Return a torus of radii 1 and 0.4 with exact normals: closed, smooth and with parts hidden by others."""
    u = np.arange(around) * (2.0 * np.pi / around)
    v = np.arange(across) * (2.0 * np.pi / across)
    u, v = np.meshgrid(u, v, indexing="ij")
    normals = np.stack([np.cos(v) * np.cos(u), np.sin(v), np.cos(v) * np.sin(u)], -1)
    positions = 0.4 * normals + np.stack([np.cos(u), np.zeros_like(u), np.sin(u)], -1)
    index = np.arange(around * across).reshape(around, across)
    b, d = np.roll(index, -1, axis=0), np.roll(index, -1, axis=1)
    c = np.roll(b, -1, axis=1)
    faces = np.concatenate(
        [np.stack([part.ravel() for part in corners], 1) for corners in ((index, c, b), (index, d, c))]
    )
    return Mesh(
        "torus",
        np.zeros(3),
        positions.reshape(-1, 3).astype(np.float32),
        faces.astype(np.int32),
        normals.reshape(-1, 3).astype(np.float32),
        closed=True,
    )


@pytest.fixture(scope="module")
def ctx() -> Iterator[moderngl.Context]:
    try:
        context = moderngl.create_context(standalone=True, backend="egl")
    except Exception as error:
        pytest.skip(f"no OpenGL without a window: {error}")
    yield context
    context.release()


@pytest.fixture(params=[False, True], ids=["both sides", "front faces"])
def baseline(request: pytest.FixtureRequest, ctx: moderngl.Context) -> Iterator[TriangleBaseline]:
    triangles = TriangleBaseline(ctx, torus(), cull_back_faces=request.param)
    yield triangles
    triangles.release()
    assert ctx.error == "GL_NO_ERROR"


def test_picture_is_that_of_one_ray_a_pixel(baseline: TriangleBaseline) -> None:
    picture, rays = baseline.arrays(VIEW), cast(torus(), VIEW, samples=1)
    # A pixel centre that lies on an edge to within rounding may fall to either side of it.
    differ = picture.coverage != rays.coverage
    assert differ.sum() <= 3
    error = measure(picture.normal, picture.depth, picture.coverage, rays)
    assert error.normal_degrees.mean < 0.01
    assert error.normal_degrees.p99 < 0.05
    assert error.depth_relative.p99 < 1e-5


def test_picture_keeps_the_silhouette_of_the_finer_reference(baseline: TriangleBaseline) -> None:
    picture, reference = baseline.arrays(VIEW), cast(torus(), VIEW, samples=4)
    error = measure(picture.normal, picture.depth, picture.coverage, reference)
    assert abs(error.growth) < 0.03
    assert error.mismatch < 0.3
    assert (error.holes, error.holes_with_border, error.spill) == (0, 0, 0)
    assert error.smooth_normal_degrees.mean < 0.4


def test_shaded_picture_covers_the_same_pixels_with_row_zero_at_the_top(baseline: TriangleBaseline) -> None:
    with pytest.raises(RuntimeError, match="nothing has been drawn"):
        baseline.color()
    baseline.draw(VIEW)
    color = baseline.color()
    assert color.shape == (120, 160, 4)
    assert np.array_equal(color[..., 3] == 255, baseline.arrays(VIEW).coverage == 1.0)
    drawn = color[color[..., 3] == 255][:, :3]
    assert drawn.min() > 5  # the headlight reaches everything that is seen
    assert drawn.max() > 120


def test_target_follows_the_size_of_the_view(baseline: TriangleBaseline) -> None:
    baseline.draw(VIEW)
    small = look_at((2.2, 1.1, 2.0), (0, 0, 0), (0, 1, 0), 0.8, (32, 24), bounds=((0, 0, 0), 1.5))
    baseline.draw(small)
    assert baseline.color().shape == (24, 32, 4)


def test_time_is_that_of_whole_frames(baseline: TriangleBaseline) -> None:
    # Less than a microsecond a pixel row would mean that no one waited for the pixels.
    assert 0.01 < baseline.median_ms(VIEW, frames=3, warm_up=1) < 2000.0
    with pytest.raises(ValueError, match="at least one frame"):
        baseline.median_ms(VIEW, frames=0)
