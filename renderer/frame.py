"""A frame as arrays."""

from __future__ import annotations

from dataclasses import dataclass

from hierarchy.model import Float32Array, UInt8Array


@dataclass(frozen=True, eq=False)
class Frame:
    """What a view shows, row 0 at the top.

    normal : float32 (H, W, 3), unit, in the axes of the file's own space; zero where nothing is drawn
    depth : float32 (H, W), distance along the view axis, model space; inf where nothing is drawn
    coverage : float32 (H, W), 0..1
    color : uint8 (H, W, 4), the shaded picture, sRGB
    """

    normal: Float32Array
    depth: Float32Array
    coverage: Float32Array
    color: UInt8Array
