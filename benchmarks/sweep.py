"""Which settings of which views are measured.

The full sweep varies one or two things at a time around the viewer's own setting (r_sil 2, r_inner 16, w_s 16): the
product of everything with everything would say little more and take days. The quick one takes fewer steps, on few
views, and the viewer's own setting on all views of the first model.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator

from benchmarks.methods import METHODS
from benchmarks.run_file import Setting

R_SIL, R_INNER, TEXELS = 2.0, 16.0, 16

# The views that the whole sweep is measured on; "all" are those that the model has.
VIEW_SETS = {"one": ("front",), "few": ("front", "orbit 4", "close-up")}

# Method, r_sil, r_inner and w_s of a setting.
Point = tuple[str, float, float, int]


def swept_views(name: str, views: Iterable[str]) -> list[str]:
    """Return the views that belong to a set of them: "one", "few" or "all"."""
    return [view for view in views if name == "all" or view in VIEW_SETS[name]]


def settings_of(
    model: str, views: Iterable[str], swept: Collection[str], *, closed: bool, quick: bool, everywhere: bool
) -> list[Setting]:
    """Return the settings to measure of a model, each once, those together that share a hierarchy and tiles.

    views : names of the views that the model has
    swept : those of them that all settings are measured on
    closed : faces that face away can be left out
    quick : sweep in fewer steps
    everywhere : measure the viewer's own setting on all views
    """
    names = list(views)
    points = [*(_quick() if quick else _full()), *_without_radii(closed)]
    chosen = {Setting(model, view, *point): None for view in names if view in swept for point in points}
    if everywhere:
        chosen |= {Setting(model, view, *point): None for view in names for point in _own()}
    order = {name: index for index, name in enumerate(names)}

    def group(setting: Setting) -> tuple[bool, int, int]:
        return METHODS[setting.method].points, setting.w_s, order[setting.view]

    return sorted(chosen, key=group)


def is_usual(setting: Setting) -> bool:
    """Tell whether a setting is the one that its method is compared with others by."""
    radii = {(0.0, 0.0), (R_SIL, R_INNER), (R_SIL, R_SIL)}
    return (setting.r_sil, setting.r_inner) in radii and setting.w_s in (0, TEXELS)


def _full() -> Iterator[Point]:
    for r_sil in (1.0, 1.5, 2.0, 3.0, 4.0, 6.0):
        yield "surfelscope", r_sil, R_INNER, TEXELS
    for r_inner in (4.0, 8.0, 12.0, 16.0, 24.0, 32.0, 48.0):
        for texels in (2, 4, 8, 16, 32):
            # A disc of r_inner is 2 r_inner pixels wide: more texels than that show nothing more.
            if texels <= 2.0 * r_inner:
                yield "surfelscope", R_SIL, r_inner, texels
    # Without silhouette refinement: one radius, with tiles.
    for radius in (3.0, 4.0, 6.0, 8.0, 16.0):
        yield "surfelscope", radius, radius, _texels_of(radius)
    for r_sil in (1.75, 3.0, 4.0, 6.0):
        yield "surfelscope", r_sil, 32.0, TEXELS
    # As few splats as will do, down to a thousand.
    for r_sil in (7.0, 8.0, 10.0, 13.0, 16.0, 24.0):
        yield "surfelscope", r_sil, 64.0, TEXELS
    for r_inner in (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0, 48.0):
        yield "no tiles", min(R_SIL, r_inner), r_inner, 0
    for radius in (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0):
        yield "one radius", radius, radius, 0
    for r_inner in (8.0, 16.0, 24.0, 32.0):
        yield "not blended", R_SIL, r_inner, TEXELS
        yield "point sprites", R_SIL, r_inner, TEXELS
        yield "printed cone test", R_SIL, r_inner, TEXELS
    for texels in (4, 8, 16, 32):
        yield "tiles of one size", R_SIL, R_INNER, texels


def _quick() -> Iterator[Point]:
    for r_sil in (1.0, 2.0, 4.0):
        yield "surfelscope", r_sil, R_INNER, TEXELS
    for r_inner in (8.0, 16.0, 24.0, 32.0):
        for texels in (4, 8, 16):
            yield "surfelscope", R_SIL, r_inner, texels
    for r_sil in (4.0, 6.0):
        yield "surfelscope", r_sil, 32.0, TEXELS
    for r_sil in (7.0, 8.0, 10.0):
        yield "surfelscope", r_sil, 64.0, TEXELS
    yield "surfelscope", 1.75, 32.0, TEXELS
    for r_inner in (16.0, 24.0):
        yield "not blended", R_SIL, r_inner, TEXELS
    for radius in (4.0, 6.0, 8.0, 16.0):
        yield "surfelscope", radius, radius, _texels_of(radius)
    for r_inner in (1.0, 2.0, 4.0, 5.0, 6.0, 8.0, 16.0):
        yield "no tiles", min(R_SIL, r_inner), r_inner, 0
    for radius in (2.0, 4.0, 6.0, 8.0):
        yield "one radius", radius, radius, 0
    yield "point sprites", R_SIL, R_INNER, TEXELS
    yield "printed cone test", R_SIL, R_INNER, TEXELS
    for texels in (8, 16):
        yield "tiles of one size", R_SIL, R_INNER, texels


def _texels_of(radius: float) -> int:
    return TEXELS if 2.0 * radius >= TEXELS else 4


def _without_radii(closed: bool) -> Iterator[Point]:
    for name, method in METHODS.items():
        if not method.radii and (closed or not method.cull):
            yield name, 0.0, 0.0, 0


def _own() -> Iterator[Point]:
    yield "surfelscope", R_SIL, R_INNER, TEXELS
