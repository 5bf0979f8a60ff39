// What the Diffs of one slice have told so far, and what it stands on (docs/format.md, Slices, Diff).
//
// A slice is a run of vertices in Morton order. It sees the vertices of other slices at the centres of their cells,
// whatever has arrived of them; so each slice decodes without the others.
#pragma once

#include "base/effort.hpp"
#include "mesh/level.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// A plane across an axis that takes finest coordinate x to sum - x.
struct MirrorPlane {
    int axis = -1; // -1: there is none
    int32_t sum = 0;
};

// Which vertices: those whose cell's lowest finest step has a Morton code from `first` on, below `end`.
struct SliceRange {
    int bits = 0; // of a finest coordinate
    uint64_t first = 0, end = ~static_cast<uint64_t>(0);
};

// One vertex as the slice knows it.
struct DiffRow {
    F32x4 position;  // in half finest steps; the fourth lane: up to which depth it is known
    F32x4 laplacian; // where its neighbours' mean was last seen from it; the fourth lane: how wrong guesses were, in
                     // half cells
};

// A member of a ring: itself, and the vertex across the edge to the member after it, as rows; NONE without one.
struct DiffNeighbour {
    int32_t member, across;
};

constexpr uint8_t NO_LEAF = 255;
constexpr float NEW_ERROR = 1.0f;     // of a vertex that has just arisen
constexpr float FOREIGN_ERROR = 4.0f; // of a vertex of another slice
constexpr float ERROR_GROWTH = 1.4f;  // from one depth to the next, whose cells are half as large

enum class Likeness : uint8_t { undecided, differs, agrees }; // of a vertex and its image

class DiffSlice {
public:
    DiffSlice(Budget& budget, SliceRange range, MirrorPlane mirror);

    // Goes on to a level: the first one, or the one after the level that it stands on. Bit planes that are coded after
    // it are of the level's depth, or of greater ones if all its cells are leaves.
    void enter(const Level& level);

    // The depth up to which its leaves are known. Whoever wants the bit plane of depth b needs this to be b - 1.
    int known_depth() const { return known_depth_; }

    // Writes what is known of the slice's vertices into the rows of a level, be it coarser or finer than its own: the
    // middle of the smallest cell known to hold each, in half finest steps, and this cell's depth in the fourth lane.
    void tell(const Level& level, Span<F32x4> known) const;

    // The vertices of a level that are the slice's.
    struct Run {
        size_t first, end;
    };
    Run run_of(const Level& level) const;

private:
    template <Effort effort, class Coder>
    friend class DiffPlane;

    void gather_rings(const Level& level);
    int32_t row_of(const Level& level, int32_t vertex);

    Budget& budget_;
    SliceRange range_;
    MirrorPlane mirror_;
    int level_depth_ = -1, known_depth_ = 0;
    Run run_ = {0, 0}; // in the level that it stands on

    Array<DiffRow> rows_;        // one for each vertex of the slice, then those of other slices that rings touch
    Array<uint8_t> leaf_depths_; // cell depths; NO_LEAF for others
    Array<uint32_t> ring_starts_;
    Array<uint8_t> ring_closed_;
    Array<DiffNeighbour> neighbours_;
    Array<int32_t> partners_; // rows; with a mirror
    Array<Likeness> likenesses_;
    Array<DiffRow> old_rows_; // scratch
    Array<int32_t> moved_;
};

} // namespace meshtide::inline MESHTIDE_ISA
