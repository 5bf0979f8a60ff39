// What a decision of the Diff is mixed from: contexts, numbers and neurons, for the three axes at once.
#pragma once

#include "diff/surface.hpp"
#include "diff/surroundings.hpp"
#include "entropy/mixing.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// What the plane of symmetry tells.
struct Reflection {
    F32x4 offset = {};
    int state = 0; // 0: no partner; 1..4 with one that is not known, 5..8 with one that is: by its neighbours' verdict
    int axis = -1;
};

// a b for integers of at most 15 bits.
MESHTIDE_INLINE I32x4 times(I32x4 a, int b) {
    return multiply_pairs(reinterpret_cast<I16x8>(a), reinterpret_cast<I16x8>(splat32(b)));
}
MESHTIDE_INLINE I32x4 least(I32x4 a, int b) { // of what is at most 15 bits
    return reinterpret_cast<I32x4>(least(reinterpret_cast<I16x8>(a), reinterpret_cast<I16x8>(splat32(b))));
}
MESHTIDE_INLINE I32x4 least(I32x4 a, I32x4 b) {
    return reinterpret_cast<I32x4>(least(reinterpret_cast<I16x8>(a), reinterpret_cast<I16x8>(b)));
}
MESHTIDE_INLINE I32x4 greatest(I32x4 a, I32x4 b) {
    return reinterpret_cast<I32x4>(greatest(reinterpret_cast<I16x8>(a), reinterpret_cast<I16x8>(b)));
}
MESHTIDE_INLINE I32x4 choose(I32x4 mask, I32x4 a, I32x4 b) { return (a & mask) | (b & ~mask); }
MESHTIDE_INLINE I32x4 negative(F32x4 a) { return a < splat(0); }
// a, negated where the mask is set.
MESHTIDE_INLINE F32x4 turned(F32x4 a, I32x4 mask) {
    return reinterpret_cast<F32x4>(reinterpret_cast<I32x4>(a) ^ (mask & splat32(INT32_MIN)));
}
// Classes of magnitudes, fine near 0: trunc(k m / (m + half)), below k.
MESHTIDE_INLINE I32x4 classes(F32x4 a, int k, float half = 1) {
    F32x4 m = magnitude(a);
    return truncate(least(static_cast<float>(k) * m / (m + half), splat(static_cast<float>(k - 1))));
}
// Classes of width 1/2, the middle one around 0, 0 to 2 middle.
MESHTIDE_INLINE I32x4 half_steps(F32x4 a, int middle) {
    auto m = static_cast<float>(middle);
    return truncate(greatest(least(a * 2.0f + (m + 0.5f), splat(2 * m)), splat(0)));
}
MESHTIDE_INLINE I32x4 numbers(F32x4 a) {
    return truncate(greatest(least(a * 256.0f, splat(2047)), splat(-2047)));
}
MESHTIDE_INLINE void transpose(I32x4* rows) {
    F32x4 a = reinterpret_cast<F32x4>(rows[0]), b = reinterpret_cast<F32x4>(rows[1]);
    F32x4 c = reinterpret_cast<F32x4>(rows[2]), d = reinterpret_cast<F32x4>(rows[3]);
    transpose(a, b, c, d);
    rows[0] = reinterpret_cast<I32x4>(a), rows[1] = reinterpret_cast<I32x4>(b);
    rows[2] = reinterpret_cast<I32x4>(c), rows[3] = reinterpret_cast<I32x4>(d);
}

template <Effort effort>
struct DiffShape {
    static constexpr int groups = 2, neurons = 5;
    static constexpr int context_sizes[8] = {12 * 12 * 2 * 8, 5 * 4 * 3 * 8, 16 * 8 * 4 * 4, 16 * 8 * 4 * 4,
                                             10 * 8 * 9 * 5,  4 * 4 * 7 * 40 + 8 * 9 * 2, 9 * 16 * 8,  16 * 7 * 7};
    static constexpr int neuron_sizes[5] = {3 * 8 * 3, 24 * 4, 9 * 9, 64, 16 * 3};
};
template <>
struct DiffShape<Effort::high> {
    static constexpr int groups = 3, neurons = 8;
    static constexpr int context_sizes[12] = {12 * 12 * 2 * 8, 5 * 4 * 3 * 8,   16 * 8 * 4 * 4, 16 * 8 * 4 * 4,
                                              10 * 8 * 9 * 5,  4 * 4 * 7 * 40 + 8 * 9 * 2, 9 * 16 * 8, 12 * 9 * 8 * 8,
                                              24 * 4 * 24, 16 * 8 * 4 * 4, 5 * 5 * 9 * 4, 16 * 9 * 9};
    static constexpr int neuron_sizes[8] = {3 * 8 * 3, 24 * 4, 9 * 9, 64, 16 * 3, 24 * 4, 64, 25 * 3};
};

template <Effort effort>
struct AxisQuestions {
    static constexpr int groups = DiffShape<effort>::groups;
    I32x4 places[4 * groups], signs[4 * groups], numbers[8], neurons[8];
};

// What effort high sees besides.
struct FarSight {
    Surface surface;
    Expert pairs;
    I32x4 below, above;
    F32x4 quadric;
    int quadric_class;
};

template <Effort effort>
MESHTIDE_INLINE void ask(const Surroundings& s, const FarSight& far, const Reflection& mirror, int age,
                         AxisQuestions<effort>& q) {
    I32x4 zero = splat32(0), one = splat32(1);
    F32x4 ring = s.in_ring.offset, midpoint = s.midpoint.offset, across = s.across.offset, plane = s.plane;
    // plane
    I32x4 sign = negative(plane);
    I32x4 alike = (plane * s.far_mean > splat(0)) & one;
    q.signs[0] = sign;
    q.places[0] = times(times(times(classes(plane, 12), 12) + classes(s.far_mean, 10, 1.5f), 2) + alike, 8) +
                  splat32(EC0(s.error_class));
    // alignment
    I32x4 below = s.below, above = s.above;
    sign = (above < below) | ((above == below) & negative(s.smoothed));
    I32x4 more = greatest(above, below), fewer = least(above, below);
    alike = (turned(s.smoothed, sign) > splat(0)) & one;
    q.signs[1] = sign;
    q.places[1] = times(times(times(least(more, 4), 4) + least(fewer, 3), 3) + least(s.level, 2), 8) +
                  times(classes(s.smoothed, 4), 2) + alike;
    // ring, midpoint
    I32x4 steep = truncate(magnitude(s.normal) * 3.999f);
    I32x4 known = times(steep, 4) + splat32(s.known_class);
    I32x4 ring_class = classes(ring, 16);
    I32x4 ring_sign = negative(ring), midpoint_sign = negative(midpoint), across_sign = negative(across);
    q.signs[2] = ring_sign;
    q.places[2] = times(times(ring_class, 8) + splat32(s.in_ring.trust), 16) + known;
    q.signs[3] = midpoint_sign;
    q.places[3] = times(times(classes(midpoint, 16), 8) + splat32(s.midpoint.trust), 16) + known;
    // across
    sign = across_sign;
    I32x4 below2 = least(below, 2), above2 = least(above, 2);
    I32x4 agreeing = choose(sign, below2, above2), opposing = choose(sign, above2, below2);
    F32x4 ahead = turned(plane, sign);
    I32x4 ahead_class = truncate(greatest(least(ahead * 2.0f + 2.5f, splat(4)), splat(0)));
    q.signs[4] = sign;
    q.places[4] = times(times(times(classes(across, 10), 8) + splat32(s.across.trust), 9) + times(agreeing, 3) + opposing, 5) +
                  ahead_class;
    // joint, or mirrored
    if (mirror.state == 0) {
        F32x4 guess = s.midpoint.trust != 0 ? midpoint : s.in_ring.trust != 0 ? ring : plane;
        sign = negative(guess);
        I32x4 below3 = least(below, 3), above3 = least(above, 3);
        agreeing = choose(sign, below3, above3), opposing = choose(sign, above3, below3);
        ahead = turned(plane, sign);
        q.signs[5] = sign;
        int trust = s.midpoint.trust < 4 ? s.midpoint.trust : 4;
        q.places[5] = times(times(times(agreeing, 4) + opposing, 7) + half_steps(ahead, 3), 40) +
                      times(classes(guess, 8), 5) + splat32(trust);
    } else {
        I32x4 distance = truncate(least(magnitude(mirror.offset) * 2.0f + 0.5f, splat(7)));
        q.signs[5] = negative(mirror.offset);
        I32x4 on_axis = I32x4{0, 1, 2, 3} == splat32(mirror.axis);
        q.places[5] = splat32(4 * 4 * 7 * 40) + times(times(distance, 9) + splat32(mirror.state), 2) + (on_axis & one);
    }
    // ring and alignment
    sign = ring_sign;
    I32x4 al = times(choose(sign, below2, above2), 3) + choose(sign, above2, below2);
    q.signs[6] = sign;
    q.places[6] = times(times(al, 16) + ring_class, 8) + splat32(s.in_ring.trust);
    // all three
#if SPARE
    sign = across_sign;
    q.signs[7] = sign;
    q.places[7] = times(times(classes(across, 16), 7) + half_steps(turned(ring, sign), 3), 7) + half_steps(turned(midpoint, sign), 3);
#else
    q.signs[7] = zero;
    q.places[7] = zero;
#endif
    F32x4 pairs = {}, quadric = {};
    I32x4 slope = {};
    if constexpr (effort == Effort::high) {
        pairs = far.pairs.offset;
        quadric = far.quadric;
        slope = truncate(magnitude(far.surface.normal) * 3.999f);
        I32x4 pairs_sign = negative(pairs), quadric_sign = negative(quadric);
        auto signed_class = [](F32x4 x) { // 0 to 8, fine around the middle
            I32x4 steps = times(classes(x, 12), 6) >> 4; // 0 to 4
            return choose(negative(x), splat32(4) - steps, splat32(4) + steps);
        };
        q.signs[7] = pairs_sign;
        q.places[7] = times(times(times(classes(pairs, 12), 9) + signed_class(turned(ring, pairs_sign)), 8) + splat32(age), 8) + splat32(s.midpoint.trust);
        q.signs[8] = quadric_sign;
        q.places[8] = times(times(classes(quadric, 24), 4) + slope, 24) + splat32(far.quadric_class);
        q.signs[9] = pairs_sign;
        q.places[9] = times(times(times(classes(pairs, 16), 8) + splat32(far.pairs.trust), 4) + slope, 4) + splat32(s.known_class);
        I32x4 far_below = far.below, far_above = far.above;
        sign = (far_above < far_below) | ((far_above == far_below) & quadric_sign);
        I32x4 nearing = choose(turned(quadric, sign) > splat(0), classes(quadric, 4), zero);
        I32x4 far_al = times(choose(sign, below2, above2), 3) + choose(sign, above2, below2);
        q.signs[10] = sign;
        q.places[10] = times(times(times(least(greatest(far_above, far_below), 4), 5) + least(least(far_above, far_below), 4), 9) + far_al, 4) + nearing;
        q.signs[11] = across_sign;
        q.places[11] = times(times(classes(across, 16), 9) + signed_class(turned(quadric, across_sign)), 9) + signed_class(turned(pairs, across_sign));
    }
    int place = 0;
    for (int i = 0; i < 4 * DiffShape<effort>::groups; i++) {
        q.places[i] = q.places[i] + splat32(place);
        place += DiffShape<effort>::context_sizes[i];
    }
    q.numbers[0] = numbers(plane);
    q.numbers[1] = numbers(s.far_mean);
    q.numbers[2] = numbers(s.smoothed);
    q.numbers[3] = numbers(ring);
    q.numbers[4] = numbers(midpoint);
    q.numbers[5] = numbers(across);
    q.numbers[6] = mirror.state != 0 ? numbers(mirror.offset) : zero;
    q.numbers[7] = splat32(256);
    if constexpr (effort == Effort::high) {
        q.numbers[6] = mirror.state != 0 ? numbers(mirror.offset) : numbers(pairs);
        q.numbers[7] = numbers(quadric);
    }
    // neurons
    F32x4 n = magnitude(s.normal);
    I32x4 rank = -((n > __builtin_shufflevector(n, n, 1, 2, 0, 3)) + (n >= __builtin_shufflevector(n, n, 2, 0, 1, 3)));
    int t = mirror.state == 0 ? 0 : mirror.state >= 7 ? 2 : 1;
    int valence = s.ring.count < 15 ? s.ring.count : 15;
    q.neurons[0] = times(times(rank, 8) + splat32(age), 3) + splat32(t);
    q.neurons[1] = splat32(s.error_class * 4 + s.known_class);
    q.neurons[2] = splat32(mirror.state * 9) + times(above2, 3) + below2;
    q.neurons[3] = splat32(s.in_ring.trust * 8 + s.midpoint.trust);
    q.neurons[4] = splat32(valence * 3) + rank;
    if constexpr (effort == Effort::high) {
        q.neurons[5] = splat32(far.quadric_class * 4) + slope;
        q.neurons[6] = splat32(far.pairs.trust * 8 + s.across.trust);
        q.neurons[7] = times(times(least(far.below, 4), 5) + least(far.above, 4), 3) + rank;
    }
    place = 0;
    for (int i = 0; i < DiffShape<effort>::neurons; i++) {
        q.neurons[i] = q.neurons[i] + splat32(place);
        place += DiffShape<effort>::neuron_sizes[i];
    }
}

} // namespace meshtide::inline MESHTIDE_ISA
