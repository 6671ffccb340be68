"""Where the error of a picture sits: the angle between normals over the picture, beside what it shows."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from PIL import Image

from benchmarks.extras import require
from hierarchy.model import Float32Array, UInt8Array

# Degrees at the top of the scale; larger errors look like it.
MOST_DEGREES = 5.0
# Pixels left around what is drawn.
BORDER = 12
# Colours: magma is perceptually uniform, in grey as well; where nothing is compared it is light grey.
COLORMAP, OUTSIDE = "magma", "#D8D8D8"


def draw_heat_map(path: Path, shaded: UInt8Array, degrees: Float32Array, title: str) -> None:
    """Write a PNG with the shaded picture on the left and its error on the right, with a scale.

    shaded : uint8 (H, W, 3), row 0 at the top
    degrees : float32 (H, W), angle between the normals, nan where there is none to compare, as in
        `error.normal_error_image`
    Both are cut to the part where something is compared. Raises UsageError without matplotlib, ValueError where the
    shapes differ or nothing is compared, OSError where the file cannot be written.
    """
    if shaded.shape != (*degrees.shape, 3):
        raise ValueError(f"the picture is {shaded.shape}, its error {degrees.shape}")
    rows, columns = _part(degrees)
    require("matplotlib", "matplotlib").use("Agg")
    pyplot = require("matplotlib.pyplot", "matplotlib")
    colormap = require("matplotlib", "matplotlib").colormaps[COLORMAP].with_extremes(bad=OUTSIDE)
    height, width = degrees[rows, columns].shape
    size = (9.2, 0.5 + 4.2 * height / width)
    figure, (left, right) = pyplot.subplots(1, 2, figsize=size, layout="constrained")
    try:
        left.imshow(shaded[rows, columns], interpolation="antialiased")
        image = right.imshow(
            degrees[rows, columns], cmap=colormap, vmin=0.0, vmax=MOST_DEGREES, interpolation="antialiased"
        )
        for axes in (left, right):
            axes.set_axis_off()
        bar = figure.colorbar(image, ax=right, fraction=0.045, pad=0.02, extend="max")
        bar.outline.set_visible(False)
        bar.set_label("normal error, degrees")
        left.set_title(title, loc="left", fontsize=10)
        right.set_title(f"mean {np.nanmean(degrees):.2f}°, 95th percentile {np.nanpercentile(degrees, 95):.2f}°",
                        loc="left", fontsize=10)  # fmt: skip
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", dpi=110, facecolor="white", bbox_inches="tight", pad_inches=0.05)
    finally:
        pyplot.close(figure)
    with Image.open(buffer) as picture:
        picture.convert("RGB").save(path, format="png", optimize=True)


def _part(degrees: Float32Array) -> tuple[slice, slice]:
    """Return the rows and columns that hold everything that is compared, and a border."""
    compared = np.isfinite(degrees)
    if not compared.any():
        raise ValueError("nothing is compared")
    places = [np.flatnonzero(compared.any(axis=axis)) for axis in (1, 0)]
    rows, columns = (
        slice(max(int(place[0]) - BORDER, 0), min(int(place[-1]) + 1 + BORDER, size))
        for place, size in zip(places, degrees.shape, strict=True)
    )
    return rows, columns
