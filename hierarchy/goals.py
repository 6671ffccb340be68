"""The coarsest detail that keeps a picture within what the user allows, and what a cut promises.

Both errors are means over the picture, predicted from the hierarchy alone, before anything is drawn (promises.py).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from hierarchy.hierarchy import Hierarchy
from hierarchy.lod import Cut, select_cut
from hierarchy.promises import promised_errors
from hierarchy.view import View

# What the radii are chosen from, in pixels. Splats smaller than a pixel do not show; silhouette splats larger than the
# largest open holes, which no promise covers.
INNER_RADII = (64.0, 48.0, 32.0, 24.0, 20.0, 16.0, 12.0, 10.0, 8.0, 6.0, 4.0, 3.0, 2.0, 1.0)
SILHOUETTE_RADII = (5.0, 4.5, 4.0, 3.5, 3.0, 2.5, 2.0, 1.75, 1.5, 1.25, 1.0)
# A smaller tile is taken where its cut has no more than this many times the primitives: it bakes and stores faster.
WORTH = 1.15


@dataclass(frozen=True)
class ErrorGoal:
    """What the user allows, as means over the picture.

    degrees : angle between drawn and true normals
    pixels : displacement of the outline
    """

    degrees: float
    pixels: float


@dataclass(frozen=True)
class Detail:
    """What a frame is drawn with: r_sil and r_inner in pixels, texels along one side of a tile (w_s)."""

    r_sil: float
    r_inner: float
    texels: int


@dataclass(frozen=True)
class Promise:
    """Upper bounds of what `ErrorGoal` limits, predicted for a cut."""

    degrees: float
    pixels: float


def promise_of_cut(hierarchy: Hierarchy, view: View, cut: Cut, texels: int) -> Promise:
    """Predict bounds of a cut's errors.

    texels : along one side of the tiles that it will be drawn with
    """
    (degrees,), pixels = promised_errors(hierarchy, view, cut, (texels,))
    return Promise(degrees, pixels)


def detail_for_goal(
    hierarchy: Hierarchy, view: View, goal: ErrorGoal, *, texels: Sequence[int]
) -> tuple[Detail, Promise]:
    """Choose the detail with the fewest primitives whose cut promises to keep the goal; return it with its promise.

    texels : the w_s that may be chosen, ascending
    Where nothing keeps the goal (there is a limit to what one sample a pixel can show) the finest detail is returned.
    Raises ValueError where there is nothing to choose from.
    """
    if not texels:
        raise ValueError("no size of tiles to choose from")

    # The inside plays no part in the outline; large splats there make this fast.
    def keeps_outline(r_sil: float) -> bool:
        cut = select_cut(hierarchy, view, r_sil, INNER_RADII[0])
        return promised_errors(hierarchy, view, cut, ())[1] <= goal.pixels

    coarsest = _first(SILHOUETTE_RADII, keeps_outline)
    finer = list(SILHOUETTE_RADII[SILHOUETTE_RADII.index(coarsest) :: 2])
    if finer[-1] != SILHOUETTE_RADII[-1]:
        finer.append(SILHOUETTE_RADII[-1])
    best: _Choice | None = None
    # A finer silhouette has better normals, too, and may leave room for a coarser inside.
    for r_sil in finer:
        choice = _coarsest_inside(hierarchy, view, goal, r_sil, texels)
        if best is not None and best.kept and (not choice.kept or choice.count >= best.count):
            break
        best = choice
    assert best is not None
    return best.detail, best.promise


@dataclass(frozen=True)
class _Choice:
    """A detail, what it promises, whether that keeps the goal, and how many primitives it draws."""

    detail: Detail
    promise: Promise
    kept: bool
    count: int


def _coarsest_inside(hierarchy: Hierarchy, view: View, goal: ErrorGoal, r_sil: float, texels: Sequence[int]) -> _Choice:
    """Return the largest r_inner that keeps the goal for an r_sil, with the smallest tiles that are worth it."""
    tried: dict[float, tuple[int, tuple[float, ...], float]] = {}

    def at(r_inner: float) -> tuple[int, tuple[float, ...], float]:
        if r_inner not in tried:
            cut = select_cut(hierarchy, view, r_sil, r_inner)
            count = cut.splat_count + cut.triangle_count
            tried[r_inner] = count, *promised_errors(hierarchy, view, cut, texels)
        return tried[r_inner]

    def coarsest(k: int) -> float:
        return _first(INNER_RADII, lambda r_inner: at(r_inner)[1][k] <= goal.degrees)

    choices = []
    for k, size in enumerate(texels):
        r_inner = coarsest(k)
        count, degrees, pixels = at(r_inner)
        kept = degrees[k] <= goal.degrees and pixels <= goal.pixels
        choices.append(_Choice(Detail(r_sil, r_inner, size), Promise(degrees[k], pixels), kept, count))
    keeping = [choice for choice in choices if choice.kept]
    if keeping:
        fewest = min(choice.count for choice in keeping)
        return next(choice for choice in keeping if choice.count <= WORTH * fewest)
    # Nothing keeps the goal: the smallest tiles that promise as little as any.
    least = min(choice.promise.degrees for choice in choices)
    return next(choice for choice in choices if choice.promise.degrees <= 1.02 * least)


def _first(radii: Sequence[float], keeps: Callable[[float], bool]) -> float:
    """Return the first, largest radius that keeps a goal by bisection, or the last of all."""
    low, high = 0, len(radii) - 1
    while low < high:
        middle = (low + high) // 2
        if keeps(radii[middle]):
            high = middle
        else:
            low = middle + 1
    return radii[low]
