// Role: colours of the overlays, rgb (sRGB) and opacity. Source: none.
const vec4 SILHOUETTE_TINT = vec4(1.0, 0.32, 0.08, 0.75);
const vec4 OUTLINE_TINT = vec4(0.05, 0.06, 0.10, 0.85);
const vec3 TRIANGLE_LOD = vec3(0.72, 0.72, 0.74);

// One hue for each doubling of a splat's radius on screen: blue at 1 px, green at 4, red at 16 and more; with yellow
// between, as green and red mix to brown.
vec3 lod_color(float pixels)
{
    const vec3 HUES[5] = vec3[5](
        vec3(0.25, 0.30, 0.75), vec3(0.15, 0.58, 0.72), vec3(0.35, 0.72, 0.38), vec3(0.93, 0.74, 0.25), vec3(0.88, 0.33, 0.20)
    );
    float t = clamp(log2(max(pixels, 1e-6)), 0.0, 3.999);
    int low = int(t);
    return mix(HUES[low], HUES[low + 1], t - float(low));
}
