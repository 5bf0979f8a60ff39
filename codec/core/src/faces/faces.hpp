// The faces of a level, given those of the coarser one (docs/format.md, Connectivity).
#pragma once

#include "faces/walk.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

// What is known of a level besides the coarser one.
struct FacesTask {
    int bits;            // of the grid: a cell of the fine level is 2^(bits - depth) finest steps wide
    uint64_t most_faces; // more would be malformed
    FacesTruth truth;    // encoder only
};

// An encoder's coder that writes nothing.
struct Rehearsal {
    static constexpr bool encoding = true;
    int code(uint32_t, int bit) { return bit; }
};

// May edges have several faces a side, or vertices several fans? Then twins do not tell all faces at an edge.
inline bool has_several(const Level& level, Budget& budget) {
    size_t vertices = level.heads.size(), faces = level.face_count();
    for (size_t v = 0; v < vertices; v++) {
        int32_t head = level.heads[v], h = head;
        if (head < 0) continue;
        uint32_t seen = 0;
        do {
            seen++;
            h = level.twins[static_cast<size_t>(previous_half_edge(h))];
        } while (h >= 0 && h != head && seen < level.degrees[v]);
        if (seen != level.degrees[v]) return true;
    }
    Array<uint64_t> edges(budget);
    for (size_t t = 0; t < faces; t++)
        for (size_t h = 4 * t; h < 4 * t + 3; h++) {
            auto from = static_cast<uint64_t>(level.corners[h]);
            auto to =
                static_cast<uint32_t>(level.corners[static_cast<size_t>(next_half_edge(static_cast<int32_t>(h)))]);
            edges.push(from << 32 | to);
        }
    std::sort(edges.begin(), edges.end());
    return std::adjacent_find(edges.begin(), edges.end()) != edges.end();
}

// coarse: with faces and first children. fine: with centres (unless positions are unknown) and parents; its corners,
// twins, heads and degrees are filled.
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
    auto walk = [&](auto& with, FacesModel<effort, positions>& knowing, FacesTraits traits) {
        FacesWalk<effort, positions, std::remove_reference_t<decltype(with)>> made(with, coarse, fine, knowing, memory,
                                                                                   traits);
        made.set_unit(unit);
        if constexpr (Coder::encoding) memory.truth.start(task.truth, fine.parents.span());
        bool done = made.run(faces);
        if constexpr (Coder::encoding) memory.answered = made.every_gate_had_a_face(), memory.extra = made.had_extra();
        return done;
    };
    FacesTraits traits;
    if (count == 0) {
        walk(coder, model, traits);
        return;
    }
    if constexpr (Coder::encoding) {
        traits.several = has_several(coarse, memory.budget);
        FacesModel<effort, positions> copy(memory.budget);
        Rehearsal rehearsal;
        for (bool clean : {true, false}) {
            copy.copy(model);
            traits.clean = clean, traits.extra = !clean;
            if (walk(rehearsal, copy, traits)) break;
        }
        traits.closed = memory.answered, traits.extra = memory.extra;
    }
    traits.several = coder.code(32768, traits.several) != 0;
    traits.closed = coder.code(32768, traits.closed) != 0;
    traits.clean = coder.code(32768, traits.clean) != 0;
    traits.extra = !traits.clean && coder.code(32768, traits.extra) != 0;
    walk(coder, model, traits);
}

} // namespace meshtide::inline MESHTIDE_ISA
