// Effort high: what is seen of a wider surroundings, above all a quadratic surface through it.
//
// In a frame of the ring's normal, the heights of the points are fitted by a quadratic polynomial in the two tangential
// coordinates, weighted by distance, known vertices twice: normal equations, slightly damped. Only where the surface
// passes the middle of the cell is wanted, its height and its slope, so the three curvatures are eliminated as a block
// (Schur complement), and what is left is solved by Cramer's rule: two divisions.
#pragma once

#include "diff/surroundings.hpp"

namespace meshtide::inline MESHTIDE_ISA {

struct SurfaceFit {
    F32x4 normal = {}; // of length 1, or 0
    float height = 0;  // over the cell's middle, along the normal
};

struct WideView {
    SurfaceFit surface;
    int surface_class; // how wrong the surfaces of the ring were, as an error class; the last one without a surface
    F32x4 quadric;     // the offset to the surface, along its normal, from Surroundings::smoothed
    Expert pairs;
    I32x4 below, above; // points of the patch with an offset of exactly -1 and 1
};

namespace detail {

struct Rows3 {
    F32x4 a, b, c;
};

// The inverse of a symmetric matrix: cross products of its rows over its determinant.
MESHTIDE_INLINE Rows3 inverse(const Rows3& m) {
    F32x4 p = cross3(m.b, m.c), q = cross3(m.c, m.a), r = cross3(m.a, m.b);
    float scale = 1 / dot3(m.a, p);
    return {p * scale, q * scale, r * scale};
}
MESHTIDE_INLINE F32x4 product(F32x4 row, const Rows3& m) {
    return lane_of<0>(row) * m.a + lane_of<1>(row) * m.b + lane_of<2>(row) * m.c;
}
MESHTIDE_INLINE Rows3 product(const Rows3& m, const Rows3& n) {
    return {product(m.a, n), product(m.b, n), product(m.c, n)};
}
MESHTIDE_INLINE F32x4 fourth_lanes(const Rows3& m) { return F32x4{m.a[3], m.b[3], m.c[3], 0}; }

} // namespace detail

// scale: the length that counts as near.
MESHTIDE_INLINE SurfaceFit fit_surface(Patch& patch, F32x4 normal, float scale) {
    using namespace detail;
    for (int i = 0; i < 3; i++) patch.points[patch.count + i] = splat(0); // without weight
    // T. Duff et al., "Building an orthonormal basis, revisited", JCGT 6 (1), 2017.
    float sign = normal[2] < 0 ? -1.0f : 1.0f, a = -1 / (sign + normal[2]), b = normal[0] * normal[1] * a;
    F32x4 first = {1 + sign * normal[0] * normal[0] * a, sign * b, -sign * normal[0], 0};
    F32x4 second = {b, sign + normal[1] * normal[1] * a, -normal[1], 0};
    F32x4 p = first * (1 / scale), q = second * (1 / scale), n = normal * (1 / scale);

    // Moments: mij is the sum of w u^i v^j, hij that of w h u^i v^j.
    F32x4 m00 = {}, m10 = {}, m01 = {}, m20 = {}, m11 = {}, m02 = {}, m30 = {}, m21 = {}, m12 = {}, m03 = {};
    F32x4 m40 = {}, m31 = {}, m22 = {}, m13 = {}, m04 = {}, h00 = {}, h10 = {}, h01 = {}, h20 = {}, h11 = {}, h02 = {};
    for (int i = 0; i < patch.count; i += 4) {
        F32x4 x = patch.points[i], y = patch.points[i + 1], z = patch.points[i + 2], w = patch.points[i + 3];
        transpose(x, y, z, w);
        F32x4 u = x * lane_of<0>(p) + y * lane_of<1>(p) + z * lane_of<2>(p);
        F32x4 v = x * lane_of<0>(q) + y * lane_of<1>(q) + z * lane_of<2>(q);
        F32x4 h = x * lane_of<0>(n) + y * lane_of<1>(n) + z * lane_of<2>(n);
        F32x4 uu = u * u, uv = u * v, vv = v * v, near = uu + vv + 0.25f;
        w = w / (near * near);
        F32x4 wu = w * u, wv = w * v, wuu = w * uu, wuv = w * uv, wvv = w * vv;
        m00 += w, m10 += wu, m01 += wv, m20 += wuu, m11 += wuv, m02 += wvv;
        m30 += wuu * u, m21 += wuu * v, m12 += wuv * v, m03 += wvv * v;
        m40 += wuu * uu, m31 += wuu * uv, m22 += wuu * vv, m13 += wuv * vv, m04 += wvv * vv;
        h00 += w * h, h10 += wu * h, h01 += wv * h, h20 += wuu * h, h11 += wuv * h, h02 += wvv * h;
    }
    F32x4 weights = totals(m00, m10, m01, splat(0));
    // Of 1, u, v (rows) with u u, u v, v v (columns), and of the latter with each other; the fourth lane: with h.
    Rows3 mixed = {totals(m20, m11, m02, h00), totals(m30, m21, m12, h10), totals(m21, m12, m03, h01)};
    Rows3 curved = {totals(m40, m31, m22, h20), totals(m31, m22, m13, h11), totals(m22, m13, m04, h02)};
    float slope_damping = 0.001f * weights[0], damping = 0.01f * weights[0];
    Rows3 plain = {F32x4{weights[0], weights[1], weights[2], 0},
                   F32x4{weights[1], mixed.a[0] + slope_damping, mixed.a[1], 0},
                   F32x4{weights[2], mixed.a[1], mixed.a[2] + slope_damping, 0}};
    Rows3 damped = {curved.a + F32x4{damping, 0, 0, 0}, curved.b + F32x4{0, damping, 0, 0},
                    curved.c + F32x4{0, 0, damping, 0}};

    Rows3 factors = product(mixed, inverse(damped));
    Rows3 turned = mixed;
    F32x4 none = splat(0), heights = fourth_lanes(mixed), curved_heights = fourth_lanes(curved);
    transpose(turned.a, turned.b, turned.c, none); // columns are rows now
    Rows3 taken = product(factors, turned);
    Rows3 left = {plain.a - taken.a, plain.b - taken.b, plain.c - taken.c};
    heights -=
        F32x4{dot3(factors.a, curved_heights), dot3(factors.b, curved_heights), dot3(factors.c, curved_heights), 0};
    F32x4 solution = product(heights, inverse(left));
    // Where nothing could be solved it is no number; then the bound is taken.
    solution = greatest(least(solution, F32x4{8, 1, 1, 0}), F32x4{-8, -1, -1, 0});
    F32x4 tilted = normal - first * lane_of<1>(solution) - second * lane_of<2>(solution);
    float shorter = 1 / __builtin_sqrtf(dot3(tilted, tilted));
    return {tilted * shorter, solution[0] * scale * shorter};
}

// errors: how far from its surface each vertex was found in this bit plane; negative for those that were not.
MESHTIDE_INLINE void look_wide(const Surroundings& seen, Patch& patch, const DiffRow& own,
                               Span<const DiffNeighbour> neighbours, Span<const float> errors, WideView& wide) {
    wide.pairs = guess_pairs(seen.ring);
    I32x4 below = {}, above = {};
    for (int i = 0; i < patch.count; i++) {
        below -= patch.points[i] == splat(-1);
        above -= patch.points[i] == splat(1);
    }
    wide.below = below, wide.above = above;
    wide.surface = SurfaceFit{};
    wide.surface_class = ERROR_CLASSES - 1;
    if (dot3(seen.normal, seen.normal) > 0) {
        F32x4 squares = {};
        for (int i = 0; i < seen.ring.count; i++) squares += seen.ring[i] * seen.ring[i];
        float square = (squares[0] + squares[1] + squares[2]) / static_cast<float>(seen.ring.count);
        wide.surface = fit_surface(patch, seen.normal, __builtin_sqrtf(square));
        float sum = 0.35f * own.laplacian[3], weight = 0.5f;
        for (DiffNeighbour neighbour : neighbours) {
            float error = errors[static_cast<size_t>(neighbour.member)];
            if (error < 0) continue;
            sum += error;
            weight += 1;
        }
        int c = error_class(sum / weight);
        wide.surface_class = c < ERROR_CLASSES - 2 ? c : ERROR_CLASSES - 2;
    }
    float along = wide.surface.height - dot3(wide.surface.normal, seen.smoothed);
    wide.quadric = seen.smoothed + wide.surface.normal * along;
}

} // namespace meshtide::inline MESHTIDE_ISA
