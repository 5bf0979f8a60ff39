// What the surroundings of a vertex say about its next bits (offsets as in experts.hpp).
#pragma once

#include "diff/experts.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// Offsets of the ring and of the vertices across its edges. The fourth lane: 1, and 1 more if it is known.
struct Patch {
    int count = 0;
    F32x4 points[2 * RING_ROOM + 3];
    MESHTIDE_INLINE void add(F32x4 offset) { points[count++] = offset + F32x4{0, 0, 0, 1}; }
};
struct NoPatch { // for those who do not fit a surface
    MESHTIDE_INLINE void add(F32x4) {}
};

struct Surroundings {
    Offsets ring;
    I32x4 below, level, above;        // members with an offset of exactly -1, 0, 1
    F32x4 smoothed;                   // the neighbours' mean, filtered and drawn towards the cell's middle
    F32x4 far_mean;                   // the neighbours' mean, filtered
    F32x4 normal;                     // of the ring, of length 1, or 0
    I32x4 rank;                       // 2 for the axis that is nearest to the normal, 0 for the one farthest from it
    F32x4 plane;                      // smoothed, moved along the normal to where far_mean is
    F32x4 across_mean, across_spread; // means of the vertices across, and of their Laplacians
    Expert in_ring, midpoint, across;
    int error_class, known_class; // how wrong the guesses of the ring were; how much of it is known, 0 to 3
};

// Errors by half octaves.
constexpr int ERROR_CLASSES = 24;
MESHTIDE_INLINE int error_class(float error) {
    int octave = (std::bit_cast<int32_t>(error * error) >> 23) - 127 + 12;
    return octave < 0 ? 0 : octave >= ERROR_CLASSES ? ERROR_CLASSES - 1 : octave;
}

// unit: scales to half cells, and leaves the fourth lane.
template <class AnyPatch>
MESHTIDE_INLINE void look_around(Span<const DiffRow> rows, const DiffRow& own, Span<const DiffNeighbour> neighbours,
                                 F32x4 unit, Surroundings& seen, AnyPatch& patch) {
    auto count = static_cast<int>(neighbours.size());
    Offsets& ring = seen.ring;
    ring.count = count;
    F32x4 sum = {}, laplacians = {};
    I32x4 below = {}, level = {}, above = {};
    F32x4* members = ring.room + 1;
    F32x4* next = members;
    for (DiffNeighbour neighbour : neighbours) {
        const DiffRow& row = rows[static_cast<size_t>(neighbour.member)];
        F32x4 offset = (row.position - own.position) * unit;
        *next++ = offset;
        patch.add(offset);
        sum += offset;
        laplacians += row.laplacian;
        below -= offset == splat(-1);
        level -= offset == splat(0);
        above -= offset == splat(1);
    }
    seen.below = below, seen.level = level, seen.above = above;
    F32x4 turn = {}, across_sum = {}, across_laplacians = {};
    F32x4 in_ring[RING_ROOM + 3], across[RING_ROOM + 3], *in_ring_end = in_ring, *across_end = across;
    if (count != 0) {
        // An open ring's first member has none before it: a turn of nothing, and a guess that does not count.
        members[-1] = members[ring.closed ? count - 1 : 0];
        members[count] = members[0];
        const F32x4* here = members;
        for (DiffNeighbour neighbour : neighbours) {
            turn += cross3(here[-1], here[0]);
            // Parallelograms: the members beside over this one; this one and the next over what lies across.
            *in_ring_end++ = here[-1] + here[1] - inverted(here[0]);
            if (neighbour.across != NONE) {
                const DiffRow& row = rows[static_cast<size_t>(neighbour.across)];
                F32x4 offset = (row.position - own.position) * unit;
                *across_end++ = here[0] + here[1] - inverted(offset);
                patch.add(offset);
                across_sum += offset;
                across_laplacians += row.laplacian;
            }
            here++;
        }
    }
    auto ring_count = static_cast<float>(count), across_count = static_cast<float>(across_end - across);
    float share = count != 0 ? 1 / ring_count : 0, across_share = across_count != 0 ? 1 / across_count : 0;
    F32x4 mean = sum * share, spread = laplacians * unit * share;
    seen.across_mean = across_sum * across_share;
    seen.across_spread = across_laplacians * unit * across_share;
    seen.smoothed = mean * 0.65f - spread * 0.15f;
    seen.far_mean = mean - spread * 0.7f;

    turn[3] = 0;
    float square = dot3(turn, turn);
    seen.normal = square > 0 ? turn * (1 / __builtin_sqrtf(square)) : splat(0);
    seen.plane = seen.smoothed + seen.normal * dot3(seen.far_mean - seen.smoothed, seen.normal);
    // Floats that are not negative stand in the order of their bits; the last ones separate equals.
    I32x4 order = (reinterpret_cast<I32x4>(magnitude(seen.normal)) & splat32(~3)) | I32x4{0, 1, 2, 3};
    seen.rank = -((order > __builtin_shufflevector(order, order, 1, 2, 0, 3)) +
                  (order > __builtin_shufflevector(order, order, 2, 0, 1, 3)));

    float error = (laplacians[3] + 0.5f * own.laplacian[3]) / (ring_count + 0.5f);
    seen.error_class = count != 0 ? error_class(error) : ERROR_CLASSES - 1;
    seen.known_class = static_cast<int>(4 * sum[3]) / (count + 1);
    int skipped = ring.closed ? 0 : 1; // at either end
    seen.in_ring = conclude(in_ring + skipped, in_ring_end - skipped, 7, 2);
    seen.midpoint = guess_midpoints(ring);
    seen.across = conclude(across, across_end, 7, 2);
}

} // namespace meshtide::inline MESHTIDE_ISA
