// From one depth of the octree to the next: a Map, then faces, in one range-coded payload (docs/format.md, Packets and
// levels). One function for both directions; an encoder's levels are made by the very walk that codes them, so that its
// half-edges stand where a decoder's will.
#pragma once

#include "diff/code_diff.hpp"
#include "faces/faces.hpp"
#include "map/map.hpp"
#include "mesh/octree.hpp"

#include <vector>

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
    LevelChain(Budget& budget, const Plan& plan) : budget_(budget), bits_(plan.bits) {
        Level& root = levels_.emplace_back(budget);
        auto middle = static_cast<float>(1 << plan.bits); // of the cube, in half finest steps
        root.centres.push(F32x4{middle, middle, middle, 0});
        root.cell_depths.push(0);
        all_leaves_ = plan.vertices == 1;
        root.leaves.push(all_leaves_);
        root.parents.push(0);
        root.heads.push(NONE);
        root.degrees.push(0);
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
    Level& begin_next() { return levels_.emplace_back(budget_); }
    Level& before_next() { return levels_[complete_ - 1]; }
    void complete_next() {
        complete_++;
        all_leaves_ = true;
        for (uint8_t leaf : levels_.back().leaves) all_leaves_ = all_leaves_ && leaf != 0;
    }

private:
    Budget& budget_;
    int bits_;
    std::vector<Level> levels_;
    size_t complete_ = 1; // the last one may be in the making, or have failed
    bool all_leaves_ = false;
};

// What Maps and faces have learned.
template <Effort effort>
struct ReliableModels {
    explicit ReliableModels(Budget& budget) : map(budget), faces(budget), memory(budget) {}
    MapModel<effort> map;
    FacesModel<effort, true> faces;
    FacesMemory memory;
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
    MapOptions options{plan.bits, plan.vertices, {plan.mirror.axis, plan.mirror.sum}};
    code_map<effort>(coder, options, models.map, coarse, fine, truth.map);
    code_faces<effort, true>(coder, coarse, fine, models.faces, models.memory,
                             FacesTask{plan.bits, plan.most_faces, truth.faces});
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
}

} // namespace meshtide::inline MESHTIDE_ISA
