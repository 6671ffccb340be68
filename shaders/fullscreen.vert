// Role: one triangle that covers the target at a given depth, so that a depth test against the visible depth tells
//       covered pixels from the background.
// In:   gl_VertexID 0..2. Out: v_uv, 0..1 over the target. Source: none.
out vec2 v_uv;

uniform float plane;  // 1: the far plane

void main()
{
    v_uv = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
    gl_Position = vec4(v_uv * 2.0 - 1.0, plane, 1.0);
}
