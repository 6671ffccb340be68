// Role: a leaf triangle of a hybrid hierarchy.
// In:   in_position, in_normal (model space), in_color. Out: v_normal (eye space), v_color.
// Source: Holst and Schumann 2007, section 4.2 (hybrid hierarchies). VISIBILITY pushes it back along the view rays by
//       about a pixel: leaf triangles that are drawn are small or near.
#include "project.glsl"

in vec3 in_position;

uniform mat4 eye_from_model;

#ifdef VISIBILITY
uniform float focal;  // pixels of a unit length at unit distance; PARALLEL: at any
#else
in vec3 in_normal;
out vec3 v_normal;
#ifdef COLOR
in vec4 in_color;
out vec3 v_color;
#endif
#endif

void main()
{
    vec3 eye = (eye_from_model * vec4(in_position, 1.0)).xyz;
#ifdef VISIBILITY
    gl_Position = project_pushed(eye, 1.0 / focal);
#else
    gl_Position = project(eye);
    v_normal = mat3(eye_from_model) * in_normal;
#ifdef COLOR
    v_color = in_color.rgb;
#endif
#endif
}
