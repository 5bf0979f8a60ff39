// The vertex graph of a mesh and its random-walk Laplacian K = I - D^-1 M (Balan & Taubin 2000, section 2, eq. 1).
//
// An edge joins any two different vertices of one face, so non-manifold, open and degenerate meshes are as good as
// others. Sums run over a vertex' neighbours in ascending order, in doubles: the same bits on every machine. O(n + m).
#pragma once

#include "surface/geometry.hpp"

namespace meshtide::inline MESHTIDE_ISA {

struct Graph {
    explicit Graph(Budget& budget) : offsets(budget), neighbours(budget) {}

    Array<uint32_t> offsets;   // neighbours of v: [offsets[v]], ..., [offsets[v + 1] - 1]
    Array<int32_t> neighbours; // ascending
    size_t vertex_count() const { return offsets.size() - 1; }
    uint32_t degree(size_t vertex) const { return offsets[vertex + 1] - offsets[vertex]; }
};

// Of faces with corners below `vertices`.
void build_graph(Span<const int32_t> faces, size_t vertices, Graph& graph, Budget& budget);

// K x: every value minus the mean of its neighbours'; 0 for a vertex without any. `products` is another array.
void apply_k(const Graph& graph, Span<const double> values, Span<double> products);
void apply_k(const Graph& graph, Span<const Vector> values, Span<Vector> products);

} // namespace meshtide::inline MESHTIDE_ISA
