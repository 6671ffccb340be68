// Role: a splat: a rectangle in the plane of its disc. The rasteriser then interpolates the point of the disc and its
//       depth, nothing is lost at the edge of the window, and hardware clips at the near plane.
//       SPRITE: the papers' own primitive instead, a square of pixels around the projected disc; disc_point.glsl
//       intersects every pixel's view ray with it.
// In:   gl_VertexID: four vertices a splat of the cut, in the lowest two bits the corner (SPRITE: one vertex); in_tile,
//       in_spread and in_color, the same for all four; the texture of the cut's records.
// Out:  v_disc, the point in the disc's frame, its rim the unit circle (SPRITE: what disc_point.glsl needs instead); in
//       the attribute pass the frame, the tile, and what colours and overlays need.
// Source: Holst and Schumann 2007, eq. 4-6, 9 and 11; quads in object space after Ren et al. 2002. VISIBILITY pushes the
//       splat back along the view rays by an epsilon tied to the disc's own size (Botsch et al. 2005).
#include "frame.glsl"
#include "splat_record.glsl"
#include "project.glsl"

uniform mat4 eye_from_model;
uniform int silhouette_splats;  // the first ones are on the silhouette
uniform float sink;             // times thickness: how far those are lowered
uniform float focal;            // pixels of a unit length at unit distance; PARALLEL: at any
uniform float grow;             // pixels by which the discs of the others are widened
uniform float smallest;         // radius in pixels
uniform vec2 margin;            // pixels, times thickness: by which the rectangles are

#ifdef SPRITE
flat out vec3 v_centre;
flat out float v_radius;
flat out vec4 v_clip;    // of the centre
flat out float v_push;   // in depth
flat out vec3 v_plane;   // the normal of what is drawn
#else
out vec2 v_disc;
#endif
#ifdef VISIBILITY
uniform vec2 epsilon;  // times thickness, times radius
#endif
#if defined(SPRITE) || !defined(VISIBILITY)
flat out vec3 v_o1;
flat out vec3 v_o2;
#endif
#ifndef VISIBILITY
flat out vec3 v_normal;
flat out float v_facing;  // 1: the disc faces the eye, 0: it faces away
#endif
#ifdef NORMAL_MAPPING
in int in_tile;
in vec4 in_spread;
flat out vec4 v_spread;  // low and width of the normals: texel t stands for low + t width
flat out vec3 v_tile;  // of tile_at; layer -1: no tile
flat out vec2 v_reach;
#include "tile_place.glsl"
#endif
#ifdef COLOR
flat out vec3 v_color;
in vec4 in_color;
#endif
#ifdef TINT
flat out vec4 v_tint;
#ifndef SPRITE
out vec2 v_edge;  // -1 and 1 at the rectangle's edges
#endif
uniform bool show_silhouette;
uniform bool show_lod;
#include "tint.glsl"
#endif

// Return the side in pixels of a square around the projection of a disc (eq. 4-6). The nearest point of the disc sets
// the scale, and what perspective shifts the rim by is added: eq. 6 alone cuts tilted discs off.
float sprite_size(vec3 centre, vec3 normal, float radius)
{
    vec3 extents = radius * sqrt(max(1.0 - normal * normal, 0.0));
#ifdef PARALLEL
    return 2.0 * focal * max(extents.x, extents.y) + 1.0;
#else
    float nearest = max(-centre.z - extents.z, max(1e-6 * radius, 1e-30));
    vec2 half_size = extents.xy + abs(centre.xy) / max(abs(centre.z), 1e-30) * extents.z;
    return 2.0 * focal * max(half_size.x, half_size.y) / nearest + 1.0;
#endif
}

void main()
{
#ifdef SPRITE
    int index = gl_VertexID;
#else
    int index = gl_VertexID >> 2;
    int corner = gl_VertexID & 3;
#endif
    Splat splat = fetch_splat(index);
    bool silhouette = index < silhouette_splats;
    if (silhouette) splat.centre -= sink * splat.thickness * splat.normal;
    vec3 centre = (eye_from_model * vec4(splat.centre, 1.0)).xyz;
#ifdef PARALLEL
    float pixel = 1.0 / focal;
#else
    float pixel = max(-centre.z, 0.0) / focal;
#endif
    // What is far away must not fall between the pixels.
    float radius = max(splat.radius + (silhouette ? 0.0 : grow * pixel), smallest * pixel);
    mat3 rotation = mat3(eye_from_model);
    vec3 o1, o2, plane = splat.normal;
    tangents(splat.normal, o1, o2);
    // Nor what is small and seen edge-on: below the size of a pixel a disc faces the eye, whole and without a tile. So
    // does one without a normal.
    bool turned = splat.radius < smallest * pixel || dot(splat.normal, splat.normal) < 0.5;
    if (turned) {
        mat3 axes = transpose(rotation);
        o1 = axes[0];
        o2 = axes[1];
        plane = axes[2];
    }
#ifdef VISIBILITY
    float push = epsilon.x * splat.thickness + epsilon.y * max(splat.radius, smallest * pixel);
#ifdef PARALLEL
    float by = push;
#else
    // All of the disc by the same factor: a push by a length along each ray would bend it.
    float by = push / max(max(length(centre), push), 1e-30);
#endif
    float push_of_depth = depth_push(by);
#else
    const float push_of_depth = 0.0;
#endif

#ifdef SPRITE
    gl_Position = project(splat.centre);
    v_plane = rotation * plane;
    gl_PointSize = sprite_size(centre, v_plane, radius);
    v_centre = centre;
    v_radius = radius;
    v_clip = gl_Position;
    v_push = push_of_depth;
#else
    v_disc = box_corner(splat, corner, (margin.x * pixel + margin.y * splat.thickness) / max(splat.radius, 1e-30));
    if (turned) v_disc = vec2(corner & 1, corner >> 1) * 2.0 - 1.0;
    gl_Position = pushed(project(splat.centre + radius * (v_disc.x * o1 + v_disc.y * o2)), push_of_depth);
#endif
#if defined(SPRITE) || !defined(VISIBILITY)
    v_o1 = rotation * o1;
    v_o2 = rotation * o2;
#endif
#ifndef VISIBILITY
    v_normal = rotation * splat.normal;
    // The eye is on one side of all of the disc's plane.
#ifdef PARALLEL
    v_facing = v_normal.z >= 0.0 ? 1.0 : 0.0;
#else
    v_facing = dot(v_normal, centre) <= 0.0 ? 1.0 : 0.0;
#endif
#endif
#ifdef NORMAL_MAPPING
    v_spread = in_spread;
    v_tile = tile_at(max(in_tile, 0), v_reach);
    if (in_tile < 0 || turned) v_tile.z = -1.0;
#endif
#ifdef COLOR
    v_color = in_color.rgb;
#endif
#ifdef TINT
#ifndef SPRITE
    v_edge = vec2(corner & 1, corner >> 1) * 2.0 - 1.0;
#endif
    v_tint = vec4(0.0);
    if (show_lod) v_tint = vec4(lod_color(splat.radius / max(pixel, 1e-30)), 0.8);
    if (show_silhouette && silhouette) v_tint = SILHOUETTE_TINT;
#endif
}
