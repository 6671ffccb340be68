// Role: a leaf triangle of a hybrid hierarchy.
// In:   in_position, in_normal (model space), in_color. Out: v_normal (eye space), v_color.
// Source: Holst and Schumann 2007, section 4.2 (hybrid hierarchies). VISIBILITY pushes it back along the view rays by
//       about a pixel: leaf triangles that are drawn are small or near.
#include "project.glsl"

in vec3 in_position;

#ifdef VISIBILITY
uniform float focal;  // pixels of a unit length at unit distance; PARALLEL: at any
#else
uniform mat4 eye_from_model;
in vec3 in_normal;
out vec3 v_normal;
#ifdef COLOR
in vec4 in_color;
out vec3 v_color;
#endif
#endif

void main()
{
    gl_Position = project(in_position);
#ifdef VISIBILITY
    gl_Position = pushed(gl_Position, depth_push(1.0 / focal));
#else
    v_normal = mat3(eye_from_model) * in_normal;
#ifdef COLOR
    v_color = in_color.rgb;
#endif
#endif
}
