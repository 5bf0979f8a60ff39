// The faces of a level, given those of the coarser one (docs/format.md, Connectivity).
#pragma once

#include "faces/walk.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// What is known of a level besides the coarser one.
struct FacesTask {
    int bits;            // of the grid: a cell of the fine level is 2^(bits - depth) finest steps wide
    uint64_t most_faces; // more would be malformed
    FacesTruth truth;    // encoder only
};

template <class Coder>
void code_traits(Coder& coder, FacesTraits& traits) {
    traits.several = code_raw(coder, 1, traits.several) != 0;
    traits.closed = code_raw(coder, 1, traits.closed) != 0;
    traits.clean = code_raw(coder, 1, traits.clean) != 0;
    traits.extra = !traits.clean && code_raw(coder, 1, traits.extra) != 0;
}

// coarse: with faces and first children. fine: with centres (unless positions are unknown) and parents; its corners,
// twins and heads are filled.
template <Effort effort, bool positions, class Coder>
void code_faces(Coder& coder, const Level& coarse, Level& fine, FacesModel<effort, positions>& model,
                FacesMemory& memory, const FacesTask& task) {
    size_t vertices = fine.parents.size();
    expect(vertices < 1u << 28 && task.most_faces < 1u << 28, "more faces than the format has numbers for");
    Span<Context> number = model.contexts.span().part(FacesContexts::NUMBERS + 4 * SIGNED_CONTEXTS, SIGNED_CONTEXTS);
    auto twice = static_cast<int64_t>(2 * vertices);
    int64_t wanted = static_cast<int64_t>(task.truth.faces.size() / 3);
    int64_t count = twice + code_signed(coder, number, static_cast<int32_t>(wanted - twice));
    expect(count >= 0 && static_cast<uint64_t>(count) <= task.most_faces, "more faces than were announced");

    float unit = std::bit_cast<float>((127 + task.bits - fine.depth + 1) << 23);
    auto faces = static_cast<size_t>(count);
    auto walk = [&](FacesTraits traits) {
        FacesWalk<effort, positions, Coder> made(coder, coarse, fine, model, memory, traits);
        made.set_unit(unit);
        made.run(faces);
        return made.found();
    };
    FacesTraits traits;
    if constexpr (Coder::encoding) {
        memory.truth.index(task.truth, fine.parents.span());
        memory.truth.restart();
    }
    if (count == 0) {
        walk(traits);
        return;
    }
    if constexpr (Coder::encoding) {
        // What the walk finds has to be coded before it: it is guessed, and coded again where the guess was wrong, which
        // shows early where it promised too much. After that less and less is promised, so this ends.
        FacesModel<effort, positions> before(memory.budget);
        before.copy(model);
        const auto start = coder.mark();
        bool simple = !memory.truth.edges_repeat();
        FacesTraits found{has_several(coarse, memory.budget), simple && !memory.open, simple, !simple};
        for (int before_this = 0;; before_this++) {
            traits = found;
            code_traits(coder, traits);
            found = walk(traits);
            if (before_this > 0)
                found.closed = found.closed && traits.closed, found.clean = found.clean && traits.clean;
            if (before_this > 1) found.extra = found.extra || traits.extra;
            if (found == traits) break;
            coder.return_to(start);
            model.copy(before);
            memory.truth.restart();
        }
        if (found.clean) memory.open = !found.closed;
    } else {
        code_traits(coder, traits);
        walk(traits);
    }
}

} // namespace meshtide::inline MESHTIDE_ISA
