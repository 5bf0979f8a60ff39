#include "codec/effort_layers.hpp"

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
    EncoderLayersOf(Budget& budget, const Octree& octree, const MirrorPlane& mirror, Span<const uint64_t> starts)
        : octree_(octree), plan_(plan_of(octree, mirror)), chain_(budget, plan_), reliable_(budget),
          slices_(make_slices<effort>(budget, plan_, starts)), octants_(budget), leaves_(budget) {
        for (auto& each : slices_) each.diffs.enter(chain_.at(0));
    }

    void encode_base(int base_depth, Array<uint8_t>& out) override {
        RangeEncoder coder(out);
        while (chain_.known_depth() < base_depth) code_level(coder);
        coder.finish();
    }
    void encode_next_level(Array<uint8_t>& out) override {
        RangeEncoder coder(out);
        code_level(coder);
        coder.finish();
    }
    void encode_planes(size_t slice, int depth, Array<uint8_t>& out) override {
        RangeEncoder coder(out);
        code_planes<effort>(coder, chain_, slices_[slice].diffs, slices_[slice].model, depth, &octree_);
        coder.finish();
    }
    void encode_preview(Array<uint8_t>& out) override {
        RangeEncoder coder(out);
        while (!chain_.ends()) code_level(coder);
        code_planes<effort>(coder, chain_, slices_[0].diffs, slices_[0].model, octree_.bits, &octree_);
        coder.finish();
    }
    const LevelChain& chain() const override { return chain_; }

private:
    void code_level(RangeEncoder& coder) {
        auto depth = static_cast<size_t>(chain_.known_depth());
        const Octree::Depth& coarse = octree_.depths[depth];
        const Octree::Depth& fine = octree_.depths[depth + 1];
        octants_.assign(coarse.cell_count(), 0);
        leaves_.assign(coarse.cell_count(), 0);
        int shift = octree_.bits - static_cast<int>(depth) - 1;
        for (size_t cell = 0; cell < fine.cell_count(); cell++) {
            size_t first = fine.first[cell];
            uint32_t octant = 0;
            for (size_t k = 0; k < 3; k++)
                octant = octant << 1 | (static_cast<uint32_t>(octree_.positions[3 * first + k]) >> shift & 1);
            auto bit = static_cast<uint8_t>(1u << octant);
            octants_[fine.parents[cell]] |= bit;
            if (fine.is_leaf(cell)) leaves_[fine.parents[cell]] |= bit;
        }
        LevelTruth truth{{octants_.span(), leaves_.span()}, {fine.faces.span()}};
        code_next_level<effort>(coder, plan_, reliable_, chain_, truth);
    }

    const Octree& octree_;
    Plan plan_;
    LevelChain chain_;
    ReliableModels<effort> reliable_;
    std::vector<SliceLayers<effort>> slices_;
    Array<uint8_t> octants_, leaves_; // of each cell of the level that is split
};

} // namespace

std::unique_ptr<DecoderLayers> make_decoder_layers(Effort effort, Budget& budget, const Plan& plan,
                                                   Span<const uint64_t> starts) {
    if (effort == Effort::high) return std::make_unique<DecoderLayersOf<Effort::high>>(budget, plan, starts);
    return std::make_unique<DecoderLayersOf<Effort::standard>>(budget, plan, starts);
}

std::unique_ptr<EncoderLayers> make_encoder_layers(Effort effort, Budget& budget, const Octree& octree,
                                                   const MirrorPlane& mirror, Span<const uint64_t> starts) {
    if (effort == Effort::high) return std::make_unique<EncoderLayersOf<Effort::high>>(budget, octree, mirror, starts);
    return std::make_unique<EncoderLayersOf<Effort::standard>>(budget, octree, mirror, starts);
}

} // namespace meshtide::inline MESHTIDE_ISA
