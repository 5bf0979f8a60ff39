// Sorting of numbers that carry a place with them: stable, by counting.
#pragma once

#include "base/lanes.hpp"
#include "base/memory.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

struct Keyed {
    uint64_t key; // of at most the bits that the sort is told
    uint32_t place;
};

// Ascending by key; what has the same key stays in its order.
inline void sort_keyed(Array<Keyed>& items, int bits, Budget& budget) {
    constexpr int DIGIT = 11;
    constexpr size_t FEW = 1500;
    if (items.size() < FEW) {
        std::sort(items.begin(), items.end(),
                  [](const Keyed& a, const Keyed& b) { return a.key != b.key ? a.key < b.key : a.place < b.place; });
        return;
    }
    Array<Keyed> sorted(budget);
    sorted.resize(items.size());
    for (int shift = 0; shift < bits; shift += DIGIT) {
        uint32_t starts[(1 << DIGIT) + 1] = {};
        auto digit = [&](const Keyed& item) { return static_cast<size_t>(item.key >> shift & ((1 << DIGIT) - 1)); };
        for (const Keyed& item : items) starts[digit(item) + 1]++;
        for (size_t d = 0; d < 1 << DIGIT; d++) starts[d + 1] += starts[d];
        for (const Keyed& item : items) sorted[starts[digit(item)]++] = item;
        items.swap(sorted);
    }
}

// The lowest 21 bits with two zeros between neighbours.
inline uint64_t spread_bits(uint64_t value) {
    value = (value | value << 32) & 0x1f00000000ffff;
    value = (value | value << 16) & 0x1f0000ff0000ff;
    value = (value | value << 8) & 0x100f00f00f00f00f;
    value = (value | value << 4) & 0x10c30c30c30c30c3;
    return (value | value << 2) & 0x1249249249249249;
}
// The place on a Morton curve, x highest, of coordinates below 2^21.
inline uint64_t morton_code(uint32_t x, uint32_t y, uint32_t z) {
    return spread_bits(x) << 2 | spread_bits(y) << 1 | spread_bits(z);
}

} // namespace meshtide::inline MESHTIDE_ISA
