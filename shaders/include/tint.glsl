// Role: colours of the overlays, rgb (sRGB) and opacity. Source: none.
const vec4 SILHOUETTE_TINT = vec4(1.0, 0.32, 0.08, 0.75);
const vec4 OUTLINE_TINT = vec4(0.05, 0.06, 0.10, 0.85);
const vec3 TRIANGLE_LOD = vec3(0.72, 0.72, 0.74);

// One hue for each doubling of a splat's radius on screen: blue at 1 px, green at 4, red at 16 and more.
vec3 lod_color(float pixels)
{
    float t = clamp(log2(max(pixels, 1e-6)) / 4.0, 0.0, 1.0);
    vec3 low = mix(vec3(0.15, 0.30, 0.85), vec3(0.20, 0.75, 0.40), clamp(2.0 * t, 0.0, 1.0));
    return mix(low, vec3(0.95, 0.35, 0.15), clamp(2.0 * t - 1.0, 0.0, 1.0));
}
