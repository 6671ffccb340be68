// Role: project a point, and for the visibility pass push it back along its view ray first. PARALLEL: all view rays have
//       the direction of the axis; otherwise they meet in the eye.
// Source: Botsch et al. 2005, section 4 (visibility splatting by a depth offset along the view rays).
uniform mat4 clip_from_eye;

// A coarse splat must not be pushed beyond the far plane, nor to where the resolve marks cracks: 16 steps of a 24-bit
// depth buffer stay before it.
const float FARTHEST = 1.0 - 16.0 / 16777216.0;

vec4 project(vec3 eye) { return clip_from_eye * vec4(eye, 1.0); }

// Push all of a primitive back alike, which keeps it plane and where it is on the screen. by : at least 0, a share of
// its distance from the eye; PARALLEL: a length.
vec3 push_back(vec3 eye, float by)
{
#ifdef PARALLEL
    return vec3(eye.xy, eye.z - by);
#else
    return eye * (1.0 + by);
#endif
}

vec4 project_pushed(vec3 eye, float by)
{
    vec4 clip = project(push_back(eye, by));
    clip.z = min(clip.z, FARTHEST * clip.w);
    return clip;
}
