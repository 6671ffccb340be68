// Role: where a tile lies in the tiles' array textures: the twin of renderer/tile_places.py.
// Source: Holst and Schumann 2007, eq. 11 (texels of a tile).
uniform int tile_texels;  // along one side of the tiles whose place names no other number (w_s)
const vec2 LAYER_SIZE = vec2(32.0, 4096.0);  // texels

// Return the tile's centre in texture coordinates, and its layer. place : not below 0
// reach : how far it reaches from its centre to that of its first and last texels, in texture coordinates
vec3 tile_at(int place, out vec2 reach)
{
    int power = (place >> 28) & 7;
    int texels = power == 0 ? tile_texels : 1 << power;
    vec2 corner = vec2(place & 31, (place >> 5) & 4095);
    float half_size = 0.5 * float(texels);
    reach = (half_size - 0.5) / LAYER_SIZE;
    return vec3((corner + half_size) / LAYER_SIZE, float((place >> 17) & 2047));
}
