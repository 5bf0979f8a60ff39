// The eight octants of a cell as bits of a mask, and as the bytes of a word.
//
// Octant o has bit 4 for the upper half in x, 2 in y, 1 in z.
#pragma once

#include "base/lanes.hpp"

#include <array>

namespace meshtide::inline MESHTIDE_ISA {

// The octants in the upper half along axis 0, 1, 2.
constexpr std::array<uint32_t, 3> UPPER_HALF = {0xf0, 0xcc, 0xaa};

// A mask with the octants on both sides of the middle along the axis exchanged.
MESHTIDE_INLINE uint32_t flipped(uint32_t mask, int axis) {
    int shift = 4 >> axis;
    uint32_t upper = UPPER_HALF[static_cast<size_t>(axis)];
    return (mask & upper) >> shift | (mask << shift & upper);
}

// Byte o is bit o of the mask.
MESHTIDE_INLINE uint64_t spread(uint32_t mask) {
    constexpr uint64_t each = 0x0101010101010101u;
    uint64_t bits = mask * each & 0x8040201008040201u;
    return (bits + 0x7f7f7f7f7f7f7f7fu) >> 7 & each; // bit 7 of a byte that is not 0, without carries between bytes
}

MESHTIDE_INLINE uint32_t byte_of(uint64_t word, uint32_t index) {
    return static_cast<uint32_t>(word >> (8 * index)) & 0xff;
}

} // namespace meshtide::inline MESHTIDE_ISA
