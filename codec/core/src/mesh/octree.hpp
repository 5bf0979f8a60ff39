// What an encoder knows: the cells and the faces of every depth, from the finest mesh.
#pragma once

#include "mesh/level.hpp"

#include <vector>

namespace meshtide::inline MESHTIDE_ISA {

// Fail unless positions are on a grid of so many bits; all different and in Morton order, and faces name three of them
// each.
void check_positions(Span<const int32_t> positions, int bits);
void check_grid_mesh(Span<const int32_t> positions, Span<const int32_t> faces, int bits);

struct Octree {
    // positions: three grid coordinates for each vertex, 0 .. 2^bits - 1, all different, in Morton order.
    // faces: three different vertices for each; one that is there twice counts once. Anything else is an argument
    // error.
    Octree(Span<const int32_t> positions, Span<const int32_t> faces, int bits, Budget& budget);

    struct Depth {
        explicit Depth(Budget& budget) : first(budget), faces(budget) {}
        Array<uint32_t> first; // of each cell: its first finest vertex; and one entry more
        Array<int32_t> faces;  // three corners each, the least one first, in lexicographic order
        size_t cell_count() const { return first.size() - 1; }
        // The cell that holds a finest vertex, from a cell on that is not behind it.
        size_t cell_of(size_t vertex, size_t cell) const {
            while (first[cell + 1] <= vertex) cell++;
            return cell;
        }
        bool is_leaf(size_t cell) const { return first[cell + 1] - first[cell] == 1; }
    };

    int bits;
    Span<const int32_t> positions;
    std::vector<Depth> depths; // from 0 on, up to the first whose cells are all leaves: greater ones are the same

    const Depth& at(int depth) const {
        auto place = static_cast<size_t>(depth);
        return place < depths.size() ? depths[place] : depths.back();
    }
    // The first depth at which a finest vertex is alone in its cell.
    int leaf_depth(size_t vertex) const;

    // The level of a depth, as a decoder has it that was sent the faces in the order above.
    void make_level(int depth, Level& level, Budget& budget) const;

private:
    // Of each cell of a depth the one of the depth above that it is in.
    void find_parents(int depth, Array<uint32_t>& parents) const;
    // The least depth at which two finest vertices are in different cells.
    int parting_depth(size_t i, size_t j) const;
};

} // namespace meshtide::inline MESHTIDE_ISA
