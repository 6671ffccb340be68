// Role: light a point: Blinn-Phong of a headlight and a key light that is fixed to the eye, or a matcap. Linear colours.
// Source: Blinn, "Models of Light Reflection for Computer Synthesized Pictures", 1977.
const vec3 KEY_DIRECTION = vec3(-0.48, 0.64, 0.60);  // over the left shoulder
const vec3 HEADLIGHT = vec3(0.24);
const vec3 KEY_LIGHT = vec3(0.80, 0.77, 0.71);
const vec3 RIM_DIRECTION = vec3(0.836, 0.243, -0.492);  // from behind on the right: parts the dark side from the ground
const vec3 RIM_LIGHT = vec3(0.14, 0.17, 0.23);
const vec3 SKY = vec3(0.085, 0.095, 0.115);
const vec3 FLOOR = vec3(0.050, 0.045, 0.040);
const float SPECULAR = 0.12;

#ifdef MATCAP
uniform sampler2D matcap;
#endif

// The highlight's shape, a cosine to the power of 36, of the cosine's square.
float shine(float x2)
{
    float x4 = x2 * x2, x8 = x4 * x4, x16 = x8 * x8;
    return x16 * x16 * x4;
}

vec3 blinn_phong(vec3 albedo, vec3 n, vec3 to_eye, vec3 to_light, vec3 light)
{
    float along = dot(n, to_light);
    // With the halfway vector, the sum of both directions over its length.
    float both = max(dot(n, to_eye) + along, 0.0);
    float square = both * both / (2.0 + 2.0 * dot(to_eye, to_light));
    return light * (albedo * max(along, 0.0) + SPECULAR * shine(square));
}

vec3 lit(vec3 albedo, vec3 n, vec3 to_eye)
{
#ifdef MATCAP
    // Alpha is how much of it is highlight, which keeps its colour on a coloured model.
    vec4 light = texture(matcap, 0.5 + 0.495 * n.xy);
    return light.rgb * albedo + light.a * (1.0 - albedo);
#else
    vec3 color = albedo * mix(FLOOR, SKY, 0.5 + 0.5 * n.y);
    // Not on what is seen from behind, the inside of an open model.
    float rim = max(dot(n, RIM_DIRECTION), 0.0) * clamp(1.0 + 2.0 * dot(n, to_eye), 0.0, 1.0);
    color += albedo * rim * RIM_LIGHT;
    // Of a light at the eye the halfway vector is the direction to both.
    float straight = max(dot(n, to_eye), 0.0);
    color += HEADLIGHT * (albedo * straight + SPECULAR * shine(straight * straight));
    return color + blinn_phong(albedo, n, to_eye, KEY_DIRECTION, KEY_LIGHT);
#endif
}
