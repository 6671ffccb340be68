"""The kernels that bake tiles: which primitives lie over a disc, and what they put into its texels.

Based on: Holst and Schumann 2007, section 4. A texel's line runs through the disc along its normal; Algorithm 2
(hybrid hierarchy) takes the interpolated normal of the triangle that it hits, Algorithm 1 (point hierarchy) the
Gaussian-weighted sum of the base surfels that it hits. The primitives that a line can hit do not depend on the
texel, so the hierarchy is traversed once per node, and each primitive found is scattered into the texels it covers.

Departures: texels lie at 2x/(w-1) - 1, which is where eq. 11 samples them (eq. 12 as printed disagrees with it);
primitives that face the other side do not count; the sphere that selects candidates is the node's bounding sphere,
not the disc's, so that no primitive over the rim is lost; and an interpolated normal that leans below the disc is
kept on the rim of the hemisphere. A texel whose line hits nothing keeps the disc's own normal. Where very many
primitives lie over one disc, as in a fan of a million triangles, a sample of those below the node and next to it has
to do.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from hierarchy.borrowing import BORROWING
from hierarchy.encoding import encode_hemisphere
from hierarchy.frames import tangents
from hierarchy.kernel import gaussian

# Tiles lie in the layers of an array texture of this size: every OpenGL 3.3 has it, and 256 layers of it (1M tiles
# of 16 x 16) besides.
LAYER_SIZE = 1024
# What may be looked at for one tile, nodes, leaves and texels together: BASE_VISITS, some for each of the node's own
# leaves, and LAYERS times the texels: enough for all tiles of ordinary meshes and for 99.9% of a cloud's.
BASE_VISITS = 1024
VISITS_PER_LEAF = 16
LAYERS = 24
# Nodes that a traversal can have before it at a time: a path down the tree is at most 74 nodes long (octree.py).
STACK = 128
# Slack of the inside test, relative to the triangle: a texel on an edge must not fall between two triangles.
EDGE_SLACK = 1e-9


@nb.njit(cache=True, nogil=True, inline="always")
def _reach(radius, sphere, texels):  # type: ignore[no-untyped-def]
    """Return the radius of the sphere around all texels that a lookup inside the disc can touch."""
    beyond = min(math.sqrt(2.0), 1.0 + 2.0 * math.sqrt(2.0) / max(texels - 1, 1))
    return max(sphere, radius * beyond)


@nb.njit(cache=True, nogil=True, inline="always")
def _texels_between(low, high, texels):  # type: ignore[no-untyped-def]
    """Return the first and the last of the texels 0 .. texels - 1 in [low, high]; the last comes first if none is.

    Cut off before they are rounded: what no integer can hold, as where a primitive lies 1e30 radii away, would become
    any integer, and the loop over it endless.
    """
    if not (high >= 0.0 and low <= texels - 1.0):
        return 0, -1
    return math.ceil(max(low, 0.0)), math.floor(min(high, texels - 1.0))


@nb.njit(cache=True, nogil=True, inline="always")
def _seen_from(vectors, row, origin):  # type: ignore[no-untyped-def]
    return vectors[row, 0] - origin[0], vectors[row, 1] - origin[1], vectors[row, 2] - origin[2]


@nb.njit(cache=True, nogil=True, inline="always")
def _along(vector, axis):  # type: ignore[no-untyped-def]
    return vector[0] * axis[0] + vector[1] * axis[1] + vector[2] * axis[2]


@nb.njit(cache=True, nogil=True, inline="always")
def _vertex_normal(normals, vertex):  # type: ignore[no-untyped-def]
    return np.float64(normals[vertex, 0]), np.float64(normals[vertex, 1]), np.float64(normals[vertex, 2])


# Inlined, as most triangles cover no more than a few texels: handing over what it takes is a third of its work.
@nb.njit(**BORROWING, error_model="numpy", inline="always")
def _fill_triangle(x_of, y_of, h_of, box, area, vertices, normals, colors, height, sums):  # type: ignore[no-untyped-def]
    """Write a triangle's interpolated normal to the texels where it is the nearest to the disc's plane.

    x_of, y_of, h_of : of the three vertices, in texels and, the distance from the plane, in lengths
    box : the first and the last column and row of texels that it may cover
    area : twice that of the triangle, seen along the disc's normal
    height, sums : float64 (w, w) and (C, w, w), columns of texels: distance of the nearest hit so far, its normal in
        model space and, where C is 7, its colour
    """
    (ax, bx, cx), (ay, by, cy), (a, b, c) = x_of, y_of, vertices
    left, right, low, high = box
    # Read once: for all that the compiler knows, what is written below might overlap them.
    of_a, of_b, of_c = _vertex_normal(normals, a), _vertex_normal(normals, b), _vertex_normal(normals, c)
    slack = -EDGE_SLACK * (abs(area) + abs(ax) + abs(ay) + abs(bx) + abs(by) + abs(cx) + abs(cy))
    for x in range(left, right + 1):
        met = False
        for y in range(low, high + 1):
            wa = (bx - x) * (cy - y) - (by - y) * (cx - x)
            wb = (cx - x) * (ay - y) - (cy - y) * (ax - x)
            # Each from its own edge, which has exactly the opposite in the triangle beyond: no texel falls between.
            wc = (ax - x) * (by - y) - (ay - y) * (bx - x)
            if wa < slack or wb < slack or wc < slack:
                # A triangle takes one piece of a column.
                if met:
                    break
                continue
            met = True
            # Seen edge-on the slack is as large as the area: what is interpolated must stay within the triangle.
            wa, wb, wc = max(wa, 0.0), max(wb, 0.0), max(wc, 0.0)
            total = wa + wb + wc
            if not total > 0.0:
                continue
            wa, wb, wc = wa / total, wb / total, wc / total
            h = abs(wa * h_of[0] + wb * h_of[1] + wc * h_of[2])
            if h < height[x, y]:
                height[x, y] = h
                for k in range(3):
                    sums[k, x, y] = wa * of_a[k] + wb * of_b[k] + wc * of_c[k]
                for k in range(3, len(sums)):
                    sums[k, x, y] = wa * colors[a, k - 3] + wb * colors[b, k - 3] + wc * colors[c, k - 3]


@nb.njit(cache=True, nogil=True, inline="always")
def _scatter_triangle(leaves, leaf, disc, scale, half, height, sums):  # type: ignore[no-untyped-def]
    """Scatter a triangle into a tile, of which it may well cover no texel; return how many texels it looked at."""
    positions, normals, indices, _, colors = leaves
    at, u, v, n = disc
    vertices = (indices[leaf, 0], indices[leaf, 1], indices[leaf, 2])
    texels = len(height)
    a, b, c = (
        _seen_from(positions, vertices[0], at),
        _seen_from(positions, vertices[1], at),
        _seen_from(positions, vertices[2], at),
    )
    ax, bx, cx = _along(a, u) * scale + half, _along(b, u) * scale + half, _along(c, u) * scale + half
    left, right = _texels_between(min(ax, bx, cx) - EDGE_SLACK, max(ax, bx, cx) + EDGE_SLACK, texels)
    if left > right:
        return 0
    ay, by, cy = _along(a, v) * scale + half, _along(b, v) * scale + half, _along(c, v) * scale + half
    low, high = _texels_between(min(ay, by, cy) - EDGE_SLACK, max(ay, by, cy) + EDGE_SLACK, texels)
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    if low > high or not area > 0.0:
        return 0
    h_of = (_along(a, n), _along(b, n), _along(c, n))
    box = (left, right, low, high)
    _fill_triangle((ax, bx, cx), (ay, by, cy), h_of, box, area, vertices, normals, colors, height, sums)
    return (high + 1 - low) * (right + 1 - left)


@nb.njit(**BORROWING, error_model="numpy")
def _scatter_surfel(leaves, leaf, disc, scale, half, weights, sums):  # type: ignore[no-untyped-def]
    """Add a base surfel's weighted normal to the texels whose lines hit its disc (Algorithm 1, eq. 13-14).

    weights, sums : float64 (w, w) and (C, w, w), columns of texels: sum of weights, weighted normals in model space
        and, where C is 7, weighted colours
    Returns how many texels it looked at.
    """
    positions, normals, _, radii, colors = leaves
    at, o1, o2, n = disc
    texels = len(weights)
    centre, normal = _seen_from(positions, leaf, at), (normals[leaf, 0], normals[leaf, 1], normals[leaf, 2])
    u, v = _along(centre, o1), _along(centre, o2)
    a, b, c = _along(normal, o1), _along(normal, o2), _along(normal, n)
    radius, spacing = np.float64(radii[leaf]), 1.0 / scale
    if c <= 1e-6 or not radius > 0.0:
        return 0
    # Not 1 - a^2: at grazing angles that is what the stored normal is off unit length.
    extent_u = radius * math.sqrt(b * b + c * c)
    extent_v = radius * math.sqrt(a * a + c * c)
    left, right = _texels_between((u - extent_u) / spacing + half, (u + extent_u) / spacing + half, texels)
    low, high = _texels_between((v - extent_v) / spacing + half, (v + extent_v) / spacing + half, texels)
    for x in range(left, right + 1):
        for y in range(low, high + 1):
            du, dv = (x - half) * spacing - u, (y - half) * spacing - v
            dh = -(a * du + b * dv) / c
            rho2 = (du * du + dv * dv + dh * dh) / (radius * radius)
            if rho2 >= 1.0:
                continue
            weight = gaussian(rho2)
            weights[x, y] += weight
            for k in range(3):
                sums[k, x, y] += weight * normals[leaf, k]
            for k in range(3, len(sums)):
                sums[k, x, y] += weight * colors[leaf, k - 3]
    return max(high + 1 - low, 0) * max(right + 1 - left, 0)


@nb.njit(cache=True, nogil=True, inline="always")
def _scatter(leaves, triangles, leaf, disc, reach, scale, half, nearest, sums):  # type: ignore[no-untyped-def]
    """Scatter a leaf into a tile; return how much work it was, in leaves and texels.

    disc : where its centre lies, o1, o2 and its normal, three floats each
    reach : of the sphere that selects surfels
    scale, half : a point u of the disc's plane lies at texel u * scale + half
    nearest, sums : of `sum_up`
    """
    if triangles:
        return 1 + _scatter_triangle(leaves, leaf, disc, scale, half, nearest, sums)
    x, y, z = _seen_from(leaves[0], leaf, disc[0])
    if x * x + y * y + z * z > (reach + leaves[3][leaf]) ** 2:
        return 1
    return 1 + _scatter_surfel(leaves, leaf, disc, scale, half, nearest, sums)


@nb.njit(**BORROWING, error_model="numpy")
def _scatter_one(leaves, triangles, leaf, disc, reach, scale, half, nearest, sums):  # type: ignore[no-untyped-def]
    """Scatter a leaf into a tile where it matters more how long compiling takes."""
    return _scatter(leaves, triangles, leaf, disc, reach, scale, half, nearest, sums)


@nb.njit(**BORROWING, error_model="numpy")
def _gather(nodes, leaves, triangles, node, disc, texels, stack, nearest, sums):  # type: ignore[no-untyped-def]
    """Traverse from the root to every leaf whose sphere meets the node's and scatter it into the tile.

    stack : int32 (STACK,) to work in
    Returns whether the work allowed for a tile was enough for it.
    """
    me = nodes[node]
    px, py, pz = disc[0]
    reach = _reach(np.float64(me["radius"]), np.float64(me["sphere"]), texels)
    half = 0.5 * (texels - 1)
    scale = _scale(me, texels)
    work_left = _most_work(me, texels)
    stack[0] = 0
    top = 1
    while top > 0:
        top -= 1
        inner = nodes[stack[top]]
        dx, dy, dz = inner["x"] - px, inner["y"] - py, inner["z"] - pz
        limit = reach + inner["sphere"]
        if dx * dx + dy * dy + dz * dz > limit * limit:
            continue
        work_left -= 1
        if work_left < 0:
            return False
        first, last = inner["first_child"], inner["first_child"] + inner["child_count"]
        begin = inner["leaf_begin"]
        for child in range(first, last + 1):
            # The leaves between two children hang on this node itself.
            end = nodes[child]["leaf_begin"] if child < last else inner["leaf_end"]
            for leaf in range(begin, end):
                work_left -= _scatter(leaves, triangles, leaf, disc, reach, scale, half, nearest, sums)
            if child < last:
                begin = nodes[child]["leaf_end"]
                stack[top] = child
                top += 1
    return True


@nb.njit(cache=True, nogil=True, inline="always")
def _scale(me, texels):  # type: ignore[no-untyped-def]
    """Return how many texels of a node's tile a unit length has; one texel lies in the centre, any scale will do."""
    return (0.5 * (texels - 1) if texels > 1 else 0.5) / max(np.float64(me["radius"]), 1e-300)


@nb.njit(cache=True, nogil=True, inline="always")
def _most_work(me, texels):  # type: ignore[no-untyped-def]
    """Return how many nodes, leaves and texels may be looked at for a node's tile."""
    return BASE_VISITS + VISITS_PER_LEAF * (me["leaf_end"] - me["leaf_begin"]) + LAYERS * texels * texels


@nb.njit(**BORROWING, error_model="numpy")
def _gather_sample(nodes, leaves, triangles, node, disc, texels, nearest, sums):  # type: ignore[no-untyped-def]
    """Scatter as many leaves into a tile as the work allowed for it is enough for: the node's own, then others nearby.

    Own leaves come in an order of which any beginning is spread evenly over all: steps of the golden ratio. The others
    are those before and behind them in Morton order.
    """
    me = nodes[node]
    reach = _reach(np.float64(me["radius"]), np.float64(me["sphere"]), texels)
    half = 0.5 * (texels - 1)
    scale = _scale(me, texels)
    work_left = _most_work(me, texels)
    begin, end = np.int64(me["leaf_begin"]), np.int64(me["leaf_end"])
    count = end - begin
    step = int(0.6180339887 * count) or 1
    while math.gcd(step, count) != 1:
        step += 1
    for k in range(count):
        leaf = begin + k * step % count
        work_left -= _scatter_one(leaves, triangles, leaf, disc, reach, scale, half, nearest, sums)
        if work_left < 0:
            return
    leaf_count = np.int64(nodes[0]["leaf_end"])
    for k in range(leaf_count):
        before, behind = begin - 1 - k, end + k
        if before >= 0:
            work_left -= _scatter_one(leaves, triangles, before, disc, reach, scale, half, nearest, sums)
        if behind < leaf_count:
            work_left -= _scatter_one(leaves, triangles, behind, disc, reach, scale, half, nearest, sums)
        if work_left < 0:
            return


@nb.njit(**BORROWING)
def _store(nearest, sums, frame, triangles, out_normals, out_colors):  # type: ignore[no-untyped-def]
    """Encode a tile's sums into its texels of the atlas; a texel that hit nothing keeps what is there."""
    texels = len(nearest)
    for y in range(texels):
        for x in range(texels):
            if nearest[x, y] == np.inf if triangles else nearest[x, y] <= 0.0:
                continue
            normal = (sums[0, x, y], sums[1, x, y], sums[2, x, y])
            code = encode_hemisphere(_along(normal, frame[0]), _along(normal, frame[1]), _along(normal, frame[2]))
            out_normals[y, x, 0], out_normals[y, x, 1] = code
            weight = 1.0 if triangles else nearest[x, y]
            for k in range(3, len(sums)):
                out_colors[y, x, k - 3] = np.rint(sums[k, x, y] / weight)


@nb.njit(**BORROWING)
def sum_up(nodes, disc_normals, leaves, triangles, node, stack, frame, nearest, sums):  # type: ignore[no-untyped-def]
    """Sum up what lies over a node's disc in the texels of its tile.

    stack : int32 (STACK,) to work in
    frame : float64 (3, 3), is set to the disc's: o1, o2 and its normal in rows
    nearest, sums : float64 (w, w) and (C, w, w), are set to what `_fill_triangle` or `_scatter_surfel` leaves there
    """
    texels = len(nearest)
    for k in range(3):
        frame[2, k] = disc_normals[node, k]
    u = tangents(frame[2, 0], frame[2, 1], frame[2, 2])
    for k in range(3):
        frame[0, k], frame[1, k] = u[k], u[3 + k]
    me = nodes[node]
    at = (np.float64(me["x"]), np.float64(me["y"]), np.float64(me["z"]))
    disc = (at, (u[0], u[1], u[2]), (u[3], u[4], u[5]), (frame[2, 0], frame[2, 1], frame[2, 2]))
    nearest[:] = np.inf if triangles else 0.0
    sums[:] = 0.0
    if not _gather(nodes, leaves, triangles, node, disc, texels, stack, nearest, sums):
        nearest[:] = np.inf if triangles else 0.0
        sums[:] = 0.0
        _gather_sample(nodes, leaves, triangles, node, disc, texels, nearest, sums)


@nb.njit(cache=True, nogil=True)
def _bake(nodes, disc_normals, leaves, triangles, node, index, texels, normals, colors):  # type: ignore[no-untyped-def]
    """Bake the tile of a node into the atlas, as the tile `index` of it."""
    side = LAYER_SIZE // texels
    frame, stack = np.empty((3, 3), np.float64), np.empty(STACK, np.int32)
    nearest = np.empty((texels, texels))
    sums = np.empty((7 if len(colors) > 0 else 3, texels, texels))
    sum_up(nodes, disc_normals, leaves, triangles, node, stack, frame, nearest, sums)
    layer, row, column = index // side**2, index // side % side * texels, index % side * texels
    tile = normals[layer, row : row + texels, column : column + texels]
    # Without colours the atlas has no layers; any array of its type will do.
    color_layer = colors[layer] if len(colors) > 0 else normals[layer]
    _store(nearest, sums, frame, triangles, tile, color_layer[row : row + texels, column : column + texels])


@nb.njit(cache=True, nogil=True, parallel=True)
def bake_at_once(nodes, disc_normals, leaves, triangles, wanted, first_tile, texels, normals, colors):  # type: ignore[no-untyped-def]
    """Bake tiles on all cores. No other parallel kernel may run meanwhile."""
    for i in nb.prange(len(wanted)):
        _bake(nodes, disc_normals, leaves, triangles, wanted[i], first_tile + i, texels, normals, colors)
