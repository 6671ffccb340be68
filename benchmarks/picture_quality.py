"""How like the truth a shaded picture looks: PSNR, SSIM and FLIP.

Based on: Wang, Bovik, Sheikh, Simoncelli, "Image Quality Assessment: From Error Visibility to Structural Similarity",
IEEE TIP 13(4), 2004; Andersson et al., "FLIP: A Difference Evaluator for Alternating Images", HPG 2020.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from benchmarks.extras import require
from hierarchy.model import UInt8Array

# Luma of sRGB levels (ITU-R BT.601), what the authors of SSIM took of colour pictures.
LUMA = (0.299, 0.587, 0.114)
# Wang et al.'s Gaussian window of standard deviation 1.5 is 11 pixels wide; smaller pictures do not hold it.
WINDOW = 11


@dataclass(frozen=True)
class PictureQuality:
    """Figures over all pixels, the background among them.

    psnr : decibels over the three channels of the sRGB levels; None where the pictures are equal
    ssim : of luma, at most 1, which is equality; None where the picture is smaller than its window
    flip : mean, 0 (no difference) to 1, for a viewer who sees 67 pixels a degree; None: it was not asked for
    """

    psnr: float | None
    ssim: float | None
    flip: float | None

    def to_dict(self) -> dict[str, object]:
        """Return a plain dictionary of numbers, for JSON."""
        return asdict(self)


def picture_quality(picture: UInt8Array, truth: UInt8Array, *, flip: bool = True) -> PictureQuality:
    """Compare a shaded picture with the shaded truth of the same view.

    picture, truth : uint8 (H, W, 3 or more), sRGB; channels beyond the third are not looked at
    flip : measure FLIP as well, which takes about two seconds a megapixel, ten times as long as the others together
    Raises ValueError where they are not pictures of one size, UsageError without scikit-image or flip-evaluator.
    """
    if picture.dtype != np.uint8 or truth.dtype != np.uint8:
        raise ValueError(f"the levels must be uint8, not {picture.dtype} and {truth.dtype}")
    shapes = (picture.shape, truth.shape)
    if any(len(shape) != 3 or shape[2] < 3 for shape in shapes) or shapes[0][:2] != shapes[1][:2]:
        raise ValueError(f"the picture is {picture.shape}, the truth {truth.shape}")
    picture, truth = np.ascontiguousarray(picture[..., :3]), np.ascontiguousarray(truth[..., :3])
    return PictureQuality(_psnr(picture, truth), _ssim(picture, truth), _flip(picture, truth) if flip else None)


def _psnr(picture: UInt8Array, truth: UInt8Array) -> float | None:
    if np.array_equal(picture, truth):
        return None
    return float(require("skimage.metrics", "scikit-image").peak_signal_noise_ratio(truth, picture))


def _ssim(picture: UInt8Array, truth: UInt8Array) -> float | None:
    metrics = require("skimage.metrics", "scikit-image")
    if min(picture.shape[:2]) < WINDOW:
        return None
    a, b = (levels @ np.array(LUMA) for levels in (truth, picture))
    # The window and the covariance of the paper.
    ssim = metrics.structural_similarity(
        a, b, data_range=255.0, gaussian_weights=True, sigma=1.5, use_sample_covariance=False
    )
    return float(ssim)


def _flip(picture: UInt8Array, truth: UInt8Array) -> float:
    evaluator = require("flip_evaluator", "flip-evaluator")
    a, b = (levels.astype(np.float32) / np.float32(255.0) for levels in (truth, picture))
    _, mean, _ = evaluator.evaluate(a, b, "LDR", inputsRGB=True, applyMagma=False)
    return float(mean)
