// Role: attribute pass of a splat: add its kernel-weighted normal, colour, distance and tint to the sums.
// In:   what disc_point.glsl needs and the flat attributes of splat.vert; the tiles' array textures.
// Out:  the sums of include/accumulate.glsl, blended additively, tested against the depth of the visibility pass.
// Source: Holst and Schumann 2007, eq. 11 (texel) and 14 (kernel); Botsch et al. 2005, section 5.
#include "hemisphere.glsl"
#include "accumulate.glsl"
#include "project.glsl"
#include "axis_distance.glsl"
#include "disc_point.glsl"

#ifndef SPRITE
flat in vec3 v_o1;
flat in vec3 v_o2;
#endif
flat in vec3 v_normal;
flat in float v_facing;
#ifdef NORMAL_MAPPING
flat in vec3 v_tile;
flat in vec2 v_reach;
flat in vec4 v_spread;
uniform sampler2DArray tile_normals;
#ifdef COLOR
uniform sampler2DArray tile_colors;
#endif
#endif
#ifdef COLOR
flat in vec3 v_color;
#endif
#ifdef TINT
flat in vec4 v_tint;
#ifndef SPRITE
in vec2 v_edge;
#endif
uniform bool show_outlines;
#include "tint.glsl"
#endif

void main()
{
    DiscPoint point = disc_point();
    float rho2 = dot(point.at, point.at);
    if (rho2 > 1.0) discard;
    float share = mix(FACING_AWAY, 1.0, v_facing);
    float weight = share * exp(-SHARPNESS * rho2);
    vec3 normal = v_normal;
#ifdef COLOR
    vec3 color = v_color;
#endif
#ifdef NORMAL_MAPPING
    if (v_tile.z >= 0.0) {
        vec3 at = vec3(v_tile.xy + v_reach * point.at, v_tile.z);
        vec3 local = decode_hemisphere(v_spread.xy + v_spread.zw * texture(tile_normals, at).rg);
        normal = normalize(local.x * v_o1 + local.y * v_o2 + local.z * v_normal);
#ifdef COLOR
        // Alpha 0: the texel's line hit nothing.
        vec4 texel = texture(tile_colors, at);
        color = mix(v_color, texel.rgb / max(texel.a, 1.0 / 255.0), texel.a);
#endif
    }
#endif
    sum_normal = vec4(weight * normal, weight);
#ifdef COLOR
    sum_color = vec4(weight * color, weight);
#endif
#ifdef DEPTH
    sum_depth = vec4(weight * point.distance, weight, 0.0, 0.0);
#endif
#ifdef TINT
    bool outline = show_outlines && rho2 > 0.82;
#ifndef SPRITE
    outline = outline || (show_outlines && max(abs(v_edge.x), abs(v_edge.y)) > 0.9);
#endif
    vec4 tint = outline ? OUTLINE_TINT : v_tint;
    // An outline's weight must not fade with the kernel, or no rim would ever show.
    float shown = outline ? share : weight;
    sum_tint = vec4(shown * tint.a * tint.rgb, shown * tint.a);
#endif
}
