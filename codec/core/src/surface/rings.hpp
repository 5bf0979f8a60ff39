// One-rings: the neighbours of each vertex in the order in which its triangles turn around it (docs/format.md, What is
// drawn).
//
// Each triangle at a vertex is a wedge from one neighbour to the next; wedges are chained head to tail. A closed ring
// is a single chain that meets its start again; around borders, non-manifold and inconsistently oriented vertices the
// chains stand one after the other. Vertices of more than LONGEST_RING triangles keep their wedges' first corners,
// unsorted: time is O(faces * LONGEST_RING) whatever the input.
#pragma once

#include "base/lanes.hpp"
#include "base/memory.hpp"

namespace meshtide::inline MESHTIDE_ISA {

constexpr size_t LONGEST_RING = 64;

struct Rings {
    explicit Rings(Budget& budget) : starts(budget), members(budget), closed(budget) {}

    Array<uint32_t> starts; // members of vertex v: [starts[v]], ..., [starts[v + 1] - 1]
    Array<int32_t> members;
    Array<uint8_t> closed; // whether a vertex' ring is one closed turn
    size_t vertex_count() const { return closed.size(); }
};

// Of faces in canonical order, three corners each, below `vertices`.
void order_rings(Span<const int32_t> faces, size_t vertices, Rings& rings, Budget& budget);

} // namespace meshtide::inline MESHTIDE_ISA
