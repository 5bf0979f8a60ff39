// What the Diffs of one slice have made known so far, and what it builds on (docs/format.md, Slices, Diff).
//
// A slice is a run of vertices in Morton order. It sees the vertices of other slices at the centres of their cells,
// whatever has arrived of them; so each slice decodes without the others.
#pragma once

#include "base/effort.hpp"
#include "mesh/level.hpp"
#include "mesh/mirror_plane.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// Which vertices: those whose cell's lowest finest step has a Morton code from `first` on, below `end`.
struct SliceRange {
    int bits = 0; // of a finest coordinate
    uint64_t first = 0, end = ~static_cast<uint64_t>(0);
};

// One vertex as the slice knows it.
struct DiffRow {
    F32x4 position;  // in half finest steps; the fourth lane: the depth up to which it is known
    F32x4 laplacian; // its neighbours' mean, seen from it; the fourth lane: how wrong guesses were, in half cells
};

// A member of a ring, and the vertex across the edge from it to the member after it (NONE without one), as rows.
struct DiffNeighbour {
    int32_t member, across;
};

enum class Likeness : uint8_t { undecided, differs, agrees }; // of a vertex and its image

constexpr uint8_t NO_LEAF = 255;
constexpr float NEW_ERROR = 1.0f;     // of a vertex that has just arisen
constexpr float FOREIGN_ERROR = 4.0f; // of a vertex of another slice

class DiffSlice {
public:
    DiffSlice(Budget& budget, SliceRange range, MirrorPlane mirror);

    // Goes on to a level: that of depth 0 first, then always the one after the level that it stands on, all of whose
    // bit planes must have been coded.
    void enter(const Level& level);

    // Gives back what the level before and the rings have taken, where that is much, before the slice enters another
    // one.
    void rest();

    Budget& budget() const { return budget_; }

    // The depth up to which its leaves are known. A bit plane can be coded only after the one before it.
    int known_depth() const { return known_depth_; }

    // Writes what is known of the slice's vertices into the rows of a level, be it coarser or finer than its own: the
    // middle of the smallest cell that is known to hold each, in half finest steps (2 p + 1 for a vertex whose finest
    // position p is known), and the depth of this cell in the fourth lane.
    void give_known(const Level& level, Span<F32x4> known) const;

    // The vertices of a level that are the slice's.
    struct Run {
        size_t first, end;
        size_t count() const { return end - first; }
    };
    Run run_of(const Level& level) const;

private:
    template <Effort effort, class Coder>
    friend class DiffPlane;
    friend class DiffMirror;

    void gather_rings(const Level& level);
    struct RingSum {
        F32x4 sum = {}; // of positions
        int members = 0;
        bool closed = false;
    };
    RingSum gather_ring(const Level& level, size_t vertex, bool keeping);
    int32_t row_of(const Level& level, int32_t vertex);

    Budget& budget_;
    SliceRange range_;
    MirrorPlane mirror_;
    int level_depth_ = -1, known_depth_ = 0;
    Run run_ = {0, 0}; // in the level that it stands on

    Array<DiffRow> rows_;         // of the slice's vertices, then of those of other slices that its rings touch
    Array<uint8_t> leaf_depths_;  // cell depths; NO_LEAF for others
    Array<uint32_t> ring_starts_; // one more than there are vertices
    Array<DiffNeighbour> neighbours_;
    Array<uint8_t> closed_; // whether the ring is
    Array<float> shares_;   // 1 / members of the ring
    // With a mirror.
    Array<int32_t> partners_; // rows, or NONE
    Array<Likeness> likenesses_;
    // What it had at the level before.
    Array<DiffRow> old_rows_;
    Array<uint8_t> old_leaf_depths_;
    Array<int32_t> old_partners_, moved_;
    Array<Likeness> old_likenesses_;
};

} // namespace meshtide::inline MESHTIDE_ISA
