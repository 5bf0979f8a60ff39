// Maps: which octants of each cell have children, and which of these are leaves (docs/format.md, Map).
//
// The cells of a depth, in Morton order, become those of the next one. A cell that is no leaf asks its ring, and the
// cells of it that are coded already, where the surface runs; its octants are then coded from the side where the
// surface is expected to be nearer, each by many contexts mixed.
#pragma once

#include "map/model.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// What the header says.
struct MapOptions {
    int bits = 0;        // of the finest coordinates
    size_t vertices = 0; // of the finest mesh
    MirrorPlane mirror;
};

// What an encoder knows of each coarse cell, as masks; of no meaning for leaves.
struct MapTruth {
    Span<const uint8_t> octants, leaves;
};

template <Effort effort, class Coder>
class MapWalk {
    typedef MapMixer<effort> Mix;
    // Whether all neighbours that touch a cell are asked, or only those in its ring.
    static constexpr auto all_contacts = IS_HIGH<effort>;

public:
    MapWalk(Coder& coder, const MapOptions& options, MapModel<effort>& model, const Level& coarse)
        : coder_(coder), options_(options), coarse_(coarse), room_(model.room), mixer_(model.mixer_states()),
          last_(coarse.depth + 1 == options.bits),
          step_(static_cast<float>(static_cast<int32_t>(1) << (options.bits - coarse.depth))) {
        for (int g = 0; g < Mix::context_count / 4; g++) question_.opposed[g] = splat16(0);
    }

    void run(const MapTruth& truth) {
        size_t n = coarse_.vertex_count();
        prepare();
        for (size_t v = 0; v < n; v++) {
            if (coarse_.leaves[v] != 0) continue;
            Children wanted;
            if constexpr (Coder::encoding) wanted = {truth.octants[v], truth.leaves[v]};
            code_cell(v, wanted);
        }
        bool all_leaves = needed_ == vertices_;
        expect(!all_leaves || needed_ == options_.vertices, "fewer cells than vertices");
    }

    // The finer level from what is known of each cell.
    void unfold(Level& coarse, Level& fine) const {
        size_t n = coarse_.vertex_count(), w = 0;
        fine.depth = coarse_.depth + 1;
        fine.centres.resize(vertices_);
        fine.cell_depths.resize(vertices_);
        fine.leaves.resize(vertices_);
        fine.parents.resize(vertices_);
        coarse.first_children.resize(n + 1);
        for (size_t v = 0; v < n; v++) {
            coarse.first_children[v] = static_cast<uint32_t>(w);
            bool is_leaf = coarse_.leaves[v] != 0;
            Children children = room_.notes[v].children();
            uint32_t left = is_leaf ? 1 : children.octants;
            for (; left != 0; left &= left - 1, w++) {
                auto octant = static_cast<uint32_t>(std::countr_zero(left));
                F32x4 shift = is_leaf ? splat(0) : splat(step_) * middle_of(octant);
                fine.centres[w] = coarse_.centres[v] + shift;
                fine.cell_depths[w] = is_leaf ? coarse_.cell_depths[v] : static_cast<uint8_t>(fine.depth);
                fine.leaves[w] = is_leaf || (children.leaves >> octant & 1) != 0;
                fine.parents[w] = static_cast<uint32_t>(v);
            }
        }
        coarse.first_children[n] = static_cast<uint32_t>(w);
    }

private:
    // The middle of an octant, in half cells.
    static F32x4 middle_of(uint32_t octant) {
        return F32x4{(octant & 4) != 0 ? 0.5f : -0.5f, (octant & 2) != 0 ? 0.5f : -0.5f,
                     (octant & 1) != 0 ? 0.5f : -0.5f, 0};
    }

    void prepare() {
        size_t n = coarse_.vertex_count();
        room_.notes.renew(n);
        room_.places.copy(coarse_.centres.span());
        room_.bulges.assign(n, splat(0));
        for (size_t v = 0; v < n; v++) {
            bool leaf = coarse_.leaves[v] != 0;
            auto age = static_cast<uint32_t>(coarse_.depth - coarse_.cell_depths[v]);
            room_.notes[v] = leaf ? Note::leaf(age) : Note();
            needed_ += leaf ? 1 : 2;
            vertices_ += leaf ? 1 : 0;
        }
        expect(needed_ <= options_.vertices, "more cells than vertices");
        if (all_contacts || options_.mirror.exists()) room_.index.prepare(coarse_, options_.bits);
        around_ = {coarse_.centres.span(), room_.notes.span(), room_.places.span(), room_.bulges.span(), 1.0f / step_};
    }

    void code_cell(size_t v, const Children& wanted) {
        Survey survey;
        Ring ring;
        walk_ring(coarse_, v, ring);
        take_survey(survey, around_, ring, v, !all_contacts);
        if (all_contacts) find_contacts(survey, around_, room_.index, v);
        CellFacts cell;
        describe(survey, cell);
        cell.recent = std::min(recent_ >> 4, 15u);
        cell.recent_leaves = recent_leaves_ >> 4;
        Children image;
        bool imaged = false;
        if (options_.mirror.exists()) {
            imaged = room_.index.find_image(options_.mirror, coarse_.centres[v], v, around_.notes, image);
            cell.mirror = imaged ? 2 + std::min(trust_, 2u) : 1;
            cell.trusted = imaged ? (trust_ < 2 ? 1 : 2) : 0;
        }

        uint32_t ranks = 0; // the octants that are occupied, by rank
        Children made;
        made.octants = code_octants(survey, cell, imaged ? &image : nullptr, wanted.octants, ranks);
        if (last_)
            made.leaves = made.octants;
        else if (std::popcount(made.octants) > 1)
            made.leaves = code_leaves(survey, cell, imaged ? &image : nullptr, {made.octants, wanted.leaves}, ranks);
        learn(v, survey, cell, made, ranks);
        if (imaged) {
            bool right = image.octants == made.octants && (last_ || image.leaves == made.leaves);
            trust_ = right ? std::min(trust_ + 1, 4u) : trust_ >> 1;
        }
    }

    uint32_t code_octants(const Survey& survey, const CellFacts& cell, const Children* image, uint32_t wanted,
                          uint32_t& ranks) {
        const uint32_t fewest = last_ ? 2 : 1;
        uint32_t made = 0;
        OctantFacts facts{};
        facts.path = 1;
        for (uint32_t rank = 0; rank < 8; rank++) {
            uint32_t octant = survey.octants[rank];
            bool occupied = true; // as the last ones are, if there are too few
            if (facts.count + 8 - rank > fewest) {
                facts.rank = rank;
                facts.beside = BESIDE[facts.path];
                facts.votes = std::min(byte_of(survey.votes, octant), 7u);
                facts.vote = std::min(facts.votes, 3u);
                facts.faces = byte_of(cell.faces, octant);
                facts.edges = byte_of(cell.edges, octant);
                facts.corner = byte_of(survey.contacts.touches[6], octant);
                facts.inhabited = std::min(byte_of(survey.contacts.children, octant), 7u); // a ring may say it twice
                facts.bare = std::min(byte_of(survey.contacts.cells, octant), 7u) - facts.inhabited;
                facts.answer = image == nullptr ? 0 : 1 + (image->octants >> octant & 1);
                facts.height = cell.heights[rank];
                ask<effort>(question_, cell, facts);
                occupied = mixer_.code(coder_, question_, static_cast<int>(wanted >> octant & 1)) != 0;
            }
            facts.path = 2 * facts.path + occupied;
            facts.count += occupied;
            ranks |= static_cast<uint32_t>(occupied) << rank;
            made |= static_cast<uint32_t>(occupied) << octant;
        }
        return made;
    }

    uint32_t code_leaves(const Survey& survey, const CellFacts& cell, const Children* image, const Children& wanted,
                         uint32_t ranks) {
        uint32_t made = 0, octants = wanted.octants;
        ChildFacts facts{};
        facts.octants = ranks;
        facts.count = static_cast<uint32_t>(std::popcount(octants));
        for (uint32_t rank = 0; rank < 8; rank++) {
            if ((ranks >> rank & 1) == 0) continue;
            uint32_t octant = survey.octants[rank];
            auto bit = [&](uint32_t across) { return octants >> (octant ^ across) & 1; };
            facts.beside = 2 * (bit(4) + bit(2) + bit(1)) + (bit(6) + bit(5) + bit(3) > 1);
            facts.votes = std::min(byte_of(survey.votes, octant), 7u);
            facts.vote = std::min(facts.votes, 3u);
            facts.leaf_votes = std::min(byte_of(survey.leaf_votes, octant), 7u);
            facts.faces = byte_of(cell.faces, octant);
            uint32_t touching = byte_of(survey.contacts.children, octant),
                     leaves = byte_of(survey.contacts.leaves, octant);
            facts.touching_leaves = std::min(leaves, 7u);
            facts.touching_inner = std::min(touching - leaves, 7u);
            facts.answer = image == nullptr ? 0 : 1 + (image->leaves >> octant & 1);
            facts.height = cell.heights[rank];
            ask<effort>(question_, cell, facts);
            bool leaf = mixer_.code(coder_, question_, static_cast<int>(wanted.leaves >> octant & 1)) != 0;
            made |= static_cast<uint32_t>(leaf) << octant;
            (leaf ? facts.leaves : facts.inner)++;
        }
        return made;
    }

    // Cell v as those after it will see it.
    void learn(size_t v, const Survey& survey, const CellFacts& cell, const Children& made, uint32_t ranks) {
        auto count = static_cast<uint32_t>(std::popcount(made.octants));
        auto leaves = static_cast<uint32_t>(std::popcount(made.leaves));
        // At least one finest vertex for each leaf and two for every other cell, instead of this cell's two.
        vertices_ += count;
        needed_ += 2 * count - leaves - 2;
        expect(needed_ <= options_.vertices, "more cells than vertices");
        recent_ += 8 * count - recent_ / 8;
        recent_leaves_ += 32 * leaves / count - recent_leaves_ / 8;
        auto half = [&](uint32_t axis) { return std::popcount(made.octants & UPPER_HALF[axis]); };
        int total = static_cast<int>(count);
        F32x4 mean = to_floats(I32x4{2 * half(0) - total, 2 * half(1) - total, 2 * half(2) - total, 0});
        mean *= splat(0.5f / static_cast<float>(count));
        int32_t missed = 0;
        for (uint32_t rank = 0; rank < 8; rank++)
            if ((ranks >> rank & 1) != 0) missed += std::abs(cell.heights[rank]);
        F32x4 place = coarse_.centres[v] + mean * splat(step_);
        place[3] = static_cast<float>(missed) / static_cast<float>(count * HEIGHT_ONE);
        room_.places[v] = place;
        F32x4 bulge = (mean - survey.mean) * splat(step_);
        bulge[3] = 0;
        room_.bulges[v] = bulge;
        room_.notes[v] = Note::cell(made);
    }

    Coder& coder_;
    const MapOptions& options_;
    const Level& coarse_;
    MapRoom& room_;
    const Mix mixer_;
    const bool last_;
    const float step_; // half finest steps in half a coarse cell
    Vicinity around_{};
    MapQuestion<effort> question_;
    size_t vertices_ = 0;        // of the finer level
    size_t needed_ = 0;          // finest vertices that there must be
    uint32_t trust_ = 0;         // in images, 0 .. 4
    uint32_t recent_ = 96;       // children of the cells coded last, a running mean times 64
    uint32_t recent_leaves_ = 0; // leaves among them, a running mean times 256
};

// From the coarse level, all of it but its children, to the cells of the finer one: their centres, depths, leaves and
// parents, and the children of the coarse one. The truth is for encoders; others hand {}.
template <Effort effort, class Coder>
void code_map(Coder& coder, const MapOptions& options, MapModel<effort>& model, Level& coarse, Level& fine,
              const MapTruth& truth = {}) {
    expect(coarse.depth < options.bits, "a map below the finest depth");
    MapWalk<effort, Coder> walk(coder, options, model, coarse);
    walk.run(truth);
    walk.unfold(coarse, fine);
}

} // namespace meshtide::inline MESHTIDE_ISA
