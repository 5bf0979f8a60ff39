// From one depth of the octree to the next: a Map, then faces, in one range-coded payload (docs/format.md, Packets and
// levels). One function for both directions; an encoder's levels are made by the very walk that codes them, so that its
// half-edges stand where a decoder's will.
#pragma once

#include "classic/connectivity.hpp"
#include "diff/code_diff.hpp"
#include "faces/faces.hpp"
#include "map/map.hpp"
#include "mesh/octree.hpp"

#include <algorithm>
#include <memory>

namespace meshtide::inline MESHTIDE_ISA {

// What the header says of the whole hierarchy.
struct Plan {
    int bits = 0;
    size_t vertices = 0;   // of the finest mesh
    size_t most_faces = 0; // of any level
    MirrorPlane mirror;
};

// The levels from depth 0 on, up to the first whose cells are all leaves: those of greater depths are the same.
class LevelChain {
public:
    LevelChain(Budget& budget, const Plan& plan) : budget_(budget), bits_(plan.bits), levels_(budget) {
        Level& root = levels_.add(budget);
        auto middle = static_cast<float>(1 << plan.bits); // of the cube, in half finest steps
        root.centres.push(F32x4{middle, middle, middle, 0});
        root.cell_depths.push(0);
        all_leaves_ = plan.vertices == 1;
        root.leaves.push(all_leaves_);
        root.parents.push(0);
        root.heads.push(NONE);
    }

    // The depth down to which levels are known: all of them once the cells are leaves.
    int known_depth() const { return all_leaves_ ? bits_ : static_cast<int>(complete_) - 1; }
    // Whether the last level's cells are all leaves.
    bool ends() const { return all_leaves_; }
    const Level& at(int depth) const {
        auto place = static_cast<size_t>(depth);
        return levels_[place < complete_ ? place : complete_ - 1];
    }
    const Level& last() const { return levels_[complete_ - 1]; }

    // Room for the level after the last one, which counts when it is complete.
    Level& begin_next() { return levels_.add(budget_); }
    Level& before_next() { return levels_[complete_ - 1]; }
    // Gives back what the next level and the Diffs, which have come to the depth before this one, stand on of those
    // coarser than it; of the last one, only what the Diffs stand on. If they are not drawn either, all of it.
    void forget(int depth, bool drawn) {
        auto end = std::min(static_cast<size_t>(depth), complete_ - 1);
        for (; forgotten_ < end; forgotten_++) {
            Level& level = levels_[forgotten_];
            level.parents.give_back();
            level.first_children.give_back();
            level.twins.give_back();
            if (drawn) continue;
            level.centres.give_back();
            level.cell_depths.give_back();
            level.leaves.give_back();
            level.corners.give_back();
            level.heads.give_back();
        }
        if (depth > 0) levels_[std::min(static_cast<size_t>(depth), complete_) - 1].parents.give_back();
        if (!drawn) first_drawn_ = static_cast<int>(forgotten_);
    }
    // The coarsest depth that was not given back.
    int first_drawn() const { return first_drawn_; }

    void complete_next() {
        complete_++;
        all_leaves_ = true;
        for (uint8_t leaf : levels_[complete_ - 1].leaves) all_leaves_ = all_leaves_ && leaf != 0;
    }

private:
    Budget& budget_;
    int bits_;
    List<Level> levels_;
    size_t complete_ = 1; // the last one may be in the making, or have failed
    size_t forgotten_ = 0;
    int first_drawn_ = 0;
    bool all_leaves_ = false;
};

// What is known of all layers before a stream begins: trained on other meshes (docs/format.md, Trained states).
template <Effort effort>
struct TrainedLayers {
    explicit TrainedLayers(Budget& budget) : map(budget), faces(budget), diff(budget) {}

    // From or to their bytes; each layer for itself.
    template <class Coder>
    void code_states(Coder& coder, Budget& budget) {
        StatesModel map_states(budget), faces_states(budget), diff_states(budget);
        map.code_states(coder, map_states);
        faces.code_states(coder, faces_states);
        diff.code_states(coder, diff_states);
    }

    MapModel<effort> map;
    FacesModel<effort, true> faces;
    DiffModel<effort> diff;
};

// Those of both efforts and of profile classic, as far as they are loaded. Read only, so many streams share them.
struct Trained {
    std::unique_ptr<TrainedLayers<COMPILED<Effort::standard>>> standard;
    std::unique_ptr<TrainedLayers<COMPILED<Effort::high>>> high;
    std::unique_ptr<ClassicFacesModel> classic;

    template <Effort effort>
    const TrainedLayers<COMPILED<effort>>& of() const {
        if constexpr (effort == Effort::standard) {
            if (!standard) fail(Fault::argument, "the trained states of effort default are not loaded");
            return *standard;
        } else {
            if (!high) fail(Fault::argument, "the trained states of effort high are not loaded");
            return *high;
        }
    }
    const ClassicFacesModel& of_classic() const {
        if (!classic) fail(Fault::argument, "the trained states of profile classic are not loaded");
        return *classic;
    }
};

// What Maps and faces have learned.
template <Effort effort>
struct ReliableModels {
    ReliableModels(Budget& budget, const TrainedLayers<effort>& trained) : map(budget), faces(budget), memory(budget) {
        map.copy(trained.map);
        faces.copy(trained.faces);
    }
    MapModel<effort> map;
    FacesModel<effort, true> faces;
    FacesMemory memory;
    size_t map_bytes = 0; // of the payloads that were decoded, for those who want to know what layers cost
};

// What an encoder knows of the finer level.
struct LevelTruth {
    MapTruth map;
    FacesTruth faces;
};

// Codes the next level of a chain whose last one has cells to split.
template <Effort effort, class Coder>
void code_next_level(Coder& coder, const Plan& plan, ReliableModels<effort>& models, LevelChain& chain,
                     const LevelTruth& truth = {}) {
    expect(!chain.ends(), "nothing is left to split");
    Level& fine = chain.begin_next();
    Level& coarse = chain.before_next();
    MapOptions options{plan.bits, plan.vertices, plan.mirror};
    size_t before = 0;
    if constexpr (!Coder::encoding) before = coder.offset();
    code_map<effort>(coder, options, models.map, coarse, fine, truth.map);
    models.map.room.rest(coarse.vertex_count());
    if constexpr (!Coder::encoding) models.map_bytes += coder.offset() - before;
    code_faces<effort, true>(coder, coarse, fine, models.faces, models.memory,
                             FacesTask{plan.bits, plan.most_faces, truth.faces});
    models.memory.rest(fine.vertex_count());
    chain.complete_next();
    if (chain.ends()) expect(fine.vertex_count() == plan.vertices, "another number of vertices than was announced");
}

// The bit planes of one slice after the last one that it knows, up to a depth.
template <Effort effort, class Coder>
void code_planes(Coder& coder, const LevelChain& chain, DiffSlice& slice, DiffModel<effort>& model, int depth,
                 const Octree* truth = nullptr) {
    for (int plane = slice.known_depth() + 1; plane <= depth; plane++) {
        const Level& level = chain.at(plane);
        if (level.depth == plane) slice.enter(level);
        DiffTruth known{};
        if (truth != nullptr) known = {truth->positions, truth->depths[static_cast<size_t>(level.depth)].first.span()};
        code_diff<effort>(coder, plane, slice, model, known);
    }
    bool goes_on = chain.ends() && depth >= chain.last().depth && depth < chain.known_depth(); // on this level
    if (!goes_on) slice.rest();
}

} // namespace meshtide::inline MESHTIDE_ISA
