// Role: attribute pass of a leaf triangle: it adds what a splat's centre would, with interpolated normal and colour.
// In:   v_normal, v_color. Out: the sums of include/accumulate.glsl.
// Source: Holst and Schumann 2007, section 4.2.
#include "accumulate.glsl"
#include "axis_distance.glsl"

in vec3 v_normal;
#ifdef COLOR
in vec3 v_color;
#endif
#ifdef TINT
uniform int silhouette_triangles;  // the first triangles are on the silhouette
uniform bool show_silhouette;
uniform bool show_lod;
#include "tint.glsl"
#endif

void main()
{
    sum_normal = vec4(normalize(v_normal), 1.0);
#ifdef COLOR
    sum_color = vec4(v_color, 1.0);
#endif
#ifdef DEPTH
    sum_depth = vec4(axis_distance(), 1.0, 0.0, 0.0);
#endif
#ifdef TINT
    vec4 tint = show_lod ? vec4(TRIANGLE_LOD, 0.8) : vec4(0.0);
    if (show_silhouette && gl_PrimitiveID < silhouette_triangles) tint = SILHOUETTE_TINT;
    sum_tint = vec4(tint.a * tint.rgb, tint.a);
#endif
}
