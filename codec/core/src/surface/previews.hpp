// Previews: a few small meshes that open a stream, each as close to the original as its bytes allow.
//
// The mesh is simplified, its vertices are fitted to the original surface, then rounded to a coarse grid over the same
// cube, with the fit going on among the grid's points. One more bit per coordinate lengthens a preview by a sixth, as a
// sixth more vertices do, which bring the surface closer by as much; that much is lost to rounding where a step of the
// grid is about six times the root mean square distance of the fit: the grid is the coarsest whose step is no longer.
//
// What a preview shows for its bytes differs from mesh to mesh: a machine part of flat faces is close with a hundred
// vertices, a scan needs a thousand. So for each distance of a list the coarsest simplified mesh within it is looked
// for among those of a ladder of ratios, by bisection: a few fits, O(fits (m + samples log m)).
#pragma once

#include "surface/refit.hpp"
#include "surface/simplification.hpp"

#include <functional>
#include <vector>

namespace meshtide::inline MESHTIDE_ISA {

// A small mesh on a coarse grid over the same cube as the original.
struct Preview {
    explicit Preview(Budget& budget) : positions(budget), faces(budget) {}

    int bits = 0;
    Array<int32_t> positions; // three for each vertex, below 2^bits, pairwise different, in Morton order
    Array<int32_t> faces;     // canonical; every vertex is in use
    size_t vertex_count() const { return positions.size() / 3; }
};

// A quantized mesh: three coordinates below 2^bits for each vertex, pairwise different, in Morton order; faces of
// vertices that are there.
struct GridMesh {
    Span<const int32_t> positions, faces;
    int bits;
};

// Bytes that a preview takes, which only its coder knows.
using PreviewSize = std::function<size_t(const Preview&)>;

// Coarsest first, chosen by their measured distance; none where none make sense. The same mesh gives the same previews.
std::vector<Preview> choose_previews(const GridMesh& mesh, const PreviewSize& size, Budget& budget);

// One of about 1/ratio of the vertices for each ratio, of 2 or more, that makes sense; coarsest first.
std::vector<Preview> make_previews(const GridMesh& mesh, std::vector<size_t> ratios, Budget& budget);

} // namespace meshtide::inline MESHTIDE_ISA
