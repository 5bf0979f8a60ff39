// Faces of a classic stream, level after level (docs/format.md, Profile classic): as those of profile compact at effort
// default, but without a look at positions, which may be missing or wrong.
//
// What its models have learned goes on from level to level: a level's faces need those of all coarser ones anyway.
#pragma once

#include "faces/faces.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// Faces without positions.
#if defined(__wasm__) && !defined(MESHTIDE_DEFAULT_ONLY)
using BlindFacesModel = FacesModel<Effort::either, true>; // see choose()
#else
using BlindFacesModel = FacesModel<Effort::standard, false>;
#endif

// What is known before a classic stream begins: trained on other meshes (docs/format.md, Trained states).
struct ClassicFacesModel : BlindFacesModel {
    explicit ClassicFacesModel(Budget& budget) : BlindFacesModel((choose(Effort::standard, false), budget)) {}

    // From or to their bytes.
    template <class Coder>
    void code_states(Coder& coder, Budget& budget) {
        choose(Effort::standard, false);
        StatesModel states(budget);
        BlindFacesModel::code_states(coder, states);
    }
};

class ClassicConnectivity {
public:
    // Begins at a single vertex without faces, whose children are the vertices of the coarsest level.
    ClassicConnectivity(Budget& budget, const ClassicFacesModel& trained)
        : model_(budget), memory_(budget), levels_{Level(budget), Level(budget)}, budget_(budget) {
        model_.copy(trained);
        coarse_->heads.push(NONE);
    }

    // Vertices of the level that was coded last.
    size_t vertex_count() const { return coarse_->heads.size(); }

    // What has been learned so far.
    ClassicFacesModel& model() { return model_; }

    // Codes the faces of the next level. children: how many each vertex of the last level has; truth: an encoder's
    // faces, canonical. After a failure no more levels can be coded.
    template <class Coder>
    void code_next(Coder& coder, Span<const uint32_t> children, size_t face_count, Span<const int32_t> truth = {}) {
        fine_->parents.clear();
        coarse_->first_children.clear();
        for (size_t v = 0; v < children.size(); v++) {
            coarse_->first_children.push(static_cast<uint32_t>(fine_->parents.size()));
            fine_->parents.resize(fine_->parents.size() + children[v], static_cast<uint32_t>(v));
        }
        coarse_->first_children.push(static_cast<uint32_t>(fine_->parents.size()));
        choose(Effort::standard, false);
        code_faces(coder, *coarse_, *fine_, static_cast<BlindFacesModel&>(model_), memory_,
                   FacesTask{0, face_count, {truth}});
        expect(fine_->face_count() == face_count, "another number of faces than was announced");
        std::swap(coarse_, fine_);
    }

    // Of the level that was coded last: parents in the coarser one, and its faces, canonical.
    Span<const uint32_t> parents() const { return coarse_->parents.span(); }
    void tell_faces(Array<int32_t>& faces) const { canonical_faces(*coarse_, faces, budget_); }

private:
    ClassicFacesModel model_;
    FacesMemory memory_;
    Level levels_[2];
    Level *coarse_ = &levels_[0], *fine_ = &levels_[1];
    Budget& budget_;
};

} // namespace meshtide::inline MESHTIDE_ISA
