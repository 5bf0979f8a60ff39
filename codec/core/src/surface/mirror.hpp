// Mirror symmetry: found by the encoder, kept in the stream's header, used as a context by Map and Diff.
//
// Scanned and modelled objects are often symmetric to a plane across an axis. The encoder looks for the plane that
// takes the most vertices to within a step of another vertex; candidates are the middle of the bounding box and the
// most frequent sum of the coordinates of two vertices that agree in the other two. O(n).
#pragma once

#include "base/lanes.hpp"
#include "base/memory.hpp"
#include "mesh/mirror_plane.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// The plane that takes the largest share of vertices to vertices, unless that is too small. Positions are three
// coordinates below 2^bits, at most 20, for each vertex, pairwise different.
MirrorPlane find_mirror(Span<const int32_t> positions, Budget& budget);

} // namespace meshtide::inline MESHTIDE_ISA
