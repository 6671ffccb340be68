// Role: fetch a splat's record: the GLSL side of the numpy dtype SPLAT, three RGBA32F texels. Rows of RECORD_WIDTH
//       texels fill one layer after the other.
// Source: hierarchy/hierarchy.py and hierarchy/boxes.py.
uniform sampler2DArray splat_records;

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

// rows : of a layer
ivec3 record_texel(int texel, int rows)
{
    int row = texel / RECORD_WIDTH;
    return ivec3(texel - row * RECORD_WIDTH, row % rows, row / rows);
}

Splat fetch_splat(int index)
{
    int texel = 3 * index;
    ivec3 at = record_texel(texel, textureSize(splat_records, 0).y);
    vec4 a = texelFetch(splat_records, at, 0);
    vec4 b = texelFetch(splat_records, at + ivec3(1, 0, 0), 0);
    vec4 box = texelFetch(splat_records, at + ivec3(2, 0, 0), 0);
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
