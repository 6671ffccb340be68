// Role: resolve: what is seen where nothing is drawn. In: v_uv. Out: sRGB colour.
// Source: none; a gradient, and a floor with a soft shadow.
#include "output.glsl"
#include "background.glsl"

in vec2 v_uv;

layout(location = 0) out vec4 out_color;

uniform vec2 ray_slope;  // tangents of half the view angles; 0 where the view rays are parallel
uniform vec2 ray_start;  // half the extent of what is seen where they are parallel; 0 where they meet in the eye

void main()
{
    vec2 at = v_uv * 2.0 - 1.0;
    vec3 ray = normalize(vec3(at * ray_slope, -1.0));
    out_color = vec4(background(vec3(at * ray_start, 0.0), ray, v_uv.y) + dither(gl_FragCoord.xy), 1.0);
}
