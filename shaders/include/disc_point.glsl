// Role: the point of its disc that a fragment shows: interpolated over the quad, or, with SPRITE, the intersection of
//       the fragment's view ray with the disc, which also sets the fragment's depth.
// Source: Botsch et al., "Phong Splatting", 2004, eq. 6 (intersection), in place of Holst and Schumann 2007, eq. 7; their
//       eq. 10 is a transpose, since the frame is a rotation.
struct DiscPoint {
    vec2 at;         // in the disc's frame, its rim the unit circle
    float distance;  // along the view axis
};

#ifdef SPRITE
flat in vec3 v_centre;
flat in float v_radius;
flat in vec3 v_o1;
flat in vec3 v_o2;
flat in vec3 v_normal;
uniform vec2 picture_size;  // pixels

DiscPoint disc_point()
{
    vec2 ndc = 2.0 * gl_FragCoord.xy / picture_size - 1.0;
    vec3 ray = vec3(ndc.x / clip_from_eye[0][0], ndc.y / clip_from_eye[1][1], -1.0);
#ifdef PARALLEL
    vec3 start = vec3(ray.xy, 0.0);
    ray = vec3(0.0, 0.0, -1.0);
    float slope = dot(v_normal, ray);
    float along = dot(v_normal, v_centre - start) / slope;
#else
    float slope = dot(v_normal, ray);
    float along = dot(v_normal, v_centre) / slope;
#endif
    // Seen edge-on there is no intersection: outside of the rim.
    if (!(along > 0.0) || isinf(along)) along = 0.0;
#ifdef PARALLEL
    vec3 point = start + along * ray;
#else
    vec3 point = along * ray;
#endif
    vec4 clip = clip_from_eye * vec4(point, 1.0);
    gl_FragDepth = clamp(0.5 * clip.z / max(clip.w, 1e-30) + 0.5, 0.0, 1.0);
    vec3 offset = (point - v_centre) / v_radius;
    return DiscPoint(along > 0.0 ? vec2(dot(v_o1, offset), dot(v_o2, offset)) : vec2(2.0), along);
}
#else
in vec2 v_disc;

DiscPoint disc_point() { return DiscPoint(v_disc, axis_distance()); }
#endif
