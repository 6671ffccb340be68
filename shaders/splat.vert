// Role: one splat of the cut as a quad in the disc's own plane, so that texture coordinate and depth come from the
//       rasteriser: no gl_FragDepth, no inverse per pixel, and the hardware clips at the near plane.
// In:   in_splat, one per instance; gl_VertexID 0..3 is the corner; the records' texture.
// Out:  v_disc, the point in the disc's frame, its rim the unit circle; in the attribute pass the frame, the tile,
//       and what colours and overlays need.
// Source: Holst and Schumann 2007, eq. 9 and 11, on quads in object space after Ren et al. 2002. VISIBILITY pushes the
//       quad back along the view rays by an epsilon tied to the disc's own size (Botsch et al. 2005).
#include "frame.glsl"
#include "splat_record.glsl"
#include "project.glsl"

in uint in_splat;

uniform mat4 eye_from_model;
uniform int silhouette_splats;  // the first instances are on the silhouette
uniform float sink;             // times thickness: how far those are lowered
uniform float focal;            // pixels of a unit length at unit distance
uniform float grow;             // pixels by which every disc is widened

out vec2 v_disc;

#ifdef VISIBILITY
uniform vec2 epsilon;  // times thickness, times radius
#else
flat out vec3 v_o1;
flat out vec3 v_o2;
flat out vec3 v_normal;
#ifdef NORMAL_MAPPING
flat out vec3 v_tile;  // centre of the tile in texture coordinates, and its layer; layer -1: no tile
uniform int tile_count;
uniform int tile_texels;
uniform int layer_size;
#endif
#ifdef COLOR
flat out vec3 v_color;
uniform sampler2D splat_colors;
#endif
#ifdef TINT
flat out vec4 v_tint;
uniform bool show_silhouette;
uniform bool show_lod;
#include "tint.glsl"
#endif
#endif

void main()
{
    int index = int(in_splat);
    Splat splat = fetch_splat(index);
    bool silhouette = gl_InstanceID < silhouette_splats;
    if (silhouette) splat.centre -= sink * splat.thickness * splat.normal;
    vec3 centre = (eye_from_model * vec4(splat.centre, 1.0)).xyz;
    float radius = splat.radius + grow * max(-centre.z, 0.0) / focal;
    vec3 o1, o2;
    tangents(splat.normal, o1, o2);
    v_disc = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
    vec3 point = splat.centre + radius * (v_disc.x * o1 + v_disc.y * o2);
    vec3 eye = (eye_from_model * vec4(point, 1.0)).xyz;

#ifdef VISIBILITY
    float push = epsilon.x * splat.thickness + epsilon.y * splat.radius;
    // All corners by the same factor: a push by a length along each ray would bend the disc.
    gl_Position = project_pushed(eye, 1.0 + push / max(length(centre), push));
#else
    gl_Position = project(eye);
    mat3 rotation = mat3(eye_from_model);
    v_o1 = rotation * o1;
    v_o2 = rotation * o2;
    v_normal = rotation * splat.normal;
#ifdef NORMAL_MAPPING
    v_tile = vec3(0.0, 0.0, -1.0);
    if (index < tile_count) {
        int side = layer_size / tile_texels;
        vec2 corner = vec2(index % side, (index / side) % side) * float(tile_texels);
        v_tile = vec3((corner + 0.5 * float(tile_texels)) / float(layer_size), float(index / (side * side)));
    }
#endif
#ifdef COLOR
    v_color = texelFetch(splat_colors, ivec2(index % RECORD_WIDTH, index / RECORD_WIDTH), 0).rgb;
#endif
#ifdef TINT
    v_tint = vec4(0.0);
    if (show_lod) v_tint = vec4(lod_color(splat.radius * focal / max(-centre.z, 1e-30)), 0.8);
    if (show_silhouette && silhouette) v_tint = SILHOUETTE_TINT;
#endif
#endif
}
