// What the mirror image of a cell has for children (docs/format.md, Mirror).
#pragma once

#include "map/octants.hpp"
#include "mesh/cell_table.hpp"
#include "mesh/level.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// A plane across an axis takes finest coordinate x to sum - x. Axis -1: none.
struct MapMirror {
    int axis = -1;
    int32_t sum = 0;
};

struct Children {
    uint32_t octants = 0, leaves = 0; // masks
};

// The cells of a depth that are no leaves, as the places where mirror images land.
class MirrorImages {
public:
    explicit MirrorImages(Budget& budget) : table_(budget) {}

    void prepare(const MapMirror& mirror, const Level& coarse, int bits) {
        mirror_ = mirror;
        if (mirror.axis < 0) return;
        shift_ = bits - coarse.depth;
        limit_ = static_cast<int64_t>(1) << coarse.depth;
        size_t inner = 0;
        for (uint8_t leaf : coarse.leaves) inner += leaf == 0;
        table_.reset(inner);
        for (size_t v = 0; v < coarse.vertex_count(); v++) {
            if (coarse.leaves[v] != 0) continue;
            Cell cell = cell_of(coarse.centres[v]);
            table_.put(cell[0], cell[1], cell[2], static_cast<uint32_t>(v));
        }
    }
    bool present() const { return mirror_.axis >= 0; }

    // The children of the image of cell v, reflected: those of each half whose image is known. False if no half's is, or
    // one stands behind v. `coded(w)` gives the Children of an earlier cell.
    template <class Coded>
    bool find(const Level& coarse, size_t v, const Coded& coded, Children& image) const {
        auto axis = static_cast<size_t>(mirror_.axis);
        Cell cell = cell_of(coarse.centres[v]);
        bool known = false;
        image = {};
        for (uint32_t half = 0; half < 2; half++) {
            // In half finest steps, the image of the middle of this half; shift_ of them is half a cell.
            int64_t middle = (4 * static_cast<int64_t>(cell[axis]) + 2 * half + 1) << (shift_ - 1);
            int64_t landing = (2 * (static_cast<int64_t>(mirror_.sum) + 1) - middle) >> shift_;
            Cell there = cell;
            if (landing < 0 || landing >> 1 >= limit_) continue;
            there[axis] = static_cast<uint32_t>(landing >> 1);
            int32_t w = table_.find(there[0], there[1], there[2]);
            if (w < 0) continue;
            if (static_cast<size_t>(w) >= v) return false;
            Children other = coded(static_cast<size_t>(w));
            auto other_half = static_cast<uint32_t>(landing & 1);
            uint32_t side = UPPER_HALF[axis] ^ (half != 0 ? 0 : 0xff);
            bool turned = other_half != half;
            image.octants |= (turned ? flipped(other.octants, mirror_.axis) : other.octants) & side;
            image.leaves |= (turned ? flipped(other.leaves, mirror_.axis) : other.leaves) & side;
            known = true;
        }
        return known;
    }

private:
    typedef std::array<uint32_t, 3> Cell;
    Cell cell_of(F32x4 centre) const {
        I32x4 whole = truncate(centre);
        Cell cell;
        for (size_t k = 0; k < 3; k++) cell[k] = static_cast<uint32_t>(whole[k]) >> (shift_ + 1);
        return cell;
    }

    CellTable table_;
    MapMirror mirror_;
    int shift_ = 1;
    int64_t limit_ = 0;
};

} // namespace meshtide::inline MESHTIDE_ISA
