// What the surroundings of a vertex say about its next bits: positions guessed in several ways.
//
// All offsets are in half cells of the depth that is coded, x, y, z in lanes, from the middle of the cell that is
// known, which is four of them wide: the bits will move the vertex by +1 or -1 along each axis. The fourth lane of an
// offset to a vertex is 1 if that vertex is known at this depth, else 0.
#pragma once

#ifndef SM_MEAN
#define SM_MEAN 0.65f
#define SM_SPREAD 0.15f
#define SM_OWN 0.0f
#endif
#ifndef LAP
#define LAP 0
#endif
#ifndef SPARE
#define SPARE 1
#endif
#ifndef DRATE
#define DRATE 4
#endif
#ifndef EC0
#define EC0(x) ((x) >> 2)
#endif
#include "diff/slice.hpp"

namespace meshtide::inline MESHTIDE_ISA {

constexpr int RING_ROOM = RING_LIMIT + 1;

// The ring of one vertex.
struct Offsets {
    F32x4 room[RING_ROOM + 2]; // one more before and after: those that follow around, if it is closed
    F32x4 inverted[RING_ROOM]; // the same with the fourth lane negated
    int count;
    bool closed;
    const F32x4& operator[](int i) const { return room[i + 1]; }
};

// A guess made of several, and how much it is worth: 0 if there is none, 1 to 7.
struct Expert {
    F32x4 offset;
    int trust;
};

// Guesses to be weighed.
struct Guesses {
    F32x4 list[RING_ROOM + 3];
    int count = 0;
    MESHTIDE_INLINE void add(F32x4 guess) { list[count++] = guess; }
};

MESHTIDE_INLINE void transpose(F32x4& a, F32x4& b, F32x4& c, F32x4& d) {
    F32x4 p = __builtin_shufflevector(a, b, 0, 4, 1, 5), q = __builtin_shufflevector(c, d, 0, 4, 1, 5);
    F32x4 r = __builtin_shufflevector(a, b, 2, 6, 3, 7), s = __builtin_shufflevector(c, d, 2, 6, 3, 7);
    a = __builtin_shufflevector(p, q, 0, 1, 4, 5);
    b = __builtin_shufflevector(p, q, 2, 3, 6, 7);
    c = __builtin_shufflevector(r, s, 0, 1, 4, 5);
    d = __builtin_shufflevector(r, s, 2, 3, 6, 7);
}

// How far guesses, given by coordinates, lie from the cells that the bits can choose.
MESHTIDE_INLINE F32x4 disagreement(F32x4 x, F32x4 y, F32x4 z) {
    x = magnitude(x), y = magnitude(y), z = magnitude(z);
    F32x4 zero = splat(0), two = splat(2);
    F32x4 p = greatest(x - two, zero), q = greatest(y - two, zero), r = greatest(z - two, zero);
    return (p * p + q * q + r * r) * 0.25f + (x + y + z) * 0.025f;
}

// 0: D >= ...: one more than how often (1 + 4 D)^2 can be halved while it is at least 2, at most 7.
MESHTIDE_INLINE int trust_of(float disagreement) {
    float w = 1 + 4 * disagreement;
    w *= w;
    int halvings = (std::bit_cast<int32_t>(w) >> 23) - 127;
    return halvings > 6 ? 7 : halvings + 1;
}

struct Tally {
    F32x4 x = {}, y = {}, z = {}, weight = {}, least_disagreement = splat(1e9f);

    // Four guesses of offsets x, y, z; `doubt` is 1 and twice the number of vertices in it that are not known.
    MESHTIDE_INLINE void add(F32x4 gx, F32x4 gy, F32x4 gz, F32x4 doubt) {
        F32x4 d = disagreement(gx, gy, gz), k = d + 0.3f;
        F32x4 w = splat(1) / (k * k * doubt);
        x += w * gx;
        y += w * gy;
        z += w * gz;
        weight += w;
        least_disagreement = least(least_disagreement, d);
    }
    MESHTIDE_INLINE Expert conclude() {
        F32x4 a = x, b = y, c = z, d = weight;
        transpose(a, b, c, d);
        F32x4 total = (a + b) + (c + d), l = least_disagreement;
        l = least(l, __builtin_shufflevector(l, l, 2, 3, 0, 1));
        float lowest = l[0] < l[1] ? l[0] : l[1];
        return {total * (1.0f / total[3]), trust_of(lowest)};
    }
};

// The fourth lane of a guess, times `slope`, is taken from `doubt`.
MESHTIDE_INLINE Expert weigh(Guesses& guesses, float doubt, float slope) {
    if (guesses.count == 0) return {splat(0), 0};
    F32x4 nowhere = {1e6f, 1e6f, 1e6f, 0};
    for (int i = 0; i < 3; i++) guesses.list[guesses.count + i] = nowhere;
    Tally tally;
    for (int i = 0; i < guesses.count; i += 4) {
        F32x4 x = guesses.list[i], y = guesses.list[i + 1], z = guesses.list[i + 2], known = guesses.list[i + 3];
        transpose(x, y, z, known);
        tally.add(x, y, z, splat(doubt) - known * slope);
    }
    return tally.conclude();
}

// Parallelograms inside the ring: the member before, and the one after, over this one.
MESHTIDE_INLINE Expert guess_in_ring(const Offsets& ring) {
    Guesses guesses;
    int first = ring.closed ? 0 : 1, end = ring.closed ? ring.count : ring.count - 1;
    for (int i = first; i < end; i++) guesses.add(ring[i - 1] + ring[i + 1] - ring.inverted[i]);
    return weigh(guesses, 7, 2);
}

// Midpoints of opposite members.
MESHTIDE_INLINE Expert guess_midpoints(const Offsets& ring) {
    Guesses guesses;
    int half = ring.count >> 1;
    if (ring.closed) {
        int count = (ring.count & 1) != 0 ? ring.count : half;
        for (int i = 0, j = half; i < count; i++) {
            guesses.add((ring[i] + ring[j]) * 0.5f);
            j = j + 1 == ring.count ? 0 : j + 1;
        }
    } else {
        for (int i = 0; i < half; i++) guesses.add((ring[i] + ring[ring.count - 1 - i]) * 0.5f);
    }
    return weigh(guesses, 5, 4);
}

struct NoPatch {
    MESHTIDE_INLINE void add(F32x4) {}
};

// What one visit sees.
struct Surroundings {
    Offsets ring;
    F32x4 mean, smoothed, far_mean, plane, normal; // normal: of length 1, or 0
    I32x4 below, level, above;                     // members with an offset of -1, 0, 1
    Expert in_ring, midpoint, across;
    int error_class, known_class;
};

// Errors by half octaves.
constexpr int ERROR_CLASSES = 24;
MESHTIDE_INLINE int error_class(float error) {
    float square = error * error;
    int octave = (std::bit_cast<int32_t>(square) >> 23) - 127 + 12;
    return octave < 0 ? 0 : octave >= ERROR_CLASSES ? ERROR_CLASSES - 1 : octave;
}

template <class Patch>
MESHTIDE_INLINE void look_around(Patch& patch, Span<const DiffRow> rows, const DiffNeighbour* neighbours, int count, bool closed,
                                 F32x4 unit, const DiffRow& own, Surroundings& seen) {
    Offsets& ring = seen.ring;
    ring.count = count;
    ring.closed = closed;
    F32x4 sum = {}, laplacians = {};
    I32x4 below = {}, above = {}, level = {};
    const F32x4 flip = {1, 1, 1, -1};
    Guesses guesses;
    F32x4 across[RING_ROOM];
    for (int i = 0; i < count; i++) {
        const DiffRow& row = rows[static_cast<size_t>(neighbours[i].member)];
        F32x4 offset = (row.position - own.position) * unit;
        ring.room[i + 1] = offset;
        ring.inverted[i] = offset * flip;
        patch.add(offset);
        sum += offset;
        laplacians += row.laplacian;
        below -= offset == splat(-1);
        level -= offset == splat(0);
        above -= offset == splat(1);
        int32_t far = neighbours[i].across;
        if (far >= 0) across[i] = (rows[static_cast<size_t>(far)].position - own.position) * unit;
    }
    seen.below = below, seen.level = level, seen.above = above;
    F32x4 turn = {};
    if (count != 0) {
        ring.room[0] = ring.room[count];
        ring.room[count + 1] = ring.room[1];
        F32x4 last = closed ? ring.room[0] : ring.room[1];
        for (int i = 1; i <= count; i++) {
            turn += cross3(last, ring.room[i]);
            last = ring.room[i];
        }
        for (int i = 0; i < count; i++)
            if (neighbours[i].across >= 0) {
                guesses.add(ring[i] + ring[i + 1] - across[i] * flip);
                patch.add(across[i]);
            }
    }
    float members = static_cast<float>(count), share = count != 0 ? 1 / members : 0;
    seen.mean = sum * share;
    F32x4 spread = laplacians * (unit * share), own_laplacian = own.laplacian * unit;
    (void)own_laplacian;
    seen.smoothed = SM_MEAN * seen.mean - SM_SPREAD * spread + SM_OWN * own_laplacian;
    seen.far_mean = seen.mean - 0.7f * spread;
    float error = (laplacians[3] + 0.5f * own.laplacian[3]) / (members + 0.5f);
    seen.error_class = count != 0 ? error_class(error) : ERROR_CLASSES - 1;
    seen.known_class = static_cast<int>(4 * sum[3]) / (count + 1);
    float square = dot3(turn, turn);
    turn[3] = 0;
    seen.normal = square > 0 ? turn * (1 / __builtin_sqrtf(square)) : splat(0);
    seen.plane = seen.smoothed + dot3(seen.far_mean - seen.smoothed, seen.normal) * seen.normal;
    seen.in_ring = guess_in_ring(ring);
    seen.midpoint = guess_midpoints(ring);
    seen.across = weigh(guesses, 7, 2);
}

} // namespace meshtide::inline MESHTIDE_ISA
