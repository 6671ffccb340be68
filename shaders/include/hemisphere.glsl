// Role: decode a hemi-octahedral normal: the twin of hierarchy/encoding.py.
// Source: Cigolle et al., "A Survey of Efficient Representations for Independent Unit Vectors", JCGT 3(2), 2014.
vec3 decode_hemisphere(vec2 value)
{
    // byte = 128 + 127 e
    vec2 e = value * (255.0 / 127.0) - 128.0 / 127.0;
    vec2 p = 0.5 * vec2(e.x + e.y, e.x - e.y);
    return vec3(p, 1.0 - abs(p.x) - abs(p.y));
}
