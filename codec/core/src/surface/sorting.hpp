// Sorting of numbers that carry a place with them: stable, by counting.
#pragma once

#include "base/lanes.hpp"
#include "base/memory.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

struct Keyed {
    uint64_t key; // of at most the bits that the sort is given
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
    constexpr size_t DIGITS = 1 << DIGIT, MOST_PASSES = 64 / DIGIT + 1;
    auto digit = [&](const Keyed& item, int shift) { return static_cast<size_t>(item.key >> shift & (DIGITS - 1)); };
    Array<Keyed> sorted(budget);
    Array<uint32_t> counts(budget);
    sorted.resize(items.size());
    counts.assign(MOST_PASSES * DIGITS, 0);
    for (const Keyed& item : items)
        for (int shift = 0; shift < bits; shift += DIGIT)
            counts[static_cast<size_t>(shift / DIGIT) * DIGITS + digit(item, shift)]++;
    for (int shift = 0; shift < bits; shift += DIGIT) {
        uint32_t* starts = counts.span().block(static_cast<size_t>(shift / DIGIT) * DIGITS, DIGITS);
        for (uint32_t start = 0, count, d = 0; d < DIGITS; d++, start += count) count = starts[d], starts[d] = start;
        for (const Keyed& item : items) sorted[starts[digit(item, shift)]++] = item;
        items.swap(sorted);
    }
}

} // namespace meshtide::inline MESHTIDE_ISA
