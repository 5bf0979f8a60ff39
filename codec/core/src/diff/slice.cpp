#include "diff/slice.hpp"

#include "mesh/morton.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

namespace {

// The Morton code of the lowest finest step in a vertex' cell.
uint64_t code_of(const Level& level, size_t vertex, int bits) {
    int side = bits - level.cell_depths[vertex];
    uint32_t steps[3];
    for (int k = 0; k < 3; k++) steps[k] = static_cast<uint32_t>(level.centres[vertex][k]) >> (side + 1) << side;
    return morton_code(steps[0], steps[1], steps[2]);
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
      neighbours_(budget), closed_(budget), shares_(budget), partners_(budget), likenesses_(budget), old_rows_(budget),
      old_leaf_depths_(budget), old_partners_(budget), moved_(budget), old_likenesses_(budget) {}

DiffSlice::Run DiffSlice::run_of(const Level& level) const {
    size_t first = range_.first == 0 ? 0 : first_not_before(level, range_.first, range_.bits);
    bool last = range_.end >> (3 * range_.bits) != 0;
    size_t end = last ? level.vertex_count() : first_not_before(level, range_.end, range_.bits);
    return {first, std::max(first, end)};
}

void DiffSlice::enter(const Level& level) {
    if (level.depth != level_depth_ + 1 || known_depth_ != std::max(level_depth_, 0))
        fail(Fault::argument, "a slice goes from level to level, when the Diffs of each are known");
    old_rows_.swap(rows_);
    old_leaf_depths_.swap(leaf_depths_);
    old_partners_.swap(partners_);
    old_likenesses_.swap(likenesses_);
    Run old = run_;
    run_ = run_of(level);
    size_t count = run_.count();
    rows_.renew(count);
    leaf_depths_.renew(count);
    if (mirror_.exists()) {
        partners_.assign(count, NONE);
        likenesses_.assign(count, Likeness::undecided);
        moved_.assign(old.count(), NONE);
    }
    for (size_t i = 0; i < count; i++) {
        size_t vertex = run_.first + i, parent = level.parents[vertex] - old.first;
        leaf_depths_[i] = level.leaves[vertex] != 0 ? level.cell_depths[vertex] : NO_LEAF;
        if (parent < old.count() && old_leaf_depths_[parent] != NO_LEAF) { // it was a leaf before
            rows_[i] = old_rows_[parent];
            if (mirror_.exists()) {
                moved_[parent] = static_cast<int32_t>(i);
                partners_[i] = old_partners_[parent]; // for now as it was called there
                likenesses_[i] = old_likenesses_[parent];
            }
        } else {
            F32x4 position = level.centres[vertex];
            position[3] = static_cast<float>(level.depth);
            rows_[i] = {position, F32x4{0, 0, 0, NEW_ERROR}};
        }
    }
    for (int32_t& partner : partners_)
        if (partner != NONE) partner = moved_[static_cast<size_t>(partner)];
    level_depth_ = level.depth;
    gather_rings(level);
}

void DiffSlice::rest() {
    if (run_.count() < ROOMY) return;
    old_rows_.give_back();
    old_leaf_depths_.give_back();
    ring_starts_.give_back();
    neighbours_.give_back();
    closed_.give_back();
    shares_.give_back();
}

// A vertex as a row. Another slice's gets one of its own each time that a ring touches it.
MESHTIDE_INLINE int32_t DiffSlice::row_of(const Level& level, int32_t vertex) {
    size_t place = static_cast<size_t>(vertex) - run_.first;
    if (place < run_.count()) return static_cast<int32_t>(place);
    F32x4 position = level.centres[static_cast<size_t>(vertex)];
    rows_.push({position, F32x4{0, 0, 0, FOREIGN_ERROR}});
    return static_cast<int32_t>(rows_.size() - 1);
}

// The fan of the vertex' head, as walk_ring has it; kept among the neighbours, or only added up. Where it is kept, what
// lies across its edges is looked up as well, so it is a walk of its own.
MESHTIDE_ONCE DiffSlice::RingSum DiffSlice::gather_ring(const Level& level, size_t vertex, bool keeping) {
    RingSum ring;
    Span<const int32_t> corners = level.corners.span(), twins = level.twins.span();
    auto corner = [&](int32_t h) { return corners[static_cast<size_t>(h)]; };
    DiffNeighbour* kept = nullptr;
    if (keeping) kept = neighbours_.extend(RING_LIMIT + 1);
    auto add = [&](int32_t member, int32_t across) {
        size_t place = static_cast<size_t>(member) - run_.first;
        ring.sum += place < run_.count() ? rows_[place].position : level.centres[static_cast<size_t>(member)];
        if (keeping)
            kept[ring.members] = {row_of(level, member), across == NONE ? NONE : row_of(level, across)};
        ring.members++;
    };
    int32_t head = level.heads[vertex], h = head;
    while (h != NONE && ring.members < RING_LIMIT) {
        int32_t ahead = next_half_edge(h), before = previous_half_edge(h), across = NONE;
        if (keeping) {
            int32_t back = twins[static_cast<size_t>(ahead)];
            if (back != NONE) across = corner(previous_half_edge(back));
        }
        add(corner(ahead), across);
        h = twins[static_cast<size_t>(before)];
        if (h == head) {
            ring.closed = true;
            break;
        }
        if (h == NONE) add(corner(before), NONE); // a border: the last member has no face behind it
    }
    if (keeping) {
        if (!ring.closed && ring.members != 0) kept[ring.members - 1].across = NONE; // a member after it is left out
        neighbours_.resize(neighbours_.size() - (RING_LIMIT + 1 - static_cast<size_t>(ring.members)));
    }
    return ring;
}

// Faces do not stand in the order of the vertices, and each step of a walk waits for the one before it. So the faces at
// the heads of later vertices are fetched early, and then those beside them.
MESHTIDE_INLINE void fetch_faces(const Level& level, size_t vertex) {
    constexpr size_t EARLIER = 24, EARLY = 12;
    if (vertex + EARLIER >= level.vertex_count()) return;
    auto fetch = [&](int32_t h) {
        if (h == NONE) return;
        __builtin_prefetch(&level.corners[static_cast<size_t>(h)]);
        __builtin_prefetch(&level.twins[static_cast<size_t>(h)]);
    };
    fetch(level.heads[vertex + EARLIER]);
    int32_t head = level.heads[vertex + EARLY];
    if (head == NONE) return;
    fetch(level.twins[static_cast<size_t>(previous_half_edge(head))]);
    fetch(level.twins[static_cast<size_t>(next_half_edge(head))]);
    fetch(level.twins[static_cast<size_t>(head)]);
}

// The Laplacians, and the rings of the vertices that have bits to come at this level.
void DiffSlice::gather_rings(const Level& level) {
    size_t count = run_.count();
    bool last = std::none_of(leaf_depths_.begin(), leaf_depths_.end(), [](uint8_t depth) { return depth == NO_LEAF; });
    ring_starts_.renew(count + 1);
    closed_.renew(count);
    shares_.renew(count);
    neighbours_.clear();
    ring_starts_[0] = 0;
    for (size_t i = 0; i < count; i++) {
        size_t vertex = run_.first + i;
        fetch_faces(level, vertex);
        RingSum ring = last || leaf_depths_[i] < level.depth ? gather_ring(level, vertex, true)
                                                             : gather_ring(level, vertex, false);
        ring_starts_[i + 1] = static_cast<uint32_t>(neighbours_.size());
        closed_[i] = ring.closed;
        shares_[i] = ring.members != 0 ? 1 / static_cast<float>(ring.members) : 0;
        F32x4 laplacian = ring.members != 0 ? ring.sum * shares_[i] - rows_[i].position : splat(0);
        laplacian[3] = rows_[i].laplacian[3];
        rows_[i].laplacian = laplacian;
    }
}

void DiffSlice::give_known(const Level& level, Span<F32x4> known) const {
    Run run = run_of(level);
    size_t row = 0, count = run_.count();
    int depth = std::min(level.depth, known_depth_);
    for (size_t vertex = run.first; vertex < run.end; vertex++) {
        F32x4 middle = level.centres[vertex];
        middle[3] = static_cast<float>(level.cell_depths[vertex]);
        // Leaves stand in the same order in all levels.
        if (level.leaves[vertex] != 0 && level.cell_depths[vertex] <= known_depth_) {
            while (row < count && leaf_depths_[row] > depth) row++;
            if (row < count) middle = rows_[row++].position;
        }
        known[vertex] = middle;
    }
}

} // namespace meshtide::inline MESHTIDE_ISA
