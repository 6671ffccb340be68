// Outputs of the attribute pass, the same for splats and leaf triangles: sums that the resolve pass divides.
layout(location = 0) out vec4 sum_normal;  // weight * eye-space normal, weight
#ifdef COLOR
layout(location = COLOR) out vec4 sum_color;  // weight * linear colour, weight of what is silhouette or outline
#endif
#ifdef DEPTH
layout(location = DEPTH) out vec2 sum_depth;  // weight * distance along the view axis, weight
#endif
