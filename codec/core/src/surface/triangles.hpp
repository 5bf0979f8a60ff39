// Sets of triangles: their canonical order, and their edges.
#pragma once

#include "surface/geometry.hpp"

namespace meshtide::inline MESHTIDE_ISA {

struct TriangleMesh {
    explicit TriangleMesh(Budget& budget) : vertices(budget), faces(budget) {}

    Array<Vector> vertices;
    Array<int32_t> faces; // three corners each
    Surface surface() const { return {vertices.span(), faces.span()}; }
};

// The faces of a surface, or where there are none, one for each vertex, which are kept in `points`.
Span<const int32_t> faces_or_vertices(const Surface& surface, Array<int32_t>& points);

// The set of oriented triangles: each rotated until its smallest corner stands first, in lexicographic order; those of
// less than three different corners, and repeated ones, left out. Corners are below `vertices`. O(m log m).
void canonical_faces(Array<int32_t>& faces, size_t vertices, Budget& budget);

struct Edge {
    int32_t from, to; // from < to
    uint32_t corner;  // 3 face + corner where one of its faces has it
    uint32_t faces;
};
// The edges of the faces, in lexicographic order. O(m log m).
void find_edges(Span<const int32_t> faces, size_t vertices, Array<Edge>& edges, Budget& budget);

// Renumbers the corners so that the used vertices follow each other, in their order; which ones those are is left in
// `used`.
void drop_unused(Array<int32_t>& faces, size_t vertices, Array<int32_t>& used, Budget& budget);

} // namespace meshtide::inline MESHTIDE_ISA
