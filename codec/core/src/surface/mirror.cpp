#include "surface/mirror.hpp"

#include <algorithm>
#include <bit>
#include <cstdlib>

namespace meshtide::inline MESHTIDE_ISA {

namespace {

constexpr double SMALLEST_SHARE = 0.25; // of vertices with a mirror image: the symmetry is worth its contexts
constexpr size_t SAMPLE = 3000;         // vertices that candidates are judged by
constexpr uint64_t NO_KEY = UINT64_MAX;

uint64_t scattered(uint64_t key) { return (key ^ key >> 29) * 0x9e3779b97f4a7c15; }

// One number for a place, with room for two steps beyond the grid on either side.
uint64_t packed(const int32_t* at) {
    return static_cast<uint64_t>(at[0] + 2) << 44 | static_cast<uint64_t>(at[1] + 2) << 22 |
           static_cast<uint64_t>(at[2] + 2);
}

// A hash table of places, with a filter of single bits before it that answers most questions for what is not there.
class Places {
public:
    Places(Span<const int32_t> positions, Budget& budget) : filter_(budget), table_(budget) {
        size_t size = std::bit_ceil(positions.size() / 3 * 2 + 2);
        shift_ = 64 - std::countr_zero(size);
        table_.assign(size, NO_KEY);
        filter_.assign(size / 4 + 1, 0); // sixteen bits for each place of the table
        for (size_t i = 0; i + 2 < positions.size(); i += 3) {
            uint64_t key = packed(positions.block(i, 3)), hash = scattered(key);
            size_t slot = static_cast<size_t>(hash >> shift_);
            while (table_[slot] != NO_KEY) slot = (slot + 1) & (size - 1);
            table_[slot] = key;
            filter_[slot_of_filter(hash)] |= 1ull << (hash >> 8 & 63);
        }
    }
    bool has(uint64_t key) const {
        uint64_t hash = scattered(key);
        if ((filter_[slot_of_filter(hash)] >> (hash >> 8 & 63) & 1) == 0) return false;
        for (size_t slot = static_cast<size_t>(hash >> shift_); table_[slot] != NO_KEY;
             slot = (slot + 1) & (table_.size() - 1))
            if (table_[slot] == key) return true;
        return false;
    }

private:
    size_t slot_of_filter(uint64_t hash) const { return static_cast<size_t>(hash >> shift_ >> 2); }

    int shift_ = 0;
    Array<uint64_t> filter_, table_;
};

// The most frequent sum of the least and the greatest coordinate along `axis` of vertices that agree in the other two;
// the least of several. -1 if there are none.
int32_t frequent_sum(Span<const int32_t> positions, size_t axis, Budget& budget) {
    struct Line {
        uint64_t key;
        int32_t low, high;
    };
    Array<Line> lines(budget);
    size_t size = std::bit_ceil(positions.size() / 3 * 2 + 2);
    int shift = 64 - std::countr_zero(size);
    lines.assign(size, Line{NO_KEY, 0, 0});
    int32_t greatest = 0;
    for (size_t i = 0; i + 2 < positions.size(); i += 3) {
        const int32_t* at = positions.block(i, 3);
        int32_t along = at[axis];
        uint64_t key = static_cast<uint64_t>(at[(axis + 1) % 3]) << 32 | static_cast<uint32_t>(at[(axis + 2) % 3]);
        size_t slot = static_cast<size_t>(scattered(key) >> shift);
        while (lines[slot].key != NO_KEY && lines[slot].key != key) slot = (slot + 1) & (size - 1);
        Line& line = lines[slot];
        if (line.key == NO_KEY) line = {key, along, along};
        line.low = std::min(line.low, along);
        line.high = std::max(line.high, along);
        greatest = std::max(greatest, along);
    }
    Array<uint32_t> counts(budget);
    counts.assign(2 * static_cast<size_t>(greatest) + 1, 0);
    int32_t best = -1;
    for (const Line& line : lines)
        if (line.key != NO_KEY && line.low != line.high) counts[static_cast<size_t>(line.low + line.high)]++;
    for (size_t sum = 0; sum < counts.size(); sum++)
        if (counts[sum] > (best < 0 ? 0 : counts[static_cast<size_t>(best)])) best = static_cast<int32_t>(sum);
    return best;
}

// Share of some vertices off the plane with a vertex at their image: mean of exactly and within a step. Gives up, with
// 0, where it cannot exceed `least` any more.
double mirrored_share(Span<const int32_t> positions, const Places& places, MirrorPlane mirror, double least) {
    auto axis = static_cast<size_t>(mirror.axis);
    size_t n = positions.size() / 3, stride = std::max<size_t>(1, n / SAMPLE);
    size_t off_plane = 0, left = 0, found = 0; // found counts halves
    for (size_t v = 0; v < n; v += stride) off_plane += std::abs(2 * positions[3 * v + axis] - mirror.sum) > 2;
    left = off_plane;
    double wanted = 2.0 * least * static_cast<double>(std::max<size_t>(1, off_plane));
    for (size_t v = 0; v < n; v += stride) {
        int32_t image[3];
        std::copy_n(positions.block(3 * v, 3), 3, image);
        if (std::abs(2 * image[axis] - mirror.sum) <= 2) continue;
        if (static_cast<double>(found + 2 * left) <= wanted) return 0.0;
        left--;
        image[axis] = mirror.sum - image[axis];
        if (image[axis] < -1 || image[axis] >= 1 << 21) continue;
        if (places.has(packed(image))) {
            found += 2;
            continue;
        }
        bool near = false;
        for (int32_t step = 0; step < 27 && !near; step++) {
            int32_t moved[3] = {image[0] + step / 9 - 1, image[1] + step / 3 % 3 - 1, image[2] + step % 3 - 1};
            near = places.has(packed(moved));
        }
        found += near;
    }
    return 0.5 * static_cast<double>(found) / static_cast<double>(std::max<size_t>(1, off_plane));
}

} // namespace

MirrorPlane find_mirror(Span<const int32_t> positions, Budget& budget) {
    MirrorPlane best;
    if (positions.size() < 3) return best;
    Places places(positions, budget);
    double best_share = SMALLEST_SHARE;
    for (int axis = 0; axis < 3; axis++) {
        int32_t low = INT32_MAX, high = 0;
        for (size_t i = static_cast<size_t>(axis); i < positions.size(); i += 3) {
            low = std::min(low, positions[i]);
            high = std::max(high, positions[i]);
        }
        int32_t middle = low + high;
        int32_t sums[4] = {std::max(middle - 1, 0), middle, middle + 1,
                           frequent_sum(positions, static_cast<size_t>(axis), budget)};
        std::sort(sums, sums + 4);
        for (size_t i = 0; i < 4; i++) {
            if (sums[i] < 0 || (i > 0 && sums[i] == sums[i - 1])) continue;
            double share = mirrored_share(positions, places, {axis, sums[i]}, best_share);
            if (share > best_share) best_share = share, best = {axis, sums[i]};
        }
    }
    return best;
}

} // namespace meshtide::inline MESHTIDE_ISA
