// What a neighbour contributes.
#pragma once

#include "base/lanes.hpp"

#include <bit>

namespace meshtide::inline MESHTIDE_ISA {

struct Children {
    uint32_t octants = 0, leaves = 0; // masks: which there are, which of these are leaves
};

// One word, so that a ring is added up in one sum. From the lowest bit: leaves (1), cells that are coded (1), their
// children (1 .. 8), leaves among these (0 .. 8), 8 bits each; the age of a leaf, 16 bits; then masks of the children
// that are leaves, and of all, 8 bits each, which mean nothing in a sum. All zero: a cell that is not coded yet.
class Note {
public:
    Note() = default;
    static Note leaf(uint32_t age) { return Note(1u | static_cast<uint64_t>(age) << 32); }
    static Note cell(Children made) {
        auto children = static_cast<uint64_t>(std::popcount(made.octants));
        auto leaves = static_cast<uint64_t>(std::popcount(made.leaves));
        return Note(static_cast<uint64_t>(1) << 8 | children << 16 | leaves << 24 |
                    static_cast<uint64_t>(made.leaves) << 48 | static_cast<uint64_t>(made.octants) << 56);
    }

    bool is_leaf() const { return (bits_ & 1) != 0; }
    bool is_coded() const { return bits_ >> 56 != 0; }
    Children children() const {
        return {static_cast<uint32_t>(bits_ >> 56), static_cast<uint32_t>(bits_ >> 48) & 0xff};
    }

    // Sums of at most 25 notes.
    void add(Note other) { bits_ += other.bits_; }
    uint32_t leaf_count() const { return field(0); }
    uint32_t coded_count() const { return field(8); }
    uint32_t child_count() const { return field(16); }
    uint32_t child_leaf_count() const { return field(24); }
    uint32_t ages() const { return static_cast<uint32_t>(bits_ >> 32) & 0xffff; }

private:
    explicit Note(uint64_t bits) : bits_(bits) {}
    uint32_t field(int shift) const { return static_cast<uint32_t>(bits_ >> shift) & 0xff; }

    uint64_t bits_ = 0;
};

} // namespace meshtide::inline MESHTIDE_ISA
