// What contexts are made of: facts of a cell, of one of its octants, and of one of its children.
#pragma once

#include "map/survey.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

// Paths: A = 1 at first, and 2 A + bit after each octant. Of a path, base 3, the octants whose ranks differ from that
// of the next one in bit 4, 2, 1: 0 empty, 1 occupied, 2 not known yet.
constexpr std::array<uint8_t, 256> make_beside() {
    std::array<uint8_t, 256> beside{};
    for (uint32_t path = 1; path < 256; path++) {
        uint32_t rank = static_cast<uint32_t>(std::bit_width(path)) - 1, code = 0;
        for (uint32_t bit : {4u, 2u, 1u}) {
            uint32_t other = rank ^ bit;
            code = 3 * code + (other < rank ? path >> (rank - 1 - other) & 1 : 2);
        }
        beside[path] = static_cast<uint8_t>(code);
    }
    return beside;
}
inline constexpr auto BESIDE = make_beside();

// Heights are out of 256 in a half cell.
constexpr int32_t HEIGHT_ONE = 256;

struct CellFacts {
    uint32_t normal_class = 0; // how much the normal leans; 6: none
    uint32_t density = 0;      // children of coded neighbours, 0 .. 5; 6: none is coded
    uint32_t ratio = 0;        // leaves among the neighbours, 0 .. 4; 5: no neighbours
    uint32_t coded_ratio = 0;  // leaves among the children of coded neighbours, 0 .. 4; 5: none
    uint32_t degree = 0;       // neighbours, 0 .. 15
    uint32_t age = 0;          // of leaves among the neighbours, 0 .. 5; 6: none
    uint32_t spacing = 0;      // distance of the neighbours, a binary_logarithm, 0 .. 15
    uint32_t fit = 0;          // how far coded neighbours missed their planes, 0 .. 9; 10: none is coded; 11: no normal
    uint32_t recent = 0;       // children of the cells coded last, 0 .. 15
    uint32_t recent_leaves = 0;       // leaves among these, 0 .. 31
    uint32_t mirror = 0;              // 0: no mirror; 1: no image; 2 .. 4: an image, and how much to trust it
    uint32_t trusted = 0;             // 0: no image; 1: an image; 2: an image that deserves it
    std::array<int32_t, 8> heights{}; // of the middles of octants above the expected plane, by rank; -768 .. 256
    uint64_t faces = 0, edges = 0;    // touches of octants, in the frame's order of axes
};

struct OctantFacts {
    uint32_t rank, path, count;    // place in the order, what was found before, how many children that makes
    uint32_t beside;               // see above
    uint32_t vote, votes;          // at most 3, at most 7
    uint32_t faces, edges, corner; // touches
    uint32_t inhabited, bare;      // of seven
    uint32_t answer;               // of the image: 0 none, 1 empty, 2 occupied
    int32_t height;
};

struct ChildFacts {
    uint32_t octants;                         // by rank
    uint32_t count, inner, leaves;            // of children: all, known to be no leaf, known to be a leaf
    uint32_t vote, votes, leaf_votes;         // at most 3, 7, 7
    uint32_t beside;                          // children across faces, and whether there are two across edges
    uint32_t faces;                           // touches
    uint32_t touching_leaves, touching_inner; // of seven
    uint32_t answer;                          // of the image: 0 none, 1 no leaf, 2 leaf
    int32_t height;
};

// The greatest k up to 15 with 2^k <= value.
MESHTIDE_INLINE uint32_t binary_logarithm(float value) {
    int exponent = static_cast<int>(std::bit_cast<uint32_t>(value) >> 23) - 127;
    return static_cast<uint32_t>(std::clamp(exponent, 0, 15));
}

MESHTIDE_INLINE void describe(const Survey& s, CellFacts& facts) {
    uint32_t n = s.count, leaves = s.sum.leaf_count(), coded = s.sum.coded_count();
    uint32_t children = s.sum.child_count(), child_leaves = s.sum.child_leaf_count();
    facts.density = coded == 0 ? 6 : std::min((4 * children - 3 * coded) / (2 * coded), 5u);
    facts.ratio = n == 0 ? 5 : 4 * leaves / n;
    facts.coded_ratio = children == 0 ? 5 : std::min(5 * child_leaves / children, 4u);
    facts.degree = std::min(n, 15u);
    facts.age = leaves == 0 ? 6 : std::min(3 * s.sum.ages() / (2 * leaves), 5u);
    float distance = n == 0 ? 0 : s.length / static_cast<float>(n);
    distance *= distance;
    facts.spacing = binary_logarithm(distance * distance);
    facts.normal_class = 6;
    facts.fit = 11;
    if (s.oriented) {
        float third = 3.0f / s.normal[0];
        uint32_t second = std::min(static_cast<uint32_t>(s.normal[1] * third), 2u);
        facts.normal_class = second * (second + 1) / 2 + std::min(static_cast<uint32_t>(s.normal[2] * third), second);
        facts.fit =
            coded == 0 ? 10 : static_cast<uint32_t>(std::min(s.mean[3] * 8.0f / static_cast<float>(coded), 9.0f));
    }
    F32x4 low = F32x4{-1, -1, 1, 1} * splat(s.normal[1]) + F32x4{-1, 1, -1, 1} * splat(s.normal[2]);
    low = (low - splat(2 * s.height)) * splat(static_cast<float>(HEIGHT_ONE));
    F32x4 first = splat(s.normal[0] * static_cast<float>(HEIGHT_ONE));
    store(&facts.heights[0], truncate(low - first));
    store(&facts.heights[4], truncate(low + first));
    facts.faces = s.contacts.code(0, AXIS_ORDERS[s.order]);
    facts.edges = s.contacts.code(3, AXIS_ORDERS[s.order]);
}

} // namespace meshtide::inline MESHTIDE_ISA
