// One level of the hierarchy: the cells of one depth of the octree, and the triangles between them.
//
// Half-edge h = 4 t + k runs from corner k of face t to its next one; place 4 t + 3 is free, so that a face is a vector
// and what comes before and after a half-edge is found without a table.
#pragma once

#include "base/lanes.hpp"
#include "base/memory.hpp"

namespace meshtide::inline MESHTIDE_ISA {

constexpr int32_t NONE = -1;
constexpr size_t ROOMY = 1 << 17; // vertices of a level that is worth to give back the rooms it was made in

struct Level {
    explicit Level(Budget& budget)
        : centres(budget), cell_depths(budget), leaves(budget), parents(budget), first_children(budget),
          corners(budget), twins(budget), heads(budget) {}

    int depth = 0;
    size_t vertex_count() const { return centres.size(); }
    size_t face_count() const { return corners.size() / 4; }

    // Of each vertex, in Morton order.
    Array<F32x4> centres;           // of its cell, in half finest steps; exact; the fourth lane is 0
    Array<uint8_t> cell_depths;     // at which its cell arose; below `depth` for leaves that were found before
    Array<uint8_t> leaves;          // 1: its cell holds one finest vertex
    Array<uint32_t> parents;        // in the coarser level
    Array<uint32_t> first_children; // in the finer level, and one entry more: children of v are [v], ..., [v + 1] - 1
    // Of each half-edge.
    Array<int32_t> corners; // the vertex where it begins
    Array<int32_t> twins;   // the half-edge that runs back; NONE at a border
    // Of each vertex.
    Array<int32_t> heads; // a half-edge that leaves it, one without a twin if there is one; NONE without faces
};

MESHTIDE_INLINE int32_t next_half_edge(int32_t h) { return (h & 3) == 2 ? h - 2 : h + 1; }
MESHTIDE_INLINE int32_t previous_half_edge(int32_t h) { return (h & 3) == 0 ? h + 2 : h - 1; }

// Pairs half-edges that run to and fro between the same two vertices, in the order of their numbers, and fills heads,
// from the corners alone.
void link(Level& level, Budget& budget);

// Faces of a level as others see them: each rotated so that its least corner comes first, in lexicographic
// order.
void canonical_faces(const Level& level, Array<int32_t>& faces, Budget& budget);

// The fan of v's head: its neighbours one after the other, at most `RING_LIMIT`. With more than one fan at v (the mesh
// is not a manifold there) the others are not seen.
constexpr int RING_LIMIT = 24;
struct Ring {
    int count = 0;
    bool closed = false;
    int32_t members[RING_LIMIT + 1];
};
MESHTIDE_ONCE void walk_ring(const Level& level, size_t vertex, Ring& ring) {
    ring.count = 0;
    ring.closed = false;
    int32_t head = level.heads[vertex];
    if (head < 0) return;
    int32_t h = head;
    do {
        ring.members[ring.count++] = level.corners[static_cast<size_t>(next_half_edge(h))];
        int32_t before = previous_half_edge(h), twin = level.twins[static_cast<size_t>(before)];
        if (twin < 0) {
            if (ring.count < RING_LIMIT) ring.members[ring.count++] = level.corners[static_cast<size_t>(before)];
            return;
        }
        h = twin;
    } while (h != head && ring.count < RING_LIMIT);
    ring.closed = h == head;
}

} // namespace meshtide::inline MESHTIDE_ISA
