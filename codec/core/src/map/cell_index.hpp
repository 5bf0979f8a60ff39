// Where cells are found again: mirror images and neighbours (docs/format.md, Mirror).
#pragma once

#include "map/note.hpp"
#include "map/octants.hpp"
#include "mesh/cell_table.hpp"
#include "mesh/level.hpp"
#include "mesh/mirror_plane.hpp"

namespace meshtide::inline MESHTIDE_ISA {

typedef std::array<uint32_t, 3> Cell;

// The cells one away along these axes, upwards where `positive` has the axis.
struct Direction {
    uint32_t axes, positive;
};
constexpr std::array<Direction, 26> make_directions() {
    std::array<Direction, 26> directions{};
    size_t count = 0;
    for (uint32_t axes = 1; axes < 8; axes++)
        for (uint32_t positive = 0; positive < 8; positive++)
            if ((positive & ~axes) == 0) directions[count++] = {axes, positive};
    return directions;
}
inline constexpr auto DIRECTIONS = make_directions();

// The cells of a depth that are no leaves.
class CellIndex {
public:
    explicit CellIndex(Budget& budget) : table_(budget), filter_(budget) {}

    void give_back() {
        table_.give_back();
        filter_.give_back();
    }

    void prepare(const Level& level, int bits) {
        shift_ = bits - level.depth;
        limit_ = 1u << level.depth;
        size_t inner = 0;
        for (uint8_t leaf : level.leaves) inner += leaf == 0;
        table_.reset(inner);
        int bits_of_filter = static_cast<int>(std::bit_width(inner | 7)) + 3; // 8 to 16 a cell
        filter_.assign(static_cast<size_t>(1) << (bits_of_filter - 6), 0);
        filter_shift_ = 64 - bits_of_filter;
        for (size_t v = 0; v < level.vertex_count(); v++) {
            if (level.leaves[v] != 0) continue;
            Cell cell = cell_of(level.centres[v]);
            table_.put(cell[0], cell[1], cell[2], static_cast<uint32_t>(v));
            uint64_t bit = hash_of(cell[0], cell[1], cell[2]) >> filter_shift_;
            filter_[static_cast<size_t>(bit >> 6)] |= static_cast<uint64_t>(1) << (bit & 63);
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

    // Calls `found(direction, vertex)` for each of the 26 neighbours that there is. Most are not, which one bit shows.
    template <class Found>
    MESHTIDE_INLINE void find_neighbours(F32x4 centre, const Found& found) const {
        Cell home = cell_of(centre);
        uint64_t hash = hash_of(home[0], home[1], home[2]);
        const uint64_t* words = filter_.begin(); // filter_shift_ leaves no bit behind its end
        uint32_t perhaps = 0;
        for (size_t i = 0; i < DIRECTIONS.size(); i++) {
            uint64_t bit = (hash + STEPS[i]) >> filter_shift_;
            perhaps |= static_cast<uint32_t>(words[bit >> 6] >> (bit & 63) & 1) << i;
        }
        for (; perhaps != 0; perhaps &= perhaps - 1) {
            const Direction& direction = DIRECTIONS[static_cast<size_t>(std::countr_zero(perhaps))];
            Cell cell = home;
            for (uint32_t k = 0; k < 3; k++)
                cell[k] += (direction.axes >> k & 1) * (2 * (direction.positive >> k & 1) - 1);
            int32_t w = find(cell);
            if (w >= 0) found(direction, static_cast<size_t>(w));
        }
    }

    // The children of the image of cell v, reflected: those of each of its halves that has an image. False if none has
    // one, or one's image is not before v.
    bool find_image(const MirrorPlane& mirror, F32x4 centre, size_t v, Span<const Note> notes, Children& image) const {
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
    // Linear in the coordinates, modulo 2^64: that of a neighbour is so much more.
    static constexpr uint64_t hash_of(uint64_t x, uint64_t y, uint64_t z) {
        return ((x << 42) + (y << 21) + z) * 0x9E3779B97F4A7C15u;
    }
    static constexpr std::array<uint64_t, 26> make_steps() {
        std::array<uint64_t, 26> steps{};
        for (size_t i = 0; i < steps.size(); i++) {
            std::array<uint64_t, 3> step{};
            for (uint32_t k = 0; k < 3; k++)
                if ((DIRECTIONS[i].axes >> k & 1) != 0) step[k] = (DIRECTIONS[i].positive >> k & 1) != 0 ? 1 : ~0ull;
            steps[i] = hash_of(step[0], step[1], step[2]);
        }
        return steps;
    }
    static const std::array<uint64_t, 26> STEPS;

    CellTable table_;
    Array<uint64_t> filter_; // a bit for the hash of each cell
    int filter_shift_ = 0;
    int shift_ = 1; // half a cell has 2^shift_ half finest steps
    uint32_t limit_ = 0;
};
inline constexpr std::array<uint64_t, 26> CellIndex::STEPS = CellIndex::make_steps();

} // namespace meshtide::inline MESHTIDE_ISA
