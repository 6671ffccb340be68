// Role: visibility pass: depth only, of the disc inside its quad.
// In:   v_disc. Out: depth.
// Source: Botsch et al. 2005, section 4 (visibility splatting).
in vec2 v_disc;

void main()
{
    if (dot(v_disc, v_disc) > 1.0) discard;
}
