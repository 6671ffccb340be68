"""Split triangles by halving their edges, so that neighbours always agree and no gap or T-junction opens."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hierarchy.half_edges import number_edges
from hierarchy.model import BoolArray, Float64Array, Int32Array
from hierarchy.part import AnyArray

EdgeExcess = Callable[[AnyArray, Sequence[AnyArray], Int32Array], AnyArray]
"""Called as excess(positions, attributes, ends (E, 2)); returns (E,), above 1 where an edge is to be halved."""

# Every round halves edges; what is not short enough after so many never will be.
MOST_ROUNDS = 40

# An edge waits while another one of its face has more than twice its excess.
WORST_EDGES = 0.5


@dataclass(frozen=True, eq=False)
class Subdivision:
    """Triangles after splitting; the old vertices come first, unchanged.

    positions : (V', 3); faces : int32 (T', 3); attributes : one array (V', ...) for each that went in
    source : int32 (T',), the face from which each is cut
    """

    positions: AnyArray
    faces: Int32Array
    attributes: tuple[AnyArray, ...]
    source: Int32Array


def subdivide_edges(
    positions: AnyArray,
    faces: Int32Array,
    attributes: Sequence[AnyArray],
    excess: EdgeExcess,
    *,
    most_faces: int,
    points: Int32Array | None = None,
) -> Subdivision:
    """Halve edges until none has an excess above 1, or `most_faces` are reached; the worst edges come first.

    positions : floats (V, 3); faces : int32 (T, 3), the corners of each differ
    attributes : arrays (V, ...) to be interpolated: floats as they are (normals need normalising afterwards),
        integers rounded
    excess : depends on nothing but the positions and attributes of an edge's ends
    points : int32 (V,), equal for vertices at one place (seams); an edge is halved on both sides of a seam where
        either side wants it. Faces must not repeat a point. None: every vertex is a point
    """
    attributes = tuple(attributes)
    source = np.arange(len(faces), dtype=np.int32)
    for _ in range(MOST_ROUNDS):
        edges, edge_count = number_edges(faces, len(positions))
        ends = np.empty((edge_count, 2), np.int32)
        ends[edges.ravel()] = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
        wish = np.asarray(excess(positions, attributes, ends), np.float64)
        places = np.arange(edge_count, dtype=np.int32)
        if points is not None:
            places, wish = _agree_across_seams(points, faces, edges, wish)
        marked = _choose_edges(wish, places[edges], most_faces - len(faces))[places]
        if not marked.any():
            break
        chosen = np.flatnonzero(marked)
        middle = np.full(edge_count, -1, np.int32)
        middle[chosen] = len(positions) + np.arange(len(chosen), dtype=np.int32)
        if points is not None:
            _, new_points = np.unique(places[chosen], return_inverse=True)
            points = np.concatenate([points, (points.max() + 1 + new_points).astype(np.int32)])
        positions = _with_middles(positions, ends[chosen])
        attributes = tuple(_with_middles(values, ends[chosen]) for values in attributes)
        faces, source = _cut(positions, faces, middle[edges], source)
    return Subdivision(positions, faces, attributes, source)


def _agree_across_seams(
    points: Int32Array, faces: Int32Array, edges: Int32Array, wish: Float64Array
) -> tuple[Int32Array, Float64Array]:
    """Return for each edge the number of its place, and for each place the largest wish of the edges there."""
    place_of_half_edge, count = number_edges(points[faces], int(points.max()) + 1)
    places = np.empty(len(wish), np.int32)
    places[edges.ravel()] = place_of_half_edge.ravel()
    largest = np.zeros(count)
    np.maximum.at(largest, places, wish)
    return places, largest


def _choose_edges(wish: Float64Array, edges: Int32Array, room: int) -> BoolArray:
    """Mark the edges that have a wish above 1, and of each face only those that are about as bad as its worst one.

    So a needle is first cut across, until its pieces are about as long as wide. Where halving all of them would add
    more than `room` faces only the worst ones are marked.
    """
    of_faces = wish[edges]
    bad = (of_faces > 1.0) & (of_faces >= WORST_EDGES * of_faces.max(axis=1, keepdims=True))
    marked = np.zeros(len(wish), np.bool_)
    marked[edges[bad]] = True
    # Halving an edge cuts each of its faces once more.
    wishes = of_faces[marked[edges]]
    if len(wishes) > room:
        if room <= 0:
            return np.zeros_like(marked)
        marked &= wish > np.partition(wishes, len(wishes) - room - 1)[len(wishes) - room - 1]
    return marked


def _with_middles(values: AnyArray, ends: Int32Array) -> AnyArray:
    """Append the mean of both ends of every edge."""
    if np.issubdtype(values.dtype, np.floating):
        half = values.dtype.type(0.5)
        means = half * values[ends[:, 0]] + half * values[ends[:, 1]]
    else:
        means = np.rint(0.5 * values[ends[:, 0]].astype(np.float64) + 0.5 * values[ends[:, 1]]).astype(values.dtype)
    return np.concatenate([values, means])


def _cut(
    positions: AnyArray, faces: Int32Array, middles: Int32Array, source: Int32Array
) -> tuple[Int32Array, Int32Array]:
    """Cut every face at the middles (T, 3) of its edges, -1 where an edge stays whole; edge i follows corner i."""
    halved = (middles >= 0).sum(axis=1)
    new_faces = [faces[halved == 0]]
    new_source = [source[halved == 0]]

    def add(of: AnyArray, *triangles: tuple[AnyArray, AnyArray, AnyArray]) -> None:
        new_faces.extend(np.stack(triangle, axis=1) for triangle in triangles)
        new_source.extend([source[of]] * len(triangles))

    # Turn each face so that the whole edges come last.
    for shift in range(3):
        turned = np.roll(middles, -shift, axis=1)
        one = np.flatnonzero((halved == 1) & (turned[:, 0] >= 0))
        a, b, c = np.roll(faces[one], -shift, axis=1).T
        m = turned[one, 0]
        add(one, (a, m, c), (m, b, c))

        two = np.flatnonzero((halved == 2) & (turned[:, 2] < 0))
        a, b, c = np.roll(faces[two], -shift, axis=1).T
        m, n = turned[two, 0], turned[two, 1]
        # The rest is a quadrangle a m n c; its shorter diagonal makes the better triangles.
        short = _squared(positions[a], positions[n]) <= _squared(positions[m], positions[c])
        add(two, (m, b, n), (a, m, np.where(short, n, c)), (np.where(short, a, m), n, c))

    three = np.flatnonzero(halved == 3)
    a, b, c = faces[three].T
    m, n, o = middles[three].T
    add(three, (a, m, o), (m, b, n), (o, n, c), (m, n, o))
    return np.concatenate(new_faces), np.concatenate(new_source)


def _squared(a: AnyArray, b: AnyArray) -> AnyArray:
    difference = a.astype(np.float64) - b.astype(np.float64)
    return np.asarray(np.einsum("ij,ij->i", difference, difference))
