// What the contexts of a Map are made of.
#pragma once

#include "map/survey.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

// Paths: A = 1 at first and 2 A + bit after each octant. How many octants of a path are occupied, and, base 3 for the
// ranks beside the next one (that differ in bit 4, 2, 1): 0 empty, 1 occupied, 2 to come.
constexpr std::array<uint8_t, 256> make_inner() {
    std::array<uint8_t, 256> inner{};
    for (uint32_t path = 1; path < 256; path++) {
        uint32_t rank = static_cast<uint32_t>(std::bit_width(path)) - 1, code = 0;
        for (uint32_t q : {4u, 2u, 1u}) {
            uint32_t beside = rank ^ q;
            code = 3 * code + (beside < rank ? path >> (rank - 1 - beside) & 1 : 2);
        }
        inner[path] = static_cast<uint8_t>(code);
    }
    return inner;
}
inline constexpr auto INNER = make_inner();

struct CellFacts {
    uint32_t normal_class, density, ratio, coded_ratio, degree, age, spacing, mirror_state, trusted, fit;
    uint32_t siblings, place; // of the cell in its parent
    uint32_t recent, recent_leaf; F32x4 heights[2]; float raw_offset, k_spacing; // of the octants' middles above the plane, in half cells of the coarse depth
};

struct OctantFacts {
    uint32_t rank, path, vote, outer, inner, count, height, answer, edges, canon_outer, canon_edges, corner, touch_leaf, touch_inner, touch_empty, leaf_votes, all_votes;
    float over;
};

struct LeafFacts {
    uint32_t rank, size, split, found, vote, answer, beside, outer, canonical, children, left, touch_leaf, touch_inner, leaf_votes, all_votes, path;
    float over;
};

} // namespace meshtide::inline MESHTIDE_ISA
