// Role: orthonormal frame (o1, o2, n) of a surfel: the twin of hierarchy/frames.py, which bakes the tiles with it.
// Source: Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017.
// -2^-100: a GPU may take what lies below 2^-126 for 0.
const float SEAM = -7.888609052210118e-31;

void tangents(vec3 n, out vec3 o1, out vec3 o2)
{
    float s = n.z > SEAM ? 1.0 : -1.0;
    float a = -1.0 / (s + n.z);
    float b = n.x * n.y * a;
    o1 = vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x);
    o2 = vec3(b, s + n.y * n.y * a, -n.y);
}
