#include "diff/slice.hpp"

namespace meshtide::inline MESHTIDE_ISA {

namespace {

// The Morton code of the lowest finest step in a vertex' cell.
uint64_t code_of(const Level& level, size_t vertex, int bits) {
    int side = bits - level.cell_depths[vertex];
    F32x4 centre = level.centres[vertex];
    uint32_t cell[3];
    for (int k = 0; k < 3; k++) cell[k] = static_cast<uint32_t>(centre[k]) >> (side + 1) << side;
    uint64_t code = 0;
    for (int i = bits - 1; i >= 0; i--)
        for (int k = 0; k < 3; k++) code = code << 1 | (cell[k] >> i & 1);
    return code;
}

size_t first_not_before(const Level& level, uint64_t code, int bits) {
    size_t low = 0, high = level.vertex_count();
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (code_of(level, middle, bits) < code)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

} // namespace

DiffSlice::DiffSlice(Budget& budget, SliceRange range, MirrorPlane mirror)
    : budget_(budget), range_(range), mirror_(mirror), rows_(budget), leaf_depths_(budget), ring_starts_(budget),
      ring_closed_(budget), neighbours_(budget), partners_(budget), likenesses_(budget), old_rows_(budget),
      moved_(budget) {}

DiffSlice::Run DiffSlice::run_of(const Level& level) const {
    size_t first = range_.first == 0 ? 0 : first_not_before(level, range_.first, range_.bits);
    bool last = range_.end >> (3 * range_.bits) != 0;
    return {first, last ? level.vertex_count() : first_not_before(level, range_.end, range_.bits)};
}

void DiffSlice::enter(const Level& level) {
    if (level_depth_ >= 0 && level.depth != level_depth_ + 1)
        fail(Fault::argument, "a slice of Diffs goes from one level to the next");
    if (level_depth_ >= 0 && known_depth_ != level_depth_)
        fail(Fault::argument, "a Diff of the level before is missing");
    Run old = run_;
    size_t old_count = old.end - old.first;
    old_rows_.swap(rows_);
    run_ = run_of(level);
    size_t count = run_.end - run_.first;
    rows_.resize(count);
    if (mirror_.axis >= 0) moved_.assign(old_count, NONE);
    Array<int32_t> partners(budget_);
    Array<Likeness> likenesses(budget_);
    if (mirror_.axis >= 0) {
        partners.assign(count, NONE);
        likenesses.assign(count, Likeness::undecided);
    }
    Array<uint8_t> leaf_depths(budget_);
    leaf_depths.resize(count);
    auto depth = static_cast<float>(level.depth);
    for (size_t i = 0; i < count; i++) {
        size_t vertex = run_.first + i, parent = level.parents[vertex] - old.first;
        bool leaf = level.leaves[vertex] != 0;
        leaf_depths[i] = leaf ? level.cell_depths[vertex] : NO_LEAF;
        if (parent < old_count && leaf_depths_[parent] != NO_LEAF) {
            rows_[i] = old_rows_[parent];
            if (mirror_.axis >= 0) {
                moved_[parent] = static_cast<int32_t>(i);
                partners[i] = partners_[parent]; // still an old row
                likenesses[i] = likenesses_[parent];
            }
        } else {
            F32x4 position = level.centres[vertex];
            position[3] = depth;
            rows_[i] = {position, F32x4{0, 0, 0, NEW_ERROR}};
        }
    }
    for (int32_t& partner : partners)
        if (partner >= 0) partner = moved_[static_cast<size_t>(partner)];
    partners_.swap(partners);
    likenesses_.swap(likenesses);
    leaf_depths_.swap(leaf_depths);
    known_depth_ = level_depth_ < 0 ? 0 : known_depth_;
    level_depth_ = level.depth;
    gather_rings(level);
}

// A vertex as a row: its own, or a new one that stands still if it is another slice's.
int32_t DiffSlice::row_of(const Level& level, int32_t vertex) {
    size_t place = static_cast<size_t>(vertex) - run_.first;
    if (place < run_.end - run_.first) return static_cast<int32_t>(place);
    F32x4 position = level.centres[static_cast<size_t>(vertex)];
    position[3] = -1;
    rows_.push({position, F32x4{0, 0, 0, FOREIGN_ERROR}});
    return static_cast<int32_t>(rows_.size() - 1);
}

void DiffSlice::gather_rings(const Level& level) {
    size_t count = run_.end - run_.first;
    ring_starts_.resize(count + 1);
    ring_closed_.resize(count);
    neighbours_.clear();
    for (size_t i = 0; i < count; i++) {
        ring_starts_[i] = static_cast<uint32_t>(neighbours_.size());
        int32_t head = level.heads[run_.first + i], h = head;
        bool closed = false;
        int members = 0;
        while (h >= 0 && members < RING_LIMIT) {
            int32_t ahead = next_half_edge(h), before = previous_half_edge(h);
            int32_t back = level.twins[static_cast<size_t>(ahead)];
            int32_t across = back < 0 ? NONE : level.corners[static_cast<size_t>(previous_half_edge(back))];
            DiffNeighbour neighbour;
            neighbour.member = row_of(level, level.corners[static_cast<size_t>(ahead)]);
            neighbour.across = across < 0 ? NONE : row_of(level, across);
            neighbours_.push(neighbour);
            members++;
            h = level.twins[static_cast<size_t>(before)];
            if (h < 0) // a border: the last member has no face behind it
                neighbours_.push({row_of(level, level.corners[static_cast<size_t>(before)]), NONE});
            else if (h == head) {
                closed = true;
                break;
            }
        }
        if (members == RING_LIMIT && !closed && h >= 0) neighbours_.back().across = NONE;
        ring_closed_[i] = closed;
    }
    ring_starts_[count] = static_cast<uint32_t>(neighbours_.size());
}

void DiffSlice::tell(const Level& level, Span<F32x4> known) const {
    Run run = run_of(level);
    size_t own = 0, own_count = run_.end - run_.first;
    for (size_t vertex = run.first; vertex < run.end; vertex++) {
        F32x4 middle = level.centres[vertex];
        middle[3] = level.cell_depths[vertex];
        // Leaves stand in the same order in all levels.
        if (level.leaves[vertex] != 0 && level.cell_depths[vertex] <= known_depth_) {
            while (own < own_count && leaf_depths_[own] > level.depth) own++;
            if (own < own_count) middle = rows_[own++].position;
        }
        known[vertex] = middle;
    }
}

} // namespace meshtide::inline MESHTIDE_ISA
