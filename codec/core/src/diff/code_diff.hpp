// The Diff layer (docs/format.md, Diff): one more bit of each coordinate of every leaf of a slice that is coarser than
// a depth.
//
// Vertices come in Morton order. Each takes three binary decisions, which are mixed from what the vertices around it
// say: those that have been coded already stand where they are at this depth, the others in the middle of their cells.
#pragma once

#include "diff/model.hpp"
#include "diff/slice.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// What an encoder knows; a decoder leaves it empty.
struct DiffTruth {
    Span<const int32_t> positions;       // three finest coordinates for each finest vertex
    Span<const uint32_t> first_vertices; // of each cell of the level
};

// The bit plane of a depth. The slice must have entered the level, and know the depth before; it knows this one then.
// The depth is that of the level, or, if all cells of the level are leaves, a greater one.
template <Effort effort, class Coder>
void code_diff(Coder& coder, int depth, DiffSlice& slice, DiffModel<effort>& model, const DiffTruth& truth = {});

} // namespace meshtide::inline MESHTIDE_ISA
