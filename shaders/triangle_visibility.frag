// Role: visibility pass of a leaf triangle: depth only. In, out: nothing.
// Source: Botsch et al. 2005, section 4.
void main()
{
}
