// Role: the point of its disc that a fragment shows: interpolated over the quad, or, with SPRITE, the intersection of
//       the fragment's view ray with the disc, which also sets the fragment's depth.
// Source: Botsch et al., "Phong Splatting", 2004, eq. 6 (intersection), in place of Holst and Schumann 2007, eq. 7; their
//       eq. 10 is a transpose, since the frame is a rotation. project.glsl and axis_distance.glsl come before it.
struct DiscPoint {
    vec2 at;         // in the disc's frame, its rim the unit circle
    float distance;  // along the view axis
};

#ifdef SPRITE
flat in vec3 v_centre;
flat in float v_radius;
flat in vec4 v_clip;
flat in float v_push;
flat in vec3 v_plane;
flat in vec3 v_o1;
flat in vec3 v_o2;
uniform vec2 picture_size;  // pixels
uniform float focal;        // pixels of a unit length at unit distance; PARALLEL: at any

// All is relative to the centre: what is lost is a share of the disc's size, not of its distance.
DiscPoint disc_point()
{
    const DiscPoint NOWHERE = DiscPoint(vec2(2.0), 0.0);
    vec2 pixels = gl_FragCoord.xy - (0.5 * v_clip.xy / v_clip.w + 0.5) * picture_size;
    vec4 clip = v_clip;
#ifdef PARALLEL
    vec3 across = vec3(pixels / focal, 0.0);
    vec3 offset = vec3(across.xy, -dot(v_plane, across) / v_plane.z);
    clip.z += clip_from_eye[2][2] * offset.z;
    float distance = -v_centre.z - offset.z;
#else
    // From the centre across the axis to the view ray, and from there along it by a share of the way from the eye.
    vec3 across = vec3(pixels * (-v_centre.z / focal), 0.0);
    float height = dot(v_plane, v_centre), slope = height + dot(v_plane, across);
    float along = -dot(v_plane, across) / slope;
    vec3 offset = across + along * (v_centre + across);
    clip.w += along * v_clip.w;
    // a z + b with z and w times 1 + along: b stays.
    clip.z += along * (v_clip.z - clip_from_eye[3][2]);
    float distance = -v_centre.z * (1.0 + along);
#endif
    // Seen edge-on there is no intersection; what lies before the near or beyond the far plane is clipped.
    vec2 at = vec2(dot(v_o1, offset), dot(v_o2, offset)) / v_radius;
    clip = pushed(clip, v_push);
    gl_FragDepth = clamp(0.5 * clip.z / max(clip.w, 1e-30) + 0.5, 0.0, 1.0);
    if (!(dot(at, at) <= 1.0) || !(abs(clip.z) <= clip.w)) return NOWHERE;
    return DiscPoint(at, distance);
}
#else
in vec2 v_disc;

DiscPoint disc_point() { return DiscPoint(v_disc, axis_distance()); }
#endif
