// Role: visibility pass of a leaf triangle: depth only.
void main()
{
}
