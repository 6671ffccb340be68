// Role: one splat of the cut as a quad in the disc's own plane, so that texture coordinate and depth come from the
//       rasteriser (no gl_FragDepth, no inverse per pixel, clipping at the near plane for free).
// In:   in_splat, one per instance; gl_VertexID 0..3 is the corner; the record texture.
// Out:  v_disc, the point in the disc's frame, unit circle = rim; in the attribute pass the frame and the tile.
// Source: Holst and Schumann 2007, eq. 9 and 11; quads after Ren et al. 2002. VISIBILITY pushes the quad back along
//       the view ray by an epsilon tied to the disc's own size (Botsch et al. 2005).
#include "frame.glsl"
#include "splat_record.glsl"

in uint in_splat;

uniform mat4 eye_from_model;
uniform mat4 clip_from_eye;

out vec2 v_disc;

#ifdef VISIBILITY
uniform vec2 epsilon;  // times thickness, times radius
#else
flat out vec3 v_o1;
flat out vec3 v_o2;
flat out vec3 v_normal;
flat out vec3 v_tile;  // centre of the tile in texture coordinates, layer; layer -1: no tile
flat out float v_silhouette;
uniform int silhouette_splats;
#ifdef NORMAL_MAPPING
uniform int tile_count;
uniform int tile_texels;
uniform int layer_size;
#endif
#ifdef COLOR
uniform sampler2D splat_colors;
flat out vec3 v_color;
#endif
#ifdef OVERLAY
flat out float v_pixels;  // radius on screen
uniform float focal;
#endif
#endif

void main()
{
    Splat splat = fetch_splat(int(in_splat));
    vec3 o1, o2;
    tangents(splat.normal, o1, o2);
    v_disc = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
    vec3 point = splat.centre + splat.radius * (v_disc.x * o1 + v_disc.y * o2);
    vec4 eye = eye_from_model * vec4(point, 1.0);

#ifdef VISIBILITY
    float push = epsilon.x * splat.thickness + epsilon.y * splat.radius;
    // Every corner by the same factor: a push by a length along each ray would bend the disc.
    vec3 centre = (eye_from_model * vec4(splat.centre, 1.0)).xyz;
    eye.xyz *= 1.0 + push / max(length(centre), push);
#else
    mat3 rotation = mat3(eye_from_model);
    v_o1 = rotation * o1;
    v_o2 = rotation * o2;
    v_normal = rotation * splat.normal;
    v_silhouette = gl_InstanceID < silhouette_splats ? 1.0 : 0.0;
    v_tile = vec3(0.0, 0.0, -1.0);
#ifdef NORMAL_MAPPING
    if (int(in_splat) < tile_count) {
        int side = layer_size / tile_texels;
        int tile = int(in_splat);
        vec2 corner = vec2(tile % side, (tile / side) % side) * float(tile_texels);
        v_tile = vec3((corner + 0.5 * float(tile_texels)) / float(layer_size), float(tile / (side * side)));
    }
#endif
#ifdef COLOR
    ivec2 at = ivec2(int(in_splat) % RECORD_WIDTH, int(in_splat) / RECORD_WIDTH);
    v_color = texelFetch(splat_colors, at, 0).rgb;
#endif
#ifdef OVERLAY
    vec3 middle = (eye_from_model * vec4(splat.centre, 1.0)).xyz;
    v_pixels = splat.radius * focal / max(-middle.z, 1e-20);
#endif
#endif
    gl_Position = clip_from_eye * eye;
}
