// Role: one triangle that covers the target. In: gl_VertexID 0..2. Out: v_uv, 0..1 over the target.
out vec2 v_uv;

void main()
{
    v_uv = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
    gl_Position = vec4(v_uv * 2.0 - 1.0, 0.0, 1.0);
}
