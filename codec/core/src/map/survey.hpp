// What the fan around a cell shows of its children, before any of them is coded (docs/format.md, Survey of a cell).
#pragma once

#include "map/cell_index.hpp"
#include "map/contacts.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// Of the vertices of the coarse level, as the walk goes over them.
struct Vicinity {
    Span<const F32x4> centres; // of the cells; in half finest steps
    Span<const Note> notes;
    // Where a cell's children are in the mean, if it is coded, otherwise its centre. Fourth lane: how far its children
    // are from the plane that was expected, in half cells.
    Span<const F32x4> places;
    Span<const F32x4> bulges; // of cells that are coded: how far that place is from the mean of its ring's places
    float scale;              // half cells in a half finest step
};

// Which octants an offset votes for: the one it lies in, and those beside it along axes where it is flat.
constexpr std::array<std::array<uint64_t, 8>, 8> make_votes() {
    std::array<std::array<uint64_t, 8>, 8> votes{}; // by the axes where it is positive, and where it is flat
    for (uint32_t positive = 0; positive < 8; positive++)
        for (uint32_t flat = 0; flat < 8; flat++)
            for (uint32_t set = 0; set < 8; set++)
                if ((set & ~flat) == 0)
                    votes[positive][flat] |= static_cast<uint64_t>(1) << (8 * octant_bits(positive ^ set));
    return votes;
}
inline constexpr auto VOTES = make_votes();

// The axes by falling component of the normal.
constexpr std::array<std::array<uint8_t, 3>, 6> AXIS_ORDERS = {
    {{0, 1, 2}, {1, 0, 2}, {0, 2, 1}, {2, 0, 1}, {1, 2, 0}, {2, 1, 0}}};
// The octants by rank, before the flip: bit 4 of a rank stands for the first of these axes.
constexpr std::array<std::array<uint8_t, 8>, 6> make_ranks() {
    std::array<std::array<uint8_t, 8>, 6> ranks{};
    for (size_t order = 0; order < 6; order++)
        for (uint32_t rank = 0; rank < 8; rank++)
            for (size_t i = 0; i < 3; i++)
                if ((rank & (4u >> i)) != 0)
                    ranks[order][rank] = static_cast<uint8_t>(ranks[order][rank] | 4 >> AXIS_ORDERS[order][i]);
    return ranks;
}
inline constexpr auto RANKS = make_ranks();

struct Survey {
    uint32_t count = 0;                 // members of the ring
    Note sum;                           // of their notes
    float length = 0;                   // sum of their distances |x| + |y| + |z|
    uint64_t votes = 0, leaf_votes = 0; // of all members, and of leaves, for each octant
    Contacts contacts;
    F32x4 mean = {0, 0, 0, 0}; // of the members' places, seen from the centre; fourth lane: sum of the fourth lanes
    // The frame: octants by rank, so that the surface is expected low in the order of ranks.
    bool oriented = false;       // there is a normal
    F32x4 normal = {0, 0, 0, 0}; // its components' magnitudes, falling, of sum 1
    float height = 0;            // of the plane along the normal, not negative; all in half cells
    size_t order = 0;            // of axes
    std::array<uint8_t, 8> octants{};
};

MESHTIDE_INLINE void find_frame(Survey& s, F32x4 turn, F32x4 plane) {
    F32x4 size = magnitude(turn);
    float total = size[0] + size[1] + size[2];
    uint32_t flip = 0;
    if (total > 1e-5f) { // less is what rounding left
        s.oriented = true;
        float inverse = 1.0f / total;
        plane = greatest(least(plane, splat(1)), splat(-1));
        s.height = dot3(turn, plane) * inverse;
        int downwards = signs(turn < splat(0));
        if (s.height < 0) {
            s.height = -s.height;
            downwards = signs(splat(0) < turn);
        }
        flip = octant_bits(static_cast<uint32_t>(downwards));
        size *= splat(inverse);
        float x = size[0], y = size[1], z = size[2];
        s.order = x >= y ? (y >= z ? 0 : x >= z ? 2 : 3) : (x >= z ? 1 : y >= z ? 4 : 5);
        const auto& axes = AXIS_ORDERS[s.order];
        s.normal = F32x4{size[axes[0]], size[axes[1]], size[axes[2]], 0};
    }
    for (size_t rank = 0; rank < 8; rank++) s.octants[rank] = static_cast<uint8_t>(RANKS[s.order][rank] ^ flip);
}

// `touching`: whether neighbours that touch the cell are taken from the ring.
MESHTIDE_INLINE void take_survey(Survey& s, const Vicinity& around, const Ring& ring, size_t v, bool touching) {
    const F32x4 zero = splat(0), centre = around.centres[v], scale = splat(around.scale);
    F32x4 lengths = zero, mean = zero, known = zero, bulge = zero, turn = zero, first = zero, before = zero;
    s.count = static_cast<uint32_t>(ring.count);
    for (int i = 0; i < ring.count; i++) {
        auto w = static_cast<size_t>(ring.members[i]);
        Note note = around.notes[w];
        s.sum.add(note);
        F32x4 offset = (around.centres[w] - centre) * scale; // integers
        F32x4 size = magnitude(offset);
        F32x4 length =
            size + __builtin_shufflevector(size, size, 1, 2, 0, 3) + __builtin_shufflevector(size, size, 2, 0, 1, 3);
        lengths += length;
        auto positive = static_cast<uint32_t>(signs(zero < offset));
        auto flat = static_cast<uint32_t>(signs(size < splat(0.19f) * length));
        uint64_t votes = VOTES[positive & 7][flat & 7];
        s.votes += votes;
        if (note.is_leaf()) {
            s.leaf_votes += votes;
        } else if (touching && length[0] <= 6) {
            auto axes = static_cast<uint32_t>(signs(size == splat(2)));
            if (axes != 0 && length[0] == static_cast<float>(2 * std::popcount(axes)))
                s.contacts.add(axes, positive, note);
        }
        F32x4 place = (around.places[w] - centre) * F32x4{scale[0], scale[0], scale[0], 1};
        mean += place;
        if (note.is_coded()) {
            known += place;
            bulge += around.bulges[w];
        }
        if (i == 0)
            first = place;
        else
            turn += cross3(before, place);
        before = place;
    }
    s.length = lengths[0];
    if (ring.count < 3)
        turn = zero;
    else if (ring.closed)
        turn += cross3(before, first);
    auto all = static_cast<float>(ring.count), coded = static_cast<float>(s.sum.coded_count());
    F32x4 plane = zero;
    if (ring.count > 0) {
        // Half way to the mean, with more weight for places that are known, and out again as far as those bulge.
        plane = (splat(0.5f) * mean + splat(0.2f) * known) * splat(1.0f / (all + 0.2f * coded));
        plane += bulge * splat(0.7f * around.scale / (coded + 1.0f));
        s.mean = mean * splat(1.0f / all);
        s.mean[3] = mean[3];
    }
    find_frame(s, turn, plane);
}

// Neighbours that touch cell v, whether or not they are in its ring.
inline void find_contacts(Survey& s, const Vicinity& around, const CellIndex& index, size_t v) {
    index.find_neighbours(around.centres[v], [&](const Direction& direction, size_t w) {
        s.contacts.add(direction.axes, direction.positive, around.notes[w]);
    });
}

} // namespace meshtide::inline MESHTIDE_ISA
