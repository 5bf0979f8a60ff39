#include "codec/effort_layers.hpp"

#include <algorithm>
#include <vector>

namespace meshtide::inline MESHTIDE_ISA {

namespace {

// The finest level may have more faces than vertices; a coarser one never has more than it.
Plan plan_of(const Octree& octree, const MirrorPlane& mirror) {
    Plan plan;
    plan.bits = octree.bits;
    plan.vertices = octree.positions.size() / 3;
    plan.most_faces = octree.depths.back().faces.size() / 3;
    plan.mirror = mirror;
    return plan;
}

template <Effort effort>
class EncoderLayersOf final : public EncoderLayers {
public:
    EncoderLayersOf(Effort chosen, Budget& budget, const Octree& octree, const MirrorPlane& mirror,
                    Span<const uint64_t> starts, const TrainedLayers<effort>& trained)
        : chosen_(chosen), budget_(budget), octree_(octree), plan_(plan_of(octree, mirror)), chain_(budget, plan_),
          reliable_(budget, trained), slices_(budget, plan_, starts, trained.diff), octants_(budget), leaves_(budget) {
        slices_.enter(chain_.at(0));
        for (size_t slice = 0; slice < slices_.size(); slice++) planes_.push_back(std::make_unique<Payload>(budget));
    }

    void encode_base(int base_depth, Array<uint8_t>& out) override {
        choose(chosen_);
        RangeEncoder coder(out);
        while (chain_.known_depth() < base_depth) code_level(coder);
        coder.finish();
    }
    void encode_next_level(Array<uint8_t>& out) override {
        choose(chosen_);
        RangeEncoder coder(out);
        code_level(coder);
        coder.finish();
    }
    size_t add_planes(size_t slice, int depth) override {
        choose(chosen_);
        Payload& payload = *planes_[slice];
        slices_.code(payload.coder, chain_, slice, depth, &octree_);
        if (slice + 1 == slices_.size()) chain_.forget(slices_.known_depth() + 1, false); // the octree is drawn
        return std::max<size_t>(payload.coder.size(), payload.coder.has_coded());
    }
    void take_planes(size_t slice, Array<uint8_t>& out) override {
        planes_[slice]->coder.finish();
        out.copy(planes_[slice]->bytes.span());
        planes_[slice] = std::make_unique<Payload>(budget_);
    }
    void encode_preview(Array<uint8_t>& out) override {
        choose(chosen_);
        RangeEncoder coder(out);
        while (!chain_.ends()) code_level(coder);
        slices_.code(coder, chain_, 0, octree_.bits, &octree_);
        coder.finish();
    }
    const LevelChain& chain() const override { return chain_; }

private:
    // In the making.
    struct Payload {
        explicit Payload(Budget& budget) : bytes(budget), coder(bytes) {}
        Array<uint8_t> bytes;
        RangeEncoder coder;
    };

    void code_level(RangeEncoder& coder) {
        auto depth = static_cast<size_t>(chain_.known_depth());
        const Octree::Depth& coarse = octree_.at(static_cast<int>(depth));
        const Octree::Depth& fine = octree_.at(static_cast<int>(depth) + 1);
        octants_.assign(coarse.cell_count(), 0);
        leaves_.assign(coarse.cell_count(), 0);
        int shift = octree_.bits - static_cast<int>(depth) - 1;
        for (size_t cell = 0, parent = 0; cell < fine.cell_count(); cell++) {
            size_t first = fine.first[cell];
            uint32_t octant = 0;
            for (size_t k = 0; k < 3; k++)
                octant = octant << 1 | (static_cast<uint32_t>(octree_.positions[3 * first + k]) >> shift & 1);
            auto bit = static_cast<uint8_t>(1u << octant);
            parent = coarse.cell_of(first, parent);
            octants_[parent] |= bit;
            if (fine.is_leaf(cell)) leaves_[parent] |= bit;
        }
        LevelTruth truth{{octants_.span(), leaves_.span()}, {fine.faces.span()}};
        code_next_level<effort>(coder, plan_, reliable_, chain_, truth);
    }

    Effort chosen_;
    Budget& budget_;
    const Octree& octree_;
    Plan plan_;
    LevelChain chain_;
    ReliableModels<effort> reliable_;
    SliceLayers<effort> slices_;
    std::vector<std::unique_ptr<Payload>> planes_; // of each slice
    Array<uint8_t> octants_, leaves_;              // of each cell of the level that is split
};

} // namespace

std::unique_ptr<DecoderLayers> make_decoder_layers(Effort effort, Budget& budget, const Plan& plan,
                                                   Span<const uint64_t> starts, const Trained& trained,
                                                   int64_t& offset) {
    choose(effort);
    auto make = [&]<Effort compiled>(const TrainedLayers<compiled>& known) -> std::unique_ptr<DecoderLayers> {
        return std::make_unique<DecoderLayersOf<compiled>>(effort, budget, plan, starts, known, offset);
    };
    if constexpr (DECODES_ALL)
        if (effort == Effort::high) return make(trained.of<Effort::high>());
    return make(trained.of<Effort::standard>());
}

std::unique_ptr<EncoderLayers> make_encoder_layers(Effort effort, Budget& budget, const Octree& octree,
                                                   const MirrorPlane& mirror, Span<const uint64_t> starts,
                                                   const Trained& trained) {
    choose(effort);
    auto make = [&]<Effort compiled>(const TrainedLayers<compiled>& known) -> std::unique_ptr<EncoderLayers> {
        return std::make_unique<EncoderLayersOf<compiled>>(effort, budget, octree, mirror, starts, known);
    };
    return effort == Effort::high ? make(trained.of<Effort::high>()) : make(trained.of<Effort::standard>());
}

} // namespace meshtide::inline MESHTIDE_ISA
