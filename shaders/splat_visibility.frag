// Role: visibility pass: depth only, of the disc inside its rectangle.
// In:   what disc_point.glsl needs. Out: depth.
// Source: Botsch et al. 2005, section 4 (visibility splatting).
#include "project.glsl"
#include "axis_distance.glsl"
#include "disc_point.glsl"

void main()
{
    vec2 at = disc_point().at;
    if (dot(at, at) > 1.0) discard;
}
