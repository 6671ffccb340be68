// Role: what is behind the model: a vertical gradient, and a floor with a soft shadow where it is switched on. sRGB.
// Source: none.
uniform vec3 background_top;
uniform vec3 background_bottom;
#ifdef GROUND
uniform vec4 ground_plane;     // eye space, n.p = d
uniform vec3 ground_centre;    // eye space, the point of the plane below the model's centre
uniform float ground_radius;   // the model's
#endif

vec3 background(vec3 ray, float height)
{
    vec3 color = mix(background_bottom, background_top, smoothstep(0.0, 1.0, height));
#ifdef GROUND
    // The floor shows from above only: n.ray < 0 there, and the plane lies below the eye.
    float along = dot(ground_plane.xyz, ray);
    if (ground_plane.w >= 0.0 || along >= 0.0) return color;
    float distance = length(ray * (ground_plane.w / along) - ground_centre) / ground_radius;
    float fade = exp(-0.12 * distance * distance);
    color += 0.10 * fade;
    color *= 1.0 - 0.62 * exp(-1.8 * distance * distance);
#endif
    return color;
}
