// Role: between linear light and what the target holds.
// Source: Jimenez, "Next Generation Post Processing in Call of Duty: Advanced Warfare", 2014 (the dither's noise).
vec3 linear_from_srgb(vec3 c) { return pow(c, vec3(2.2)); }

// c to the power of 1 / 2.2 to within 0.53 / 255, from roots, which cost software renderers less: a least-maximum fit.
vec3 srgb_from_linear(vec3 c)
{
    c = clamp(c, 0.0, 1.0);
    vec3 root = sqrt(c);
    return 0.99979262 * root + 0.07240038 * sqrt(root) - 0.07219300 * c;
}

// Half a grey level of interleaved gradient noise, the same in every frame: gradients show no bands.
float dither(vec2 pixel) { return (fract(52.9829189 * fract(dot(pixel, vec2(0.06711056, 0.00583715)))) - 0.5) / 255.0; }
