// Role: resolve: what is seen where nothing is drawn. In: v_uv. Out: sRGB colour.
// Source: none; a gradient, and a floor with a soft shadow.
#include "output.glsl"
#include "background.glsl"

in vec2 v_uv;

layout(location = 0) out vec4 out_color;

uniform vec2 ray_slope;  // tangents of half the view angles

void main()
{
    vec3 ray = normalize(vec3((v_uv * 2.0 - 1.0) * ray_slope, -1.0));
    out_color = vec4(background(ray, v_uv.y) + dither(gl_FragCoord.xy), 1.0);
}
