// Role: rectangles at a given depth, a strip of rows each, over the columns that something drawn can reach there. A
//       depth test then tells covered pixels from the others, as with fullscreen.vert.
// In:   in_span, the columns of an instance; gl_VertexID 0..3 is the corner. Out: v_uv, 0..1 over the target.
// Source: none; the spans are those of hierarchy/spans.py.
in vec2 in_span;

out vec2 v_uv;

uniform float plane;  // 1: the far plane
uniform vec2 picture_size;  // pixels
uniform float strip;  // rows of a strip

void main()
{
    float column = (gl_VertexID & 1) == 0 ? in_span.x : max(in_span.x, in_span.y);
    float row = min(strip * float(gl_InstanceID + (gl_VertexID >> 1)), picture_size.y);
    v_uv = vec2(column, row) / picture_size;
    gl_Position = vec4(v_uv * 2.0 - 1.0, plane, 1.0);
}
