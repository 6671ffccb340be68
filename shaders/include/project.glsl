// Role: project a point, and for the visibility pass push it back along its view ray first.
// Source: Botsch et al. 2005, section 4 (visibility splatting by a depth offset along the view rays).
uniform mat4 clip_from_eye;

// A coarse splat must not be pushed beyond the far plane, nor to where the resolve marks cracks: 16 steps of a 24-bit
// depth buffer stay before it.
const float FARTHEST = 1.0 - 16.0 / 16777216.0;

vec4 project(vec3 eye) { return clip_from_eye * vec4(eye, 1.0); }

// factor : what the distance from the eye is multiplied by, at least 1
vec4 project_pushed(vec3 eye, float factor)
{
    vec4 clip = project(eye * factor);
    clip.z = min(clip.z, FARTHEST * clip.w);
    return clip;
}
