// Role: a leaf triangle of a hybrid hierarchy.
// In:   in_position, in_normal (model space). Out: v_normal (eye space).
// Source: DESIGN: leaf triangles are drawn as triangles into the same targets; VISIBILITY pushes them back by about a pixel.
in vec3 in_position;

uniform mat4 eye_from_model;
uniform mat4 clip_from_eye;

#ifdef VISIBILITY
uniform float pixel;  // width of a pixel at unit depth
#else
in vec3 in_normal;
out vec3 v_normal;
#endif

void main()
{
    vec4 eye = eye_from_model * vec4(in_position, 1.0);
#ifdef VISIBILITY
    eye.xyz *= 1.0 + pixel;
#else
    v_normal = mat3(eye_from_model) * in_normal;
#endif
    gl_Position = clip_from_eye * eye;
}
