// Morton codes: the bits of three coordinates in turn, x highest.
#pragma once

#include <cstdint>

namespace meshtide {

// The lowest 21 bits with two zeros between neighbours.
inline uint64_t spread_bits(uint64_t value) {
    value = (value | value << 32) & 0x1f00000000ffff;
    value = (value | value << 16) & 0x1f0000ff0000ff;
    value = (value | value << 8) & 0x100f00f00f00f00f;
    value = (value | value << 4) & 0x10c30c30c30c30c3;
    return (value | value << 2) & 0x1249249249249249;
}
// Of coordinates below 2^21.
inline uint64_t morton_code(uint32_t x, uint32_t y, uint32_t z) {
    return spread_bits(x) << 2 | spread_bits(y) << 1 | spread_bits(z);
}
inline uint64_t morton_code(const int32_t* position) {
    return morton_code(static_cast<uint32_t>(position[0]), static_cast<uint32_t>(position[1]),
                       static_cast<uint32_t>(position[2]));
}

} // namespace meshtide
