// Role: the distance of a fragment along the view axis. PARALLEL: from its depth, which then is linear in it.
//       project.glsl comes before it. Source: none.
uniform vec2 clip_planes;  // near, far

float axis_distance()
{
#ifdef PARALLEL
    return (clip_from_eye[3][2] - (2.0 * gl_FragCoord.z - 1.0)) / clip_from_eye[2][2];
#else
    // Over a needle thinner than the rasteriser's grid 1 / w extrapolates to 0 and beyond.
    return clamp(1.0 / gl_FragCoord.w, clip_planes.x, clip_planes.y);
#endif
}
