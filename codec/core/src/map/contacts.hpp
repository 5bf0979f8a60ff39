// The cells that touch a cell: across its faces, its edges and its corners, and which of their children lie there.
//
// An octant touches three cells across faces, three across edges and one across a corner of its own cell, so one word
// for each of these seven directions says of all octants what is there.
#pragma once

#include "map/note.hpp"
#include "map/octants.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// What touches an octant in some direction.
enum Touch : uint32_t { NO_CELL = 0, NO_CHILD = 1, CHILD = 2, LATER_CELL = 3 };

struct Contacts {
    // Of each octant a Touch: across the face in x, y, z; across the edge along x, y, z; across the corner.
    std::array<uint64_t, 7> touches{};
    // How many of the seven hold a cell that is coded, a child, and a child that is a leaf.
    uint64_t cells = 0, children = 0, leaves = 0;

    // The neighbour one cell away along these axes, upwards where `positive` has the axis.
    void add(uint32_t axes, uint32_t positive, Note note) {
        uint64_t there = SIDES[axes][positive & axes]; // the octants that touch it
        if (!note.is_coded()) {
            touches[DIRECTIONS[axes]] |= LATER_CELL * there;
            return;
        }
        uint64_t inhabited = spread(flipped_along(note.children().octants, axes)) & there * 0xff;
        touches[DIRECTIONS[axes]] |= there + inhabited;
        cells += there;
        children += inhabited;
        leaves += spread(flipped_along(note.children().leaves, axes)) & there * 0xff;
    }

    // Touches of the three faces, or edges from 3 on, of all octants, base 4, in an order of the axes.
    uint64_t code(size_t kind, const std::array<uint8_t, 3>& axes) const {
        return touches[kind + axes[0]] << 4 | touches[kind + axes[1]] << 2 | touches[kind + axes[2]];
    }

private:
    static constexpr std::array<uint8_t, 8> DIRECTIONS = {0, 0, 1, 5, 2, 4, 3, 6}; // by set of axes
    static constexpr std::array<std::array<uint64_t, 8>, 8> make_sides() {
        std::array<std::array<uint64_t, 8>, 8> sides{};
        for (uint32_t axes = 0; axes < 8; axes++)
            for (uint32_t positive = 0; positive < 8; positive++)
                for (uint32_t octant = 0; octant < 8; octant++)
                    if (((octant ^ octant_bits(positive)) & octant_bits(axes)) == 0)
                        sides[axes][positive] |= static_cast<uint64_t>(1) << (8 * octant);
        return sides;
    }
    static const std::array<std::array<uint64_t, 8>, 8> SIDES;
};
inline constexpr std::array<std::array<uint64_t, 8>, 8> Contacts::SIDES = Contacts::make_sides();

} // namespace meshtide::inline MESHTIDE_ISA
