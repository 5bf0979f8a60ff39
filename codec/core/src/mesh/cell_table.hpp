// Which vertex lives in a cell: the hash table behind both mirrors (docs/format.md, Cell table).
//
// It guides predictions only, so it may forget: an entry has one of 16 places from its home on, or none, and a cell is
// distinguished from others by 32 bits of its hash. Both directions forget alike. No stream makes a look-up longer than that.
#pragma once

#include "base/memory.hpp"

#include <bit>

namespace meshtide {

class CellTable {
public:
    explicit CellTable(Budget& budget) : entries_(budget) {}

    void give_back() { entries_.give_back(); }

    // Empties the table; `count` cells will come.
    void reset(size_t count) {
        int bits = static_cast<int>(std::bit_width(2 * count + 1));
        size_t size = static_cast<size_t>(1) << (bits < 2 ? 2 : bits);
        entries_.assign(size, Entry{0, FREE});
        mask_ = size - 1;
    }

    // A cell that is there already keeps its vertex.
    void put(uint32_t x, uint32_t y, uint32_t z, uint32_t vertex) {
        uint64_t hash = hash_of(x, y, z);
        for (size_t i = 0; i < PROBES; i++) {
            Entry& entry = entries_[(home_of(hash) + i) & mask_];
            if (entry.vertex == FREE) {
                entry = {tag_of(hash), vertex};
                return;
            }
            if (entry.tag == tag_of(hash)) return;
        }
    }

    // The vertex of a cell, or -1.
    int32_t find(uint32_t x, uint32_t y, uint32_t z) const {
        uint64_t hash = hash_of(x, y, z);
        for (size_t i = 0; i < PROBES; i++) {
            const Entry& entry = entries_[(home_of(hash) + i) & mask_];
            if (entry.vertex == FREE) return -1;
            if (entry.tag == tag_of(hash)) return static_cast<int32_t>(entry.vertex);
        }
        return -1;
    }

private:
    struct Entry {
        uint32_t tag, vertex;
    };
    static constexpr size_t PROBES = 16;
    static constexpr uint32_t FREE = 0xffffffffu; // vertices are below 2^31

    // Of coordinates below 2^21. Two products, so that the home (upper half) and the tag (lower half) depend on all
    // bits.
    static uint64_t hash_of(uint32_t x, uint32_t y, uint32_t z) {
        uint64_t hash = (static_cast<uint64_t>(x) << 42 | static_cast<uint64_t>(y) << 21 | z) * 0x9E3779B97F4A7C15u;
        return (hash ^ hash >> 32) * 0xD6E8FEB86659FD93u;
    }
    static size_t home_of(uint64_t hash) { return static_cast<size_t>(hash >> 32); }
    static uint32_t tag_of(uint64_t hash) { return static_cast<uint32_t>(hash); }

    Array<Entry> entries_;
    size_t mask_ = 0;
};

} // namespace meshtide
