// Role: attribute pass of a leaf triangle: it adds what a splat's centre would, with interpolated normal and colour.
// In:   v_normal, v_color. Out: the sums of include/accumulate.glsl.
// Source: Holst and Schumann 2007, section 4.2.
#include "accumulate.glsl"
#include "project.glsl"
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
    float weight = gl_FrontFacing ? 1.0 : FACING_AWAY;
    // Normals at the corners may be zero, or cancel between them.
    float norm = length(v_normal);
    sum_normal = vec4(norm > 0.0 ? v_normal * (weight / norm) : vec3(0.0), weight);
#ifdef COLOR
    sum_color = vec4(weight * v_color, weight);
#endif
#ifdef DEPTH
    sum_depth = vec4(weight * axis_distance(), weight, 0.0, 0.0);
#endif
#ifdef TINT
    vec4 tint = show_lod ? vec4(TRIANGLE_LOD, 0.8) : vec4(0.0);
    if (show_silhouette && gl_PrimitiveID < silhouette_triangles) tint = SILHOUETTE_TINT;
    tint.a *= weight;
    sum_tint = vec4(tint.a * tint.rgb, tint.a);
#endif
}
