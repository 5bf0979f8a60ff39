// The packets of profile classic that hold no faces (docs/format.md, Profile classic): the cells of the coarsest level,
// how the vertices of a level split, and Diffs.
//
// R. Balan, G. Taubin, "3D mesh geometry filtering algorithms for progressive transmission schemes", CAD 32, 2000,
// sections 3 and 4: Diffs have to decode without each other, so every payload starts from fresh contexts and no context
// depends on a position.
#pragma once

#include "entropy/contexts.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// The Morton codes of cells, ascending, each below 2^(3 bits).
template <class Coder>
void code_cells(Coder& coder, Span<uint64_t> codes, int bits, Budget& budget) {
    Array<Context> contexts(budget);
    contexts.assign(2 * UNSIGNED_CONTEXTS, Context{});
    Span<Context> high = contexts.span().part(0, UNSIGNED_CONTEXTS);
    Span<Context> low = contexts.span().part(UNSIGNED_CONTEXTS, UNSIGNED_CONTEXTS);
    const uint64_t end = static_cast<uint64_t>(1) << (3 * bits);
    constexpr int LOW_BITS = 30;
    uint64_t least = 0; // that the next code can be
    for (uint64_t& code : codes) {
        uint64_t gap = Coder::encoding ? code - least : 0;
        uint64_t upper = code_unsigned(coder, high, static_cast<uint32_t>(gap >> LOW_BITS));
        uint64_t lower = code_unsigned(coder, low, static_cast<uint32_t>(gap & ((1u << LOW_BITS) - 1)));
        expect(lower < 1u << LOW_BITS && upper < 1u << LOW_BITS, "a cell outside of the grid");
        gap = upper << LOW_BITS | lower;
        expect(least < end && gap < end - least, "a cell outside of the grid");
        code = least + gap;
        least = code + 1;
    }
}

// How many children each coarser vertex has, at least one; they add up to `total`.
template <class Coder>
void code_children(Coder& coder, Span<uint32_t> counts, uint64_t total, Budget& budget) {
    Array<Context> contexts(budget);
    contexts.assign(4 * UNSIGNED_CONTEXTS, Context{});
    uint32_t before = 0;
    uint64_t sum = 0;
    for (uint32_t& count : counts) {
        size_t row = before < 3 ? before : 3;
        before = code_unsigned(coder, contexts.span().part(row * UNSIGNED_CONTEXTS, UNSIGNED_CONTEXTS), count - 1);
        sum += static_cast<uint64_t>(before) + 1;
        expect(sum <= total, "more children than the level has vertices");
        count = before + 1;
    }
    expect(sum == total, "fewer children than the level has vertices");
}

// True minus predicted cells, three integers for each vertex. The class of the vertex before, by the size of its Diff,
// chooses the contexts (six classes).
template <class Coder>
void code_differences(Coder& coder, Span<int32_t> differences, Budget& budget) {
    constexpr size_t CLASSES = 6;
    Array<Context> contexts(budget);
    contexts.assign(3 * CLASSES * SIGNED_CONTEXTS, Context{});
    uint64_t recent = 0; // half of what it was, and the size of the last Diff
    for (size_t i = 0; i + 2 < differences.size(); i += 3) {
        size_t size_class = 0;
        while (size_class + 1 < CLASSES && recent >= static_cast<uint64_t>(2) << size_class) size_class++;
        for (size_t axis = 0; axis < 3; axis++) {
            size_t row = (CLASSES * axis + size_class) * SIGNED_CONTEXTS;
            int32_t& difference = differences[i + axis];
            difference = code_signed(coder, contexts.span().part(row, SIGNED_CONTEXTS), difference);
            recent += static_cast<uint64_t>(difference < 0 ? -static_cast<int64_t>(difference) : difference);
        }
        recent >>= 1;
    }
}

} // namespace meshtide::inline MESHTIDE_ISA
