// What the fan around a cell tells of its children, before any of them is coded (docs/format.md, Map).
#pragma once

#include "map/octants.hpp"
#include "mesh/level.hpp"

#include <bit>

namespace meshtide::inline MESHTIDE_ISA {

// What a neighbour contributes, in one word, so that a ring is added up in one sum. From the lowest bit: leaves (1),
// cells coded before (1), their children (1 .. 8), their leaves (0 .. 8), 8 bits each; the age of a leaf, 16 bits; its
// children's leaves and octants as masks, 8 bits each, which mean nothing in a sum.
class Note {
public:
    Note() = default;
    static Note leaf(uint32_t age) { return Note(1u | static_cast<uint64_t>(age) << 32); }
    static Note cell(uint32_t octants, uint32_t leaves) {
        auto children = static_cast<uint64_t>(std::popcount(octants)), final = static_cast<uint64_t>(std::popcount(leaves));
        return Note(static_cast<uint64_t>(1) << 8 | children << 16 | final << 24 | static_cast<uint64_t>(leaves) << 48 |
                    static_cast<uint64_t>(octants) << 56);
    }
    void add(Note other) { bits_ += other.bits_; }

    int leaf_count() const { return field(0); }
    int coded_count() const { return field(8); }
    int child_count() const { return field(16); }
    int child_leaf_count() const { return field(24); }
    int ages() const { return static_cast<int>(bits_ >> 32 & 0xffff); }
    bool is_leaf() const { return (bits_ & 1) != 0; }
    bool is_coded() const { return octants() != 0; }
    uint32_t leaves() const { return static_cast<uint32_t>(bits_ >> 48) & 0xff; }
    uint32_t octants() const { return static_cast<uint32_t>(bits_ >> 56); }

private:
    explicit Note(uint64_t bits) : bits_(bits) {}
    int field(int shift) const { return static_cast<int>(bits_ >> shift & 0xff); }
    uint64_t bits_ = 0;
};

// Which octants an offset votes for: the one it lies in, and those that differ from it along axes where it is flat.
// First index: bit k is set if it is positive along axis k; second: bit k, if it is flat.
constexpr std::array<std::array<uint64_t, 8>, 8> make_votes() {
    std::array<std::array<uint64_t, 8>, 8> votes{};
    auto octant = [](uint32_t axes) { return (axes & 1) << 2 | (axes & 2) | axes >> 2; };
    for (uint32_t positive = 0; positive < 8; positive++)
        for (uint32_t flat = 0; flat < 8; flat++)
            for (uint32_t set = 0; set < 8; set++)
                if ((set & ~flat) == 0)
                    votes[positive][flat] |= static_cast<uint64_t>(1) << (8 * octant(positive ^ set));
    return votes;
}
inline constexpr auto VOTES = make_votes();

// The axes by falling component of the normal: for each, the bit of an octant.
constexpr std::array<std::array<uint8_t, 3>, 6> AXIS_ORDERS = {
    {{4, 2, 1}, {2, 4, 1}, {4, 1, 2}, {1, 4, 2}, {2, 1, 4}, {1, 2, 4}}};
// Octants by rank, before the flip.
constexpr std::array<std::array<uint8_t, 8>, 6> make_ranks() {
    std::array<std::array<uint8_t, 8>, 6> ranks{};
    for (size_t order = 0; order < 6; order++)
        for (uint32_t r = 0; r < 8; r++)
            ranks[order][r] = static_cast<uint8_t>(((r & 4) != 0 ? AXIS_ORDERS[order][0] : 0) |
                                                   ((r & 2) != 0 ? AXIS_ORDERS[order][1] : 0) |
                                                   ((r & 1) != 0 ? AXIS_ORDERS[order][2] : 0));
    return ranks;
}
inline constexpr auto RANKS = make_ranks();

struct Survey {
    int count = 0;           // members of the ring
    Note sum;                // of the members' notes
    float length = 0;        // sum of Manhattan lengths
    uint64_t votes = 0;      // for each octant
    uint64_t outer = 0;      // for each octant: the cells across its outer faces, base 4
    uint64_t touch_leaf = 0, touch_inner = 0, touch_empty = 0, leaf_votes = 0;
    uint64_t edges = 0, corners = 0;
    bool oriented = false;   // there is a normal
    F32x4 normal;            // its magnitudes, falling, of sum 1; all 0 without
    float offset = 0;        // of the plane from the centre along the normal, 0 or more
    F32x4 mean = {0, 0, 0, 0};
    float miss = 0;          // sum over coded members of how far their children are from their plane
    std::array<uint8_t, 8> octants; // by rank
};

// `moved` has for each vertex where its children are in the mean, if they are known, otherwise its centre; and as
// the fourth lane its miss.
inline Survey survey(const Level& level, Span<const Note> notes, Span<const F32x4> moved, Span<const F32x4> laps, size_t v, float scale) {
    Survey s;
    Ring ring;
    walk_ring(level, v, ring);
    s.count = ring.count;
    float lapw = 0;
    const F32x4 centre = level.centres[v], zero = splat(0);
    F32x4 mean = zero, known = zero, lap = zero, turn = zero, first = zero, before = zero, lengths = zero;
    for (int i = 0; i < ring.count; i++) {
        auto w = static_cast<size_t>(ring.members[i]);
        Note note = notes[w];
        F32x4 offset = (level.centres[w] - centre) * splat(scale);
        F32x4 size = magnitude(offset);
        F32x4 turned = size + __builtin_shufflevector(size, size, 1, 2, 0, 3) + __builtin_shufflevector(size, size, 2, 0, 1, 3); // the same in three lanes
        lengths += turned;
        auto positive = static_cast<size_t>(signs(zero < offset) & 7);
        auto flat = static_cast<size_t>(signs(size < splat(0.19f) * turned) & 7);
        s.votes += VOTES[positive][flat];
        s.sum.add(note);
        if (!note.is_leaf()) {
            int along = signs(size == splat(2)) & 7;
            int naxes = std::popcount(static_cast<uint32_t>(along));
            if (along != 0 && turned[0] == 2.0f * static_cast<float>(naxes)) {
                uint32_t half = 0xff, mask = note.octants(), leafs = note.leaves(); int other = 0, one = 0;
                for (int axis = 0; axis < 3; axis++) if (along >> axis & 1) { half &= UPPER_HALF[axis] ^ ((positive >> axis & 1) ? 0 : 0xff); mask = flipped(mask, axis); leafs = flipped(leafs, axis); one = axis; } else other = axis;
                uint64_t lanes = spread(half), code = note.is_coded() ? lanes : 3 * lanes, all = lanes * 0xff;
                code += spread(mask) & all;
                if (naxes == 1) s.outer |= code << (2 * (2 - one)); else if (naxes == 2) s.edges |= code << (2 * (2 - other)); else s.corners |= code;
                if (note.is_coded()) { s.touch_leaf += spread(leafs) & all; s.touch_inner += spread(mask & ~leafs) & all; s.touch_empty += spread(~mask & 255) & all; }
            }
        } else { s.leaf_votes += VOTES[positive][flat]; }
        F32x4 place = (moved[w] - centre) * F32x4{scale, scale, scale, 1.0f};
        mean += place;
        if (note.is_coded()) known += place, lap += laps[w] * splat(LC), lapw += LC;
        else lap += laps[w] * splat(LU), lapw += LU;
        if (i == 0) first = place;
        else turn += cross3(before, place);
        before = place;
    }
    s.length = lengths[0];
    s.miss = mean[3];
    if (ring.count < 3) turn = zero;
    else if (ring.closed) turn += cross3(before, first);
    F32x4 size = magnitude(turn);
    float total = size[0] + size[1] + size[2];
    size_t order = 0;
    uint32_t flip = 0;
    s.normal = zero;
    if (total > 0) {
        s.oriented = true;
        float inverse = 1.0f / total;
        float kc = static_cast<float>(s.sum.coded_count()), nn = static_cast<float>(ring.count);
        F32x4 plane = (mean * splat(WU) + known * splat(WK - WU)) * splat(1.0f / (WU * nn + (WK - WU) * kc + WO + WN * nn));
        plane += (lap + laps[v] * splat(LV)) * splat(scale * LG / (lapw + LK));
        s.mean = mean * splat(1.0f / nn);
        plane = greatest(least(plane, splat(1)), splat(-1));
        float height = dot3(turn, plane) * inverse;
        int below = signs(turn < zero) & 7;
        if (height < 0) {
            height = -height;
            below = signs(turn > zero) & 7;
        }
        s.offset = height;
        flip = static_cast<uint32_t>((below & 1) << 2 | (below & 2) | below >> 2);
        size *= splat(inverse);
        float x = size[0], y = size[1], z = size[2];
        bool xy = x >= y, xz = x >= z, yz = y >= z;
        order = xy ? (yz ? 0 : xz ? 2 : 3) : (xz ? 1 : yz ? 4 : 5);
        // order: 0 xyz, 1 yxz, 2 xzy, 3 zxy, 4 yzx, 5 zyx
        float most = x > y ? (x > z ? x : z) : (y > z ? y : z), least_one = x < y ? (x < z ? x : z) : (y < z ? y : z);
        float middle = order == 0 || order == 5 ? y : order == 1 || order == 3 ? x : z;
        s.normal = F32x4{most, middle, least_one, 0};
    }
    for (size_t r = 0; r < 8; r++) s.octants[r] = static_cast<uint8_t>(RANKS[order][r] ^ flip);
    return s;
}

} // namespace meshtide::inline MESHTIDE_ISA
