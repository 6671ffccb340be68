// Role: attribute pass: add the disc's kernel-weighted normal (and colour, and depth) to the targets.
// In:   v_disc and the flat frame and tile; the tiles' array texture.
// Out:  the sums of include/accumulate.glsl, blended additively against the depth of the visibility pass.
// Source: Holst and Schumann 2007, eq. 11 and 14; Botsch et al. 2005, section 5.
#include "hemisphere.glsl"
#include "accumulate.glsl"

in vec2 v_disc;
flat in vec3 v_o1;
flat in vec3 v_o2;
flat in vec3 v_normal;
flat in vec3 v_tile;
flat in float v_silhouette;

#ifdef NORMAL_MAPPING
uniform sampler2DArray tile_normals;
uniform float tile_scale;  // (w_s - 1) / 2 texels in texture coordinates, eq. 11
#endif

void main()
{
    float rho2 = dot(v_disc, v_disc);
    if (rho2 > 1.0) discard;
    float weight = exp(-SHARPNESS * rho2);
    vec3 normal = v_normal;
#ifdef NORMAL_MAPPING
    if (v_tile.z >= 0.0) {
        vec3 at = vec3(v_tile.xy + tile_scale * v_disc, v_tile.z);
        vec3 local = decode_hemisphere(texture(tile_normals, at).rg);
        normal = normalize(local.x * v_o1 + local.y * v_o2 + local.z * v_normal);
    }
#endif
    sum_normal = vec4(weight * normal, weight);
#ifdef DEPTH
    sum_depth = vec2(weight / gl_FragCoord.w, weight);
#endif
}
