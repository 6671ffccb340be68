"""The built-in model: a meteoroid, a lumpy sphere with craters and rough rock, the same on every machine.

Holst and Schumann, Normal Mapping for Surfel-Based Rendering, 2007, show one in figure 8. The surface is a height over
the unit sphere, p(d) = h(d) d, so that its normals come from the height itself and not from the triangles.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from hierarchy.geodesic_sphere import geodesic_sphere
from hierarchy.model import Float64Array, Mesh
from hierarchy.noise import noise

SEED = 2007

# Half axes of the lump that everything is added to.
HALF_AXES = (1.0, 0.88, 0.8)

# Craters: how many, and the range of their radii in radians. The number above a radius falls with its power -1.8,
# near what is counted on small bodies.
CRATERS = 420
CRATER_RADII = (0.04, 0.5)
CRATER_POWER = 1.7

# Roughness: the first octave's frequency and height, the gain from one octave to the next. The last octave is the
# finest that the triangles still carry, four edges a wave.
ROUGH_FREQUENCY = 2.5
ROUGH_HEIGHT = 0.05
ROUGH_GAIN = 0.54
EDGES_A_WAVE = 4.0

# Step of the differences that give the normals: far below the finest wave, far above the rounding of doubles.
STEP = 1e-5

# Vertices that choose among the craters together; they follow each other on the sphere.
BLOCK = 64
# Radians by which `_height` bends a direction at most: noise is below 1.1, so 1.1 sqrt(3) (0.035 + 0.007) = 0.08.
MOST_BEND = 0.1


def make_meteoroid(triangles: int = 300_000, *, detail_of: int | None = None) -> Mesh:
    """Make a meteoroid of about `triangles` triangles and a radius of about 1; closed, with exact normals.

    detail_of : the roughness is the one of a meteoroid of so many triangles, so that the surface stays the same while
        `triangles` changes; None: as fine as `triangles` carry
    Raises ValueError where `triangles` is below 20 or beyond what 32-bit indices hold.
    """
    if not 20 <= triangles <= 500_000_000:
        raise ValueError("a meteoroid has between 20 and 500 million triangles")
    directions, faces = geodesic_sphere(_frequency(triangles))
    octaves = _octaves(_frequency(triangles if detail_of is None else detail_of))
    positions, normals = _raise_surface(directions, _craters(), octaves)
    origin = 0.5 * (positions.min(axis=0) + positions.max(axis=0))
    return Mesh(
        name="meteoroid",
        origin=origin,
        positions=(positions - origin).astype(np.float32),
        faces=faces,
        normals=normals.astype(np.float32),
        closed=True,
    )


def _frequency(triangles: int) -> int:
    """Return into how many pieces an edge of the icosahedron is cut for about so many triangles."""
    return max(1, round(math.sqrt(triangles / 20.0)))


def _octaves(frequency: int) -> int:
    """Return how many octaves of roughness the triangles carry."""
    # An edge of the icosahedron spans 1.107 radians.
    finest = max(ROUGH_FREQUENCY, frequency / 1.107 / EDGES_A_WAVE)
    return 1 + int(math.log2(finest / ROUGH_FREQUENCY))


def _craters() -> Float64Array:
    """Return centre (unit), cosine of the reach, radius in radians and depth of every crater, (CRATERS, 6)."""
    random = np.random.default_rng(SEED)
    centres = random.normal(size=(CRATERS, 3))
    centres /= np.linalg.norm(centres, axis=1, keepdims=True)
    # Invert the distribution of a truncated power law.
    low, high = (radius**-CRATER_POWER for radius in CRATER_RADII)
    radii = (low + random.random(CRATERS) * (high - low)) ** (-1.0 / CRATER_POWER)
    # Old craters are worn down, and big ones are flatter.
    depths = radii * random.uniform(0.04, 0.26, CRATERS) / (1.0 + 2.0 * radii)
    return np.column_stack([centres, np.cos(np.minimum(1.9 * radii, math.pi)), radii, depths])


@njit(cache=True, nogil=True)
def _crater_height(t: float) -> float:
    """Return the height of a crater of depth 1 at `t` radii from its centre: a floor, a wall and a raised rim."""
    wall = min(max((t - 0.2) / 0.8, 0.0), 1.0)
    bowl = wall * wall * (3.0 - 2.0 * wall) - 1.0
    rim = (t - 1.0) / 0.28
    return bowl + 0.32 * math.exp(-rim * rim)


@njit(cache=True, nogil=True)
def _height(x: float, y: float, z: float, craters: Float64Array, octaves: int) -> float:
    """Return the distance of the surface from the centre in the direction (x, y, z), which is unit."""
    a, b, c = HALF_AXES
    height = 1.0 / math.sqrt((x / a) ** 2 + (y / b) ** 2 + (z / c) ** 2)
    height += 0.16 * noise(1.1 * x + 3.7, 1.1 * y, 1.1 * z, SEED) + 0.07 * noise(
        2.3 * x, 2.3 * y + 1.3, 2.3 * z, SEED + 1
    )

    # Bend the directions a little, so that no crater is a perfect circle.
    wx = x + 0.035 * noise(3.1 * x, 3.1 * y, 3.1 * z, SEED + 2) + 0.007 * noise(13.0 * x, 13.0 * y, 13.0 * z, SEED + 5)
    wy = y + 0.035 * noise(3.1 * x, 3.1 * y, 3.1 * z, SEED + 3) + 0.007 * noise(13.0 * x, 13.0 * y, 13.0 * z, SEED + 6)
    wz = z + 0.035 * noise(3.1 * x, 3.1 * y, 3.1 * z, SEED + 4) + 0.007 * noise(13.0 * x, 13.0 * y, 13.0 * z, SEED + 7)
    length = math.sqrt(wx * wx + wy * wy + wz * wz)
    wx, wy, wz = wx / length, wy / length, wz / length
    for k in range(len(craters)):
        cosine = wx * craters[k, 0] + wy * craters[k, 1] + wz * craters[k, 2]
        if cosine > craters[k, 3]:
            # Half the angle from the chord: exact near the centre, where acos is not.
            dx, dy, dz = wx - craters[k, 0], wy - craters[k, 1], wz - craters[k, 2]
            angle = 2.0 * math.asin(min(0.5 * math.sqrt(dx * dx + dy * dy + dz * dz), 1.0))
            height += craters[k, 5] * _crater_height(angle / craters[k, 4])

    # Ridges where the noise changes sign, rounded so that the surface stays smooth, over a slower roughness.
    frequency, amplitude = ROUGH_FREQUENCY, ROUGH_HEIGHT
    for octave in range(octaves):
        n = noise(frequency * x, frequency * y, frequency * z, SEED + 10 + octave)
        ridge = 0.5 - math.sqrt(n * n + 0.01)
        height += amplitude * (0.55 * n + 0.45 * ridge)
        frequency *= 2.0
        amplitude *= ROUGH_GAIN
    return float(height)


@njit(cache=True, nogil=True, parallel=True)
def _raise_surface(directions: Float64Array, craters: Float64Array, octaves: int) -> tuple[Float64Array, Float64Array]:
    """Return positions and unit normals over unit directions, (V, 3) each.

    With p(d) = h(d) d the normal is along d - grad h / h, where the gradient is the one along the sphere.
    """
    positions = np.empty_like(directions)
    normals = np.empty_like(directions)
    for block in prange((len(directions) + BLOCK - 1) // BLOCK):
        begin, end = block * BLOCK, min((block + 1) * BLOCK, len(directions))
        near = _craters_near(directions[begin:end], craters)
        for v in range(begin, end):
            _raise_vertex(directions, v, near, octaves, positions, normals)
    return positions, normals


@njit(cache=True, nogil=True)
def _craters_near(directions: Float64Array, craters: Float64Array) -> Float64Array:
    """Return the craters whose reach can meet the bent directions, in the same order."""
    middle = len(directions) // 2
    x, y, z = directions[middle, 0], directions[middle, 1], directions[middle, 2]
    chord2 = 0.0
    for v in range(len(directions)):
        dx, dy, dz = directions[v, 0] - x, directions[v, 1] - y, directions[v, 2] - z
        chord2 = max(chord2, dx * dx + dy * dy + dz * dz)
    around = min(2.0 * math.asin(min(0.5 * math.sqrt(chord2), 1.0)) + MOST_BEND, math.pi)
    sine, cosine = math.sin(around), math.cos(around)
    kept = np.empty_like(craters)
    count = 0
    for k in range(len(craters)):
        # Compare with the cosine of the sum of both angles, which may exceed 180 degrees.
        reach = craters[k, 3]
        limit = cosine * reach - sine * math.sqrt(max(1.0 - reach * reach, 0.0))
        if reach <= -cosine or x * craters[k, 0] + y * craters[k, 1] + z * craters[k, 2] > limit:
            kept[count] = craters[k]
            count += 1
    return kept[:count]


@njit(cache=True, nogil=True)
def _raise_vertex(
    directions: Float64Array,
    v: int,
    craters: Float64Array,
    octaves: int,
    positions: Float64Array,
    normals: Float64Array,
) -> None:
    """Write the position and the unit normal over one direction."""
    x, y, z = directions[v, 0], directions[v, 1], directions[v, 2]
    # Any two tangents will do (Duff et al., Building an Orthonormal Basis, Revisited, 2017).
    sign = math.copysign(1.0, z)
    f = -1.0 / (sign + z)
    g = x * y * f
    ux, uy, uz = 1.0 + sign * x * x * f, sign * g, -sign * x
    vx, vy, vz = g, sign + y * y * f, -y
    height = _height(x, y, z, craters, octaves)
    s = 1.0 / math.sqrt(1.0 + STEP * STEP)
    across = _height(s * (x + STEP * ux), s * (y + STEP * uy), s * (z + STEP * uz), craters, octaves)
    along = _height(s * (x + STEP * vx), s * (y + STEP * vy), s * (z + STEP * vz), craters, octaves)
    du, dv = (across - height) / (STEP * height), (along - height) / (STEP * height)
    nx, ny, nz = x - du * ux - dv * vx, y - du * uy - dv * vy, z - du * uz - dv * vz
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    normals[v, 0], normals[v, 1], normals[v, 2] = nx / length, ny / length, nz / length
    positions[v, 0], positions[v, 1], positions[v, 2] = height * x, height * y, height * z
