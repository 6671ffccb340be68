// Role: read the sums of a pixel and close cracks: the resolve's side of include/accumulate.glsl.
//       Between discs of different heights a view from the side can open a crack of a pixel or three. A pixel that
//       nothing covers, with a covered one beside, above or below it, is in one where both sides are covered within
//       two pixels on all of the four axes, or on three of them and five of its eight neighbours are covered; it takes
//       the sum of what is around it. Texels beyond the edge count as uncovered.
// Source: the reconstruction filter is that of Pfister et al., "Surfels", 2000, section 7.2, made local.
uniform sampler2D sum_normal;
#ifdef COLOR
uniform sampler2D sum_color;
#endif
#ifdef DEPTH
uniform sampler2D sum_depth;
#endif
#ifdef TINT
uniform sampler2D sum_tint;
#endif

struct Sums {
    vec4 normal;
    vec4 color;
    vec4 depth;
    vec4 tint;
};

Sums fetch_sums(ivec2 at)
{
    Sums sums = Sums(texelFetch(sum_normal, at, 0), vec4(0.0), vec4(0.0), vec4(0.0));
#ifdef COLOR
    sums.color = texelFetch(sum_color, at, 0);
#endif
#ifdef DEPTH
    sums.depth = texelFetch(sum_depth, at, 0);
#endif
#ifdef TINT
    sums.tint = texelFetch(sum_tint, at, 0);
#endif
    return sums;
}

void add(inout Sums sums, Sums other)
{
    sums.normal += other.normal;
    sums.color += other.color;
    sums.depth += other.depth;
    sums.tint += other.tint;
}

// texelFetch is undefined beyond the edge.
bool is_inside(ivec2 at)
{
    return all(greaterThanEqual(at, ivec2(0))) && all(lessThan(at, textureSize(sum_normal, 0)));
}

bool is_covered(ivec2 at) { return is_inside(at) && texelFetch(sum_normal, at, 0).w > 0.0; }

// Tell whether an uncovered pixel may lie in a crack: a covered one is next to it, and both sides are covered within two
// pixels across or along the rows, as on one of these axes they are in every crack.
bool may_be_crack(ivec2 at)
{
    bvec4 next = bvec4(is_covered(at - ivec2(1, 0)), is_covered(at + ivec2(1, 0)),
                       is_covered(at - ivec2(0, 1)), is_covered(at + ivec2(0, 1)));
    bvec4 near = bvec4(next.x || is_covered(at - ivec2(2, 0)), next.y || is_covered(at + ivec2(2, 0)),
                       next.z || is_covered(at - ivec2(0, 2)), next.w || is_covered(at + ivec2(0, 2)));
    return any(next) && ((near.x && near.y) || (near.z && near.w));
}

// Tell whether an uncovered pixel that may be in a crack lies in one, and return the sums of the pixels around it.
bool close_crack(ivec2 at, out Sums around)
{
    const ivec2 AXES[4] = ivec2[4](ivec2(1, 0), ivec2(0, 1), ivec2(1, 1), ivec2(1, -1));
    around = Sums(vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0));
    int closed = 0;
    int next = 0;
    for (int axis = 0; axis < 4; ++axis) {
        int sides = 0;
        for (int side = -1; side <= 1; side += 2) {
            ivec2 beside = at + side * AXES[axis];
            if (is_covered(beside)) ++next;
            else beside += side * AXES[axis];
            if (!is_covered(beside)) continue;
            ++sides;
            add(around, fetch_sums(beside));
        }
        if (sides == 2) ++closed;
    }
    return closed == 4 || (closed == 3 && next >= 5);
}
