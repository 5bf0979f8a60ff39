// Mirror symmetry: found by the encoder, told in the stream's header, used as a context by Map and Diff.
//
// Scanned and modelled objects are often symmetric to a plane across an axis. The encoder looks for the plane that
// takes the most vertices to within a step of another vertex; candidates are the middle of the bounding box and the
// most frequent sum of the coordinates of two vertices that agree in the other two. O(n).
#pragma once

#include "base/lanes.hpp"
#include "base/memory.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// A plane across an axis: x + x' is `sum`, in finest steps, for a vertex x and its image x'.
struct Mirror {
    int axis = -1; // none
    int32_t sum = 0;
};

// The plane that takes the largest share of vertices to vertices, unless that is too small. Positions are three
// coordinates below 2^bits, at most 20, for each vertex, pairwise different.
Mirror find_mirror(Span<const int32_t> positions, Budget& budget);

} // namespace meshtide::inline MESHTIDE_ISA
