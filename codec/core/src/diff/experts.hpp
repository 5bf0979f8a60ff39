// Guesses where a vertex lies, each made of a few others, and experts, which are many guesses of one kind.
//
// All offsets are in half cells of the depth that is coded, x, y, z in lanes, from the middle of the cell that the
// vertex is known to be in, four of them wide: its bits will move it by +1 or -1 along each axis. The fourth lane of an
// offset to a vertex is 1 if that vertex is known at this depth, else 0; that of a guess says how many of its vertices
// are.
#pragma once

#include "diff/slice.hpp"

namespace meshtide::inline MESHTIDE_ISA {

constexpr int RING_ROOM = RING_LIMIT + 1;

// The offsets of a ring.
struct Offsets {
    int count;
    bool closed;
    F32x4 room[RING_ROOM + 2]; // and of the member before the first, and after the last
    MESHTIDE_INLINE const F32x4& operator[](int i) const { return room[i + 1]; }
};

MESHTIDE_INLINE void transpose(F32x4& a, F32x4& b, F32x4& c, F32x4& d) {
    F32x4 p = __builtin_shufflevector(a, b, 0, 4, 1, 5), q = __builtin_shufflevector(c, d, 0, 4, 1, 5);
    F32x4 r = __builtin_shufflevector(a, b, 2, 6, 3, 7), s = __builtin_shufflevector(c, d, 2, 6, 3, 7);
    a = __builtin_shufflevector(p, q, 0, 1, 4, 5);
    b = __builtin_shufflevector(p, q, 2, 3, 6, 7);
    c = __builtin_shufflevector(r, s, 0, 1, 4, 5);
    d = __builtin_shufflevector(r, s, 2, 3, 6, 7);
}

// The fourth lane negated: it adds up in differences, too.
MESHTIDE_INLINE F32x4 inverted(F32x4 offset) { return offset * F32x4{1, 1, 1, -1}; }

// The sum of each one's lanes, in one vector.
MESHTIDE_ONCE F32x4 totals(F32x4 a, F32x4 b, F32x4 c, F32x4 d) {
    transpose(a, b, c, d);
    return (a + b) + (c + d);
}

template <int lane>
MESHTIDE_INLINE F32x4 lane_of(F32x4 a) {
    return __builtin_shufflevector(a, a, lane, lane, lane, lane);
}

// What many guesses agree on, and how much it is worth: 0 if there are none, else 1 to 7.
struct Expert {
    F32x4 offset = {};
    int trust = 0;
};

// One more than how often (1 + s / 5)^2 can be halved while it is at least 2: its exponent.
MESHTIDE_INLINE int trust_of(float square) {
    float w = 1 + 0.2f * square;
    int halvings = (std::bit_cast<int32_t>(w * w) >> 23) - 127;
    return halvings > 6 ? 7 : halvings + 1;
}

// The mean of guesses, from `begin` to `end`: each counts by how near to the cell's middle it lies, and by how many of
// its vertices are known. Doubt is the weight's divisor, less `per_known` for each known vertex. There is room for
// three more behind them.
MESHTIDE_ONCE Expert conclude(F32x4* begin, F32x4* end, float doubt, float per_known) {
    if (end <= begin) return {};
    for (int i = 0; i < 3; i++) end[i] = F32x4{1e6f, 1e6f, 1e6f, 0}; // next to nothing
    F32x4 sum_x = {}, sum_y = {}, sum_z = {}, weights = {}, nearest = splat(1e12f);
    for (; begin < end; begin += 4) {
        F32x4 x = begin[0], y = begin[1], z = begin[2], known = begin[3];
        transpose(x, y, z, known);
        F32x4 square = x * x + y * y + z * z, k = square + 12.0f;
        F32x4 weight = splat(1) / (k * k * (splat(doubt) - known * per_known));
        sum_x += weight * x;
        sum_y += weight * y;
        sum_z += weight * z;
        weights += weight;
        nearest = least(nearest, square);
    }
    F32x4 sum = totals(sum_x, sum_y, sum_z, weights);
    nearest = least(nearest, __builtin_shufflevector(nearest, nearest, 2, 3, 0, 1));
    nearest = least(nearest, __builtin_shufflevector(nearest, nearest, 1, 0, 3, 2));
    return {sum * (1 / sum[3]), trust_of(nearest[0])};
}

// Midpoints of opposite members.
MESHTIDE_INLINE Expert guess_midpoints(const Offsets& ring) {
    F32x4 guesses[RING_ROOM + 3], *end = guesses;
    const F32x4* members = &ring[0];
    int half = ring.count >> 1, odd = ring.count & 1;
    if (ring.closed) {
        // With an odd number of them each has two that are opposite; those after it first.
        for (const F32x4* one = members; one < members + half + odd; one++) *end++ = (one[0] + one[half]) * 0.5f;
        if (odd != 0)
            for (const F32x4* one = members; one < members + half; one++) *end++ = (one[0] + one[half + 1]) * 0.5f;
    } else {
        for (int i = 0; i < half; i++) *end++ = (ring[i] + ring[ring.count - 1 - i]) * 0.5f;
    }
    return conclude(guesses, end, 5, 4);
}

// Midpoints of any two of the first members.
MESHTIDE_INLINE Expert guess_pairs(const Offsets& ring) {
    constexpr int LIMIT = 10;
    F32x4 guesses[LIMIT * (LIMIT - 1) / 2 + 3], *end = guesses;
    int count = ring.count < LIMIT ? ring.count : LIMIT;
    for (int i = 0; i < count; i++)
        for (int j = i + 1; j < count; j++) *end++ = (ring[i] + ring[j]) * 0.5f;
    return conclude(guesses, end, 5, 4);
}

} // namespace meshtide::inline MESHTIDE_ISA
