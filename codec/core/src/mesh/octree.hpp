// What an encoder knows: the cells and the faces of every depth, from the finest mesh.
#pragma once

#include "mesh/level.hpp"

#include <vector>

namespace meshtide::inline MESHTIDE_ISA {

struct Octree {
    // positions: three grid coordinates for each vertex, 0 .. 2^bits - 1, all different, in Morton order.
    // faces: three different vertices for each, none twice.
    Octree(Span<const int32_t> positions, Span<const int32_t> faces, int bits, Budget& budget);

    struct Depth {
        explicit Depth(Budget& budget) : first(budget), parents(budget), faces(budget) {}
        Array<uint32_t> first;   // of each cell: its first finest vertex; and one entry more
        Array<uint32_t> parents; // of each cell: the cell of the depth above
        Array<int32_t> faces;    // three corners each, the least one first, in lexicographic order
        size_t cell_count() const { return first.size() - 1; }
        bool is_leaf(size_t cell) const { return first[cell + 1] - first[cell] == 1; }
    };

    int bits;
    Span<const int32_t> positions;
    std::vector<Depth> depths; // 0 .. bits

    // The level of a depth, as a decoder has it that was sent the faces in the order above.
    void make_level(int depth, Level& level, Budget& budget) const;
};

} // namespace meshtide::inline MESHTIDE_ISA
