// Role: project a point, and for the visibility pass push it back along its view ray. PARALLEL: all view rays have the
//       direction of the axis; otherwise they meet in the eye.
// Source: Botsch et al. 2005, section 4 (visibility splatting by a depth offset along the view rays).
// The product is made in float64: from far away the depths of eye space lose the model in their rounding.
uniform mat4 clip_from_model;
uniform mat4 clip_from_eye;

// A coarse splat must not be pushed beyond the far plane, nor to where the resolve marks cracks: 16 steps of a 24-bit
// depth buffer stay before it.
const float FARTHEST = 1.0 - 16.0 / 16777216.0;

vec4 project(vec3 model) { return clip_from_model * vec4(model, 1.0); }

// Return by how much a push changes z of clip space, the same all over a primitive, which so keeps plane. x, y and w,
// and with them the pixels that it covers and what is interpolated over them, are to the last bit those of the
// attribute pass: what an edge-on primitive's depth is wrong by, both passes are wrong by.
// by : at least 0, a share of the distance from the eye; PARALLEL: a length.
float depth_push(float by)
{
#ifdef PARALLEL
    return -clip_from_eye[2][2] * by;
#else
    // (a s z + b) / -s z - (a z + b) / -z with s = 1 + by, times w = -z.
    return -clip_from_eye[3][2] * (by / (1.0 + by));
#endif
}

// push : of depth_push. What lies beyond FARTHEST stays where it is, and nothing comes nearer.
vec4 pushed(vec4 clip, float push)
{
    clip.z = max(clip.z, min(clip.z + push, FARTHEST * clip.w));
    return clip;
}
