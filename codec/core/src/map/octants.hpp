// The eight octants of a cell as the bits of a mask, and as the bytes of a word.
//
// Octant o has bit 4 for the upper half in x, 2 in y, 1 in z. Sets of axes have bit 0 for x, 1 for y, 2 for z, as the
// signs of vectors come.
#pragma once

#include "base/lanes.hpp"

#include <array>

namespace meshtide::inline MESHTIDE_ISA {

// The octants in the upper half along axis 0, 1, 2.
constexpr std::array<uint32_t, 3> UPPER_HALF = {0xf0, 0xcc, 0xaa};

// A set of axes as the bits of an octant.
constexpr uint32_t octant_bits(uint32_t axes) { return (axes & 1) << 2 | (axes & 2) | (axes >> 2 & 1); }

// A mask with the octants on both sides of the middle along the axis exchanged.
MESHTIDE_INLINE uint32_t flipped(uint32_t mask, size_t axis) {
    int shift = 4 >> axis;
    uint32_t upper = UPPER_HALF[axis];
    return (mask & upper) >> shift | (mask << shift & upper);
}
MESHTIDE_INLINE uint32_t flipped_along(uint32_t mask, uint32_t axes) {
    for (size_t axis = 0; axis < 3; axis++) mask = (axes >> axis & 1) != 0 ? flipped(mask, axis) : mask;
    return mask;
}

// Byte o is 1 if bit o of the mask is set, else 0.
MESHTIDE_INLINE constexpr uint64_t spread(uint32_t mask) {
    constexpr uint64_t each = 0x0101010101010101u;
    uint64_t bits = mask * each & 0x8040201008040201u; // byte o has nothing but bit o
    return (bits + 0x7f7f7f7f7f7f7f7fu) >> 7 & each;   // no byte carries into the next
}
MESHTIDE_INLINE uint32_t byte_of(uint64_t word, uint32_t index) {
    return static_cast<uint32_t>(word >> (8 * index)) & 0xff;
}

} // namespace meshtide::inline MESHTIDE_ISA
