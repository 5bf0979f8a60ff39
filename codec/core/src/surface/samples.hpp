// Points of a surface: samples spread evenly by area, and vertices in the order of the faces.
#pragma once

#include "surface/geometry.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// The faces of a surface in some order, and the area of each together with all before it.
struct OrderedFaces {
    Span<const uint32_t> order;
    Span<const double> areas;
};

// Sums up the areas, in some unit, or the numbers of faces if none has an area.
void sum_areas(const Surface& surface, Span<const uint32_t> order, Array<double>& areas);

// Points on the faces, evenly by area, in the order of the faces. The same seed gives the same points.
// O(faces + samples).
//
// Each sample falls into its own share of the area; where in its share, and where in its triangle, is told by a
// sequence without clumps (M. Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018).
void sample(const OrderedFaces& faces, uint64_t seed, Span<Foot> samples);

// The vertices that the faces use, each once, in the order of the list of faces; every j-th of them when they are more
// than `limit`, with the smallest j that leaves no more.
void used_vertices(const Surface& surface, Span<const uint32_t> order, size_t limit, Array<Vector>& vertices,
                   Budget& budget);

} // namespace meshtide::inline MESHTIDE_ISA
