"""How a frame looks: everything that the user can switch without choosing another cut."""

from __future__ import annotations

from dataclasses import dataclass

Rgb = tuple[float, float, float]

# Names of the materials; "clay" is lit by lights that stay with the eye, the others are matcaps (renderer/matcaps.py).
MATERIALS = ("clay", "pearl", "bronze", "jade")


# How a splat is drawn: as a rectangle in its own plane, or as the papers' square of pixels (a point sprite).
SPLATS = ("quad", "sprite")


@dataclass(frozen=True)
class Settings:
    """Settings of a frame; colours are sRGB in 0..1.

    normal_mapping : take normals (and colours) from the tiles
    splat : one of SPLATS; graphics drivers limit the size of sprites
    blending : mix overlapping splats; without, the nearest one shows
    two_sided : turn normals that face away towards the eye before lighting
    material : one of MATERIALS
    use_colors : show the model's own colours where it has them
    silhouette_overlay : tint what the selection holds for silhouette
    splat_outlines : darken the rim of every splat
    lod_colors : colour splats by their radius on screen, leaf triangles in grey
    ground : a soft shadow on a floor below the model
    ground_up : direction away from the floor, model space
    background_top, background_bottom : a vertical gradient
    base_color : colour of a model that has none
    """

    normal_mapping: bool = True
    splat: str = "quad"
    blending: bool = True
    two_sided: bool = False
    material: str = "clay"
    use_colors: bool = True
    silhouette_overlay: bool = False
    splat_outlines: bool = False
    lod_colors: bool = False
    ground: bool = False
    ground_up: tuple[float, float, float] = (0.0, 1.0, 0.0)
    background_top: Rgb = (0.36, 0.40, 0.46)
    background_bottom: Rgb = (0.13, 0.14, 0.17)
    base_color: Rgb = (0.80, 0.77, 0.72)
