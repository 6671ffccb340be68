// Role: where a tile lies in the tiles' array textures: the twin of renderer/tile_places.py.
// Source: Holst and Schumann 2007, eq. 11 (texels of a tile).
uniform int tile_texels;  // along one side of the tiles whose place names no other number (w_s)
uniform int layer_size;   // texels along one side of a layer

// Return the tile's centre in texture coordinates, its layer, and how far it reaches from the centre of its first texel
// to that of its last, halved, in texture coordinates. place : not below 0
vec4 tile_at(int place)
{
    int power = (place >> 28) & 7;
    int texels = power == 0 ? tile_texels : 1 << power;
    vec2 corner = vec2(place & 1023, (place >> 10) & 1023);
    float half_size = 0.5 * float(texels);
    return vec4((corner + half_size) / float(layer_size), float((place >> 20) & 255), (half_size - 0.5) / float(layer_size));
}
