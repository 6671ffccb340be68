// Role: decode a hemi-octahedral normal: the twin of hierarchy/encoding.py.
// Source: Cigolle et al., "A Survey of Efficient Representations for Independent Unit Vectors", JCGT 3(2), 2014.
vec3 decode_hemisphere(vec2 value)
{
    // byte = 128 + 127 e
    vec2 e = value * (255.0 / 127.0) - 128.0 / 127.0;
    vec2 p = 0.5 * vec2(e.x + e.y, e.x - e.y);
    return vec3(p, 1.0 - abs(p.x) - abs(p.y));
}

// Return about 1 / length(n) of what the above returns, whose square lies between 1/3 and 1: within 1.3%, the least
// maximum of a parabola. Software renderers wait long for a root and a division.
float inverse_length(vec3 n)
{
    float square = dot(n, n);
    return 2.4791283 + square * (1.2576485 * square - 2.7244582);
}
