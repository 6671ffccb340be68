// Role: resolve the sums into arrays. In: the sums. Out: unit eye-space normal and coverage; distance along the view axis.
// Source: Botsch et al. 2005, section 5 (normalisation).
#include "sums.glsl"

layout(location = 0) out vec4 out_normal;
layout(location = 1) out float out_depth;

void main()
{
    ivec2 at = ivec2(gl_FragCoord.xy);
    Sums sums = fetch_sums(at);
    Sums around;
    if (sums.normal.w <= 0.0 && may_be_crack(at) && close_crack(at, around)) sums = around;
    bool drawn = sums.normal.w > 0.0;
    float norm = length(sums.normal.xyz);
    out_normal = drawn ? vec4(norm > 0.0 ? sums.normal.xyz / norm : vec3(0.0, 0.0, 1.0), 1.0) : vec4(0.0);
    out_depth = drawn ? sums.depth.x / sums.depth.y : 0.0;
}
