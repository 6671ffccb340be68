// Role: set the sums of a pixel to zero, and its depth to that of the strips, the far plane. In: nothing. Out: zeros, for
//       as many sums as there are.
// Source: none; a model that fills a third of the picture takes a third of what clearing all of it does.
layout(location = 0) out vec4 out_first;
layout(location = 1) out vec4 out_second;
layout(location = 2) out vec4 out_third;
layout(location = 3) out vec4 out_fourth;

void main() { out_first = out_second = out_third = out_fourth = vec4(0.0); }
