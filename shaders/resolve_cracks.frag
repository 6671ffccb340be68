// Role: resolve: mark the uncovered pixels that may lie in a crack, in the depth buffer. In: the sums. Out: depth only.
// Source: none; a fixed depth just before the far plane lets the depth test pick these pixels, which software renderers
//         skip by, too.
#include "sums.glsl"

void main()
{
    if (!may_be_crack(ivec2(gl_FragCoord.xy))) discard;
}
