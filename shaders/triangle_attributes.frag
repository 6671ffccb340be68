// Role: attribute pass of a leaf triangle: it adds its interpolated normal with the weight of a splat's centre.
#include "accumulate.glsl"

in vec3 v_normal;

void main()
{
    sum_normal = vec4(normalize(v_normal), 1.0);
#ifdef DEPTH
    sum_depth = vec2(1.0 / gl_FragCoord.w, 1.0);
#endif
}
