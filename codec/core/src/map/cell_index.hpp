// Where a cell is found again: its mirror image and its neighbours (docs/format.md, Mirror).
#pragma once

#include "map/note.hpp"
#include "map/octants.hpp"
#include "mesh/cell_table.hpp"
#include "mesh/level.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// A plane across an axis takes finest coordinate x to sum - x. Axis -1: none.
struct MapMirror {
    int axis = -1;
    int32_t sum = 0;
};

typedef std::array<uint32_t, 3> Cell;

// The cells of a depth that are no leaves.
class CellIndex {
public:
    explicit CellIndex(Budget& budget) : table_(budget) {}

    void prepare(const Level& level, int bits) {
        shift_ = bits - level.depth;
        limit_ = 1u << level.depth;
        size_t inner = 0;
        for (uint8_t leaf : level.leaves) inner += leaf == 0;
        table_.reset(inner);
        for (size_t v = 0; v < level.vertex_count(); v++) {
            if (level.leaves[v] != 0) continue;
            Cell cell = cell_of(level.centres[v]);
            table_.put(cell[0], cell[1], cell[2], static_cast<uint32_t>(v));
        }
    }

    Cell cell_of(F32x4 centre) const {
        I32x4 whole = truncate(centre);
        Cell cell;
        for (size_t k = 0; k < 3; k++) cell[k] = static_cast<uint32_t>(whole[k]) >> (shift_ + 1);
        return cell;
    }
    // The vertex of a cell, or -1. Coordinates below 0 wrap around.
    int32_t find(const Cell& cell) const {
        if (cell[0] >= limit_ || cell[1] >= limit_ || cell[2] >= limit_) return -1;
        return table_.find(cell[0], cell[1], cell[2]);
    }

    // The children of the image of cell v, reflected: those of each of its halves that has an image. False if none has
    // one, or one's image is not before v.
    bool find_image(const MapMirror& mirror, F32x4 centre, size_t v, Span<const Note> notes, Children& image) const {
        auto axis = static_cast<size_t>(mirror.axis);
        Cell cell = cell_of(centre);
        bool known = false;
        image = {};
        for (uint32_t half = 0; half < 2; half++) {
            // In half finest steps, the middle of this half and of its image; half a cell has 2^shift_ of them.
            int64_t middle = (4 * static_cast<int64_t>(cell[axis]) + 2 * half + 1) << (shift_ - 1);
            int64_t landing = (2 * (static_cast<int64_t>(mirror.sum) + 1) - middle) >> shift_;
            if (landing < 0 || landing >> 1 >= limit_) continue;
            Cell there = cell;
            there[axis] = static_cast<uint32_t>(landing >> 1);
            int32_t w = find(there);
            if (w < 0) continue;
            if (static_cast<size_t>(w) >= v) return false;
            Children other = notes[static_cast<size_t>(w)].children();
            if (static_cast<uint32_t>(landing & 1) != half) {
                other.octants = flipped(other.octants, axis);
                other.leaves = flipped(other.leaves, axis);
            }
            uint32_t side = UPPER_HALF[axis] ^ (half != 0 ? 0 : 0xff);
            image.octants |= other.octants & side;
            image.leaves |= other.leaves & side;
            known = true;
        }
        return known;
    }

private:
    CellTable table_;
    int shift_ = 1; // half a cell has 2^shift_ half finest steps
    uint32_t limit_ = 0;
};

} // namespace meshtide::inline MESHTIDE_ISA
