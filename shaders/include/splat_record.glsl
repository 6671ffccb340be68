// Role: fetch a splat's record: the GLSL side of the numpy dtype SPLAT, two RGBA32F texels.
// Source: hierarchy/hierarchy.py.
uniform sampler2D splat_records;

struct Splat {
    vec3 centre;
    float radius;
    vec3 normal;
    float thickness;
};

Splat fetch_splat(int index)
{
    int texel = 2 * index;
    ivec2 at = ivec2(texel % RECORD_WIDTH, texel / RECORD_WIDTH);
    vec4 a = texelFetch(splat_records, at, 0);
    vec4 b = texelFetch(splat_records, at + ivec2(1, 0), 0);
    return Splat(a.xyz, a.w, b.xyz, b.w);
}
