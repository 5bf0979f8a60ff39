// Effort high: a quadratic surface through the surroundings of a vertex.
//
// In a frame of the ring's normal, the heights of the points are fitted by a quadratic polynomial in the two tangential
// coordinates, weighted by distance, known vertices twice: normal equations, slightly damped. Only where the surface
// passes the middle of the cell is wanted, its height and its slope, so the three curvatures are eliminated as a block
// (Schur complement) and what is left is solved by Cramer's rule: two divisions.
#pragma once

#include "diff/surroundings.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// Points, with 1 more than whether they are known in the fourth lane; with room for four more.
struct Patch {
    F32x4 points[2 * RING_ROOM + 4];
    int count = 0;
    MESHTIDE_INLINE void add(F32x4 offset) { points[count++] = offset + F32x4{0, 0, 0, 1}; }
};

struct Surface {
    F32x4 normal = {}; // of length 1
    float height = 0;  // over the cell's middle, along it
};

struct Rows3 {
    F32x4 a, b, c;
};
// The inverse's rows, for a symmetric matrix: cross products over the determinant.
MESHTIDE_INLINE Rows3 inverse(const Rows3& m) {
    F32x4 p = cross3(m.b, m.c), q = cross3(m.c, m.a), r = cross3(m.a, m.b);
    float scale = 1 / dot3(m.a, p);
    return {p * scale, q * scale, r * scale};
}
template <int lane>
MESHTIDE_INLINE F32x4 spread_of(F32x4 a) {
    return __builtin_shufflevector(a, a, lane, lane, lane, lane);
}
// a's row times the matrix.
MESHTIDE_INLINE F32x4 product(F32x4 a, const Rows3& m) {
    return spread_of<0>(a) * m.a + spread_of<1>(a) * m.b + spread_of<2>(a) * m.c;
}

// Sums over four points each, as one row.
MESHTIDE_INLINE F32x4 totals(F32x4 a, F32x4 b, F32x4 c, F32x4 d) {
    transpose(a, b, c, d);
    return (a + b) + (c + d);
}

MESHTIDE_INLINE Surface fit_surface(Patch& patch, F32x4 normal, float scale) {
    for (int i = 0; i < 3; i++) patch.points[patch.count + i] = splat(0);
    // T. Duff et al., "Building an orthonormal basis, revisited", JCGT 6(1), 2017.
    float sign = normal[2] < 0 ? -1.0f : 1.0f, a = -1 / (sign + normal[2]), b = normal[0] * normal[1] * a;
    F32x4 first = {1 + sign * normal[0] * normal[0] * a, sign * b, -sign * normal[0], 0};
    F32x4 second = {b, sign + normal[1] * normal[1] * a, -normal[1], 0};
    float per_scale = 1 / scale;
    F32x4 p = first * per_scale, q = second * per_scale, n = normal * per_scale;

    F32x4 m00 = {}, m10 = {}, m01 = {}, m20 = {}, m11 = {}, m02 = {}, m30 = {}, m21 = {}, m12 = {}, m03 = {};
    F32x4 m40 = {}, m31 = {}, m22 = {}, m13 = {}, m04 = {}, h00 = {}, h10 = {}, h01 = {}, h20 = {}, h11 = {}, h02 = {};
    for (int i = 0; i < patch.count; i += 4) {
        F32x4 x = patch.points[i], y = patch.points[i + 1], z = patch.points[i + 2], w = patch.points[i + 3];
        transpose(x, y, z, w);
        F32x4 u = x * spread_of<0>(p) + y * spread_of<1>(p) + z * spread_of<2>(p);
        F32x4 v = x * spread_of<0>(q) + y * spread_of<1>(q) + z * spread_of<2>(q);
        F32x4 h = x * spread_of<0>(n) + y * spread_of<1>(n) + z * spread_of<2>(n);
        F32x4 uu = u * u, uv = u * v, vv = v * v, near = uu + vv + 0.25f;
        w = w / (near * near);
        F32x4 wu = w * u, wv = w * v, wuu = w * uu, wuv = w * uv, wvv = w * vv;
        m00 += w, m10 += wu, m01 += wv, m20 += wuu, m11 += wuv, m02 += wvv;
        m30 += wuu * u, m21 += wuu * v, m12 += wuv * v, m03 += wvv * v;
        m40 += wuu * uu, m31 += wuu * uv, m22 += wuu * vv, m13 += wuv * vv, m04 += wvv * vv;
        h00 += w * h, h10 += wu * h, h01 += wv * h, h20 += wuu * h, h11 += wuv * h, h02 += wvv * h;
    }
    // Rows of (1, u, v) and of (u u, u v, v v) against the latter; the fourth lane: against the heights.
    Rows3 mixed = {totals(m20, m11, m02, h00), totals(m30, m21, m12, h10), totals(m21, m12, m03, h01)};
    Rows3 curved = {totals(m40, m31, m22, h20), totals(m31, m22, m13, h11), totals(m22, m13, m04, h02)};
    F32x4 weights = totals(m00, m10, m01, splat(0));
    float damping = 0.01f * weights[0], slope_damping = 0.001f * weights[0];
    Rows3 flat = {F32x4{weights[0], weights[1], weights[2], 0},
                  F32x4{weights[1], mixed.a[0] + slope_damping, mixed.a[1], 0},
                  F32x4{weights[2], mixed.a[1], mixed.a[2] + slope_damping, 0}};
    Rows3 damped = {curved.a + F32x4{damping, 0, 0, 0}, curved.b + F32x4{0, damping, 0, 0},
                    curved.c + F32x4{0, 0, damping, 0}};
    Rows3 straight = inverse(damped);
    Rows3 factors = {product(mixed.a, straight), product(mixed.b, straight), product(mixed.c, straight)};
    // What is left for (1, u, v), and for the heights.
    Rows3 columns = {product(factors.a, {mixed.a, mixed.b, mixed.c}), {}, {}};
    (void)columns;
    F32x4 ma = mixed.a, mb = mixed.b, mc = mixed.c, md = splat(0);
    transpose(ma, mb, mc, md); // ma: entries (a0, b0, c0), ...
    Rows3 across = {ma, mb, mc};
    Rows3 left = {flat.a - product(factors.a, across), flat.b - product(factors.b, across),
                  flat.c - product(factors.c, across)};
    F32x4 curved_heights = {curved.a[3], curved.b[3], curved.c[3], 0};
    F32x4 heights = {mixed.a[3] - dot3(factors.a, curved_heights), mixed.b[3] - dot3(factors.b, curved_heights),
                     mixed.c[3] - dot3(factors.c, curved_heights), 0};
    F32x4 solution = product(heights, inverse(left));
    // Also where nothing could be solved: of what is no number, the bound is taken.
    solution = greatest(least(solution, F32x4{8, 1, 1, 0}), F32x4{-8, -1, -1, 0});
    F32x4 tilted = normal - first * spread_of<1>(solution) - second * spread_of<2>(solution);
    float shorter = 1 / __builtin_sqrtf(dot3(tilted, tilted));
    return {tilted * shorter, solution[0] * scale * shorter};
}

// Midpoints of any two of the first members.
constexpr int PAIR_LIMIT = 10;
MESHTIDE_INLINE Expert guess_pairs(const Offsets& ring) {
    int count = ring.count < PAIR_LIMIT ? ring.count : PAIR_LIMIT;
    if (count < 2) return {splat(0), 0};
    F32x4 list[PAIR_LIMIT * (PAIR_LIMIT - 1) / 2 + 3];
    int guesses = 0;
    for (int i = 0; i < count; i++)
        for (int j = i + 1; j < count; j++) list[guesses++] = (ring[i] + ring[j]) * 0.5f;
    for (int i = 0; i < 3; i++) list[guesses + i] = F32x4{1e6f, 1e6f, 1e6f, 0};
    Tally tally;
    for (int i = 0; i < guesses; i += 4) {
        F32x4 x = list[i], y = list[i + 1], z = list[i + 2], known = list[i + 3];
        transpose(x, y, z, known);
        tally.add(x, y, z, splat(5) - known * 4.0f);
    }
    return tally.conclude();
}

} // namespace meshtide::inline MESHTIDE_ISA
