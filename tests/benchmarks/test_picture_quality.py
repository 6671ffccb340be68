"""PSNR, SSIM and FLIP of pictures that differ in a known way."""

from __future__ import annotations

import json
import math
import sys

import numpy as np
import pytest

from app.errors import UsageError
from benchmarks.picture_quality import PictureQuality, picture_quality
from hierarchy.model import UInt8Array

pytest.importorskip("skimage", reason="scikit-image measures the pictures")
pytest.importorskip("flip_evaluator", reason="flip-evaluator measures the pictures")


def checks(size: int = 48, low: int = 60, high: int = 180) -> UInt8Array:
    """Return a chequered picture of squares of 6 pixels."""
    y, x = np.indices((size, size)) // 6
    return np.repeat(np.where((x + y) % 2, low, high).astype(np.uint8)[..., None], 3, axis=2)


def test_equal_pictures_differ_by_nothing() -> None:
    quality = picture_quality(checks(), checks())
    assert (quality.psnr, quality.flip) == (None, 0.0)
    assert quality.ssim == pytest.approx(1.0)
    assert quality.ssim <= 1.0


def test_psnr_is_that_of_its_definition() -> None:
    quality = picture_quality(checks() + np.uint8(5), checks(), flip=False)
    assert quality.psnr == pytest.approx(20.0 * math.log10(255.0 / 5.0))
    assert quality.flip is None


def test_ssim_of_flat_pictures_is_that_of_their_luminance_alone() -> None:
    a, b = (np.full((32, 32, 3), level, np.uint8) for level in (100, 130))
    c1 = (0.01 * 255.0) ** 2
    assert picture_quality(a, b, flip=False).ssim == pytest.approx(
        (2.0 * 100.0 * 130.0 + c1) / (100.0**2 + 130.0**2 + c1), abs=1e-6
    )


def test_all_figures_worsen_with_the_difference() -> None:
    rng = np.random.default_rng(3)
    noise = rng.normal(size=(48, 48, 3))
    one, two = (
        picture_quality(np.clip(checks() + sigma * noise, 0, 255).astype(np.uint8), checks()) for sigma in (4.0, 16.0)
    )
    assert one.psnr > two.psnr
    assert one.ssim > two.ssim
    assert 0.0 < one.flip < two.flip < 1.0


def test_alpha_is_not_looked_at() -> None:
    opaque = np.concatenate([checks(), np.full((48, 48, 1), 255, np.uint8)], axis=2)
    quality = picture_quality(opaque, checks())
    assert (quality.psnr, quality.flip) == (None, 0.0)


def test_channels_and_orientation_are_not_confused() -> None:
    red, blue = np.zeros((2, 24, 24, 3), np.uint8)
    red[..., 0] = blue[..., 2] = 200
    quality = picture_quality(red, blue)
    assert quality.flip > 0.3
    assert quality.psnr == pytest.approx(10.0 * math.log10(255.0**2 / (2.0 * 200.0**2 / 3.0)))


def test_a_picture_smaller_than_the_window_has_no_ssim() -> None:
    quality = picture_quality(checks(10), checks(10) + np.uint8(1))
    assert quality.ssim is None
    assert quality.psnr == pytest.approx(20.0 * math.log10(255.0))
    assert quality.flip > 0.0


def test_figures_are_json() -> None:
    figures = picture_quality(checks(), checks()).to_dict()
    assert json.loads(json.dumps(figures, allow_nan=False)) == {"psnr": None, "ssim": pytest.approx(1.0), "flip": 0.0}


def test_pictures_that_cannot_be_compared_are_refused() -> None:
    good = checks()
    for bad in (good[1:], good[..., :2], good[..., 0]):
        with pytest.raises(ValueError, match="the picture is"):
            picture_quality(bad, good)
        with pytest.raises(ValueError, match="the picture is"):
            picture_quality(good, bad)
    with pytest.raises(ValueError, match="must be uint8"):
        picture_quality(good / 255.0, good)


@pytest.mark.parametrize(
    ("module", "package"), [("skimage.metrics", "scikit-image"), ("flip_evaluator", "flip-evaluator")]
)
def test_what_is_missing_is_named_in_one_line(monkeypatch: pytest.MonkeyPatch, module: str, package: str) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(UsageError, match=f"^benchmarks need {package}: pip install 'surfelscope\\[bench\\]' .*$"):
        picture_quality(checks(), checks() + np.uint8(1))


def test_what_was_measured_compares_by_value() -> None:
    assert picture_quality(checks(), checks(), flip=False) == PictureQuality(None, pytest.approx(1.0), None)
