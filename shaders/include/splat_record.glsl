// Role: fetch a splat's record: the GLSL side of the numpy dtype SPLAT, three RGBA32F texels,
//       2^ROW_BITS of them to a row.
// Source: hierarchy/hierarchy.py, hierarchy/boxes.py and renderer/cut_buffers.py.
uniform sampler2D splat_records;

struct Splat {
    vec3 centre;
    float radius;
    vec3 normal;
    float thickness;
    vec4 box;  // low and high ends along u, along v, in radii
    int turn;  // of the box's axes, in steps of 90 / TURNS degrees
};

const int TURNS = 8;
const float TURN_STEP = 4.0;

// index : of a splat in the cut
Splat fetch_splat(int index)
{
    ivec2 at = ivec2(3 * (index & ((1 << ROW_BITS) - 1)), index >> ROW_BITS);
    vec4 a = texelFetch(splat_records, at, 0);
    vec4 b = texelFetch(splat_records, at + ivec2(1, 0), 0);
    vec4 box = texelFetch(splat_records, at + ivec2(2, 0), 0);
    float turn = floor(box.w / TURN_STEP + 0.5);
    box.w -= TURN_STEP * turn;
    return Splat(a.xyz, a.w, b.xyz, b.w, box, int(turn));
}

// Return a corner, 0..3, of a splat's box in the disc's frame, moved out by a margin in radii, to the rim at most.
vec2 box_corner(Splat splat, int corner, float margin)
{
    vec2 low = max(splat.box.xz - margin, -1.0);
    vec2 high = min(splat.box.yw + margin, 1.0);
    vec2 at = mix(low, high, vec2(corner & 1, corner >> 1));
    float angle = 1.5707963267948966 * float(splat.turn) / float(TURNS);
    float c = cos(angle), s = sin(angle);
    return vec2(c * at.x - s * at.y, s * at.x + c * at.y);
}
