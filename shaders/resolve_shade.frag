// Role: resolve: divide the sums, normalise, light every covered pixel once, and lay the overlays over it.
//       CRACKS: the same for the pixels that resolve_cracks.frag left; those that lie in no crack are discarded.
// In:   v_uv, the sums, the material. Out: sRGB colour.
// Source: Botsch et al. 2005, section 5 (deferred shading).
#include "sums.glsl"
#include "output.glsl"
#include "lighting.glsl"

in vec2 v_uv;

layout(location = 0) out vec4 out_color;

uniform vec2 ray_slope;  // tangents of half the view angles; 0 where the view rays are parallel
uniform vec3 base_color;  // linear
#ifdef COLOR
uniform bool use_colors;
#endif

#ifdef TWO_SIDED
// Turn a normal that faces away. At the outline of a surface seen from its front some do, by a little: turned round they
// would glare, so they are laid across the line of sight instead.
vec3 towards_eye(vec3 n, vec3 ray)
{
    float away = dot(n, ray);
    if (away <= 0.0) return n;
    return away > 0.2 ? -n : normalize(n - away * ray);
}
#endif

vec3 shade(Sums sums)
{
    vec3 ray = normalize(vec3((v_uv * 2.0 - 1.0) * ray_slope, -1.0));
    float norm = length(sums.normal.xyz);
    vec3 n = norm > 0.0 ? sums.normal.xyz / norm : -ray;
#ifdef TWO_SIDED
    n = towards_eye(n, ray);
#endif
    vec3 albedo = base_color;
#ifdef COLOR
    if (use_colors) albedo = linear_from_srgb(sums.color.rgb / sums.color.a);
#endif
    vec3 color = lit(albedo, n, -ray);
#ifdef TINT
    float opacity = clamp(sums.tint.a / sums.normal.w, 0.0, 1.0);
    vec3 tint = linear_from_srgb(sums.tint.rgb / max(sums.tint.a, 1e-6)) * (0.25 + 0.75 * max(dot(n, -ray), 0.0));
    color = mix(color, tint, opacity);
#endif
    return srgb_from_linear(color);
}

void main()
{
    ivec2 at = ivec2(gl_FragCoord.xy);
#ifdef CRACKS
    Sums sums;
    if (!close_crack(at, sums)) discard;
#else
    Sums sums = fetch_sums(at);
    // A fragment that only the visibility pass saw: the depths of the two passes may round apart.
    if (sums.normal.w <= 0.0) sums = Sums(vec4(0.0, 0.0, 1.0, 1.0), vec4(1.0), vec4(1.0), vec4(0.0));
#endif
    out_color = vec4(shade(sums) + dither(gl_FragCoord.xy), 1.0);
}
