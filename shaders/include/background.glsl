// Role: what is behind the model: a vertical gradient, and a floor with a soft shadow where it is switched on. sRGB.
// Source: none.
uniform vec3 background_top;
uniform vec3 background_bottom;
#ifdef GROUND
uniform vec4 ground_plane;     // eye space, n.p = d
uniform vec3 ground_centre;    // eye space, the point of the plane below the model's centre
uniform float ground_radius;   // the model's
#endif

// start : eye space, where the view ray starts
vec3 background(vec3 start, vec3 ray, float height)
{
    vec3 color = mix(background_bottom, background_top, smoothstep(0.0, 1.0, height));
#ifdef GROUND
    // The floor shows from above only.
    float along = dot(ground_plane.xyz, ray);
    if (along >= 0.0) return color;
    float height_below = ground_plane.w - dot(ground_plane.xyz, start);
    float distance = length(start + ray * (height_below / along) - ground_centre) / ground_radius;
    float fade = exp(-0.12 * distance * distance);
    color += 0.10 * fade;
    color *= 1.0 - 0.62 * exp(-1.8 * distance * distance);
#endif
    return color;
}
