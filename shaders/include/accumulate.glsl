// Role: outputs of the attribute pass, the same for splats and leaf triangles: sums that the resolve divides by the
//       weights. Source: Botsch et al. 2005, section 5.
layout(location = 0) out vec4 sum_normal;  // weight * eye-space normal, weight
#ifdef COLOR
layout(location = COLOR) out vec4 sum_color;  // weight * colour, weight
#endif
#ifdef DEPTH
layout(location = DEPTH) out vec4 sum_depth;  // weight * distance along the view axis, weight
#endif
#ifdef TINT
layout(location = TINT) out vec4 sum_tint;  // weight * opacity * colour, weight * opacity
#endif
