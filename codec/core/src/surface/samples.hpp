// Points of a surface: samples spread evenly by area, and vertices in the order of the faces.
#pragma once

#include "surface/geometry.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// Points on the faces, evenly by area, or by their number if none has an area, in the order of the list of faces. The
// same seed gives the same points. O(faces + samples).
//
// Each sample falls into its own share of the area; where in its share, and where in its triangle, is decided by a
// sequence without clumps (M. Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018).
void sample(const Surface& surface, Span<const uint32_t> order, uint64_t seed, Span<Foot> samples, Budget& budget);

struct UsedVertex {
    int32_t vertex;
    uint32_t place; // in the order of the faces, where it is used first
};
// The vertices that the faces use, each once, in the order of the list of faces; every j-th of them when they are more
// than `limit`, with the smallest j that leaves no more.
void used_vertices(const Surface& surface, Span<const uint32_t> order, size_t limit, Array<UsedVertex>& used,
                   Budget& budget);

} // namespace meshtide::inline MESHTIDE_ISA
