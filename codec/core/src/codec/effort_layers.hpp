// What of a compact stream depends on its effort, behind one interface: everything else is the same code for both.
#pragma once

#include "codec/layers.hpp"

#include <memory>

namespace meshtide::inline MESHTIDE_ISA {

// The layers of one stream, as a decoder meets them.
class DecoderLayers {
public:
    virtual ~DecoderLayers() = default;
    // The levels of the depths 1 .. base depth.
    virtual void decode_base(Span<const uint8_t> payload, LevelChain& chain, int base_depth) = 0;
    virtual void decode_next_level(Span<const uint8_t> payload, LevelChain& chain) = 0;
    // The bit planes up to a depth of a slice, by its number.
    virtual void decode_planes(Span<const uint8_t> payload, const LevelChain& chain, size_t slice, int depth) = 0;
    // A whole mesh in one payload: levels down to the depth at which all cells are leaves, then all bit planes.
    virtual void decode_preview(Span<const uint8_t> payload, LevelChain& chain, int leaf_depth) = 0;
    virtual const DiffSlice& slice(size_t number) const = 0;
};

// What one slice of Diffs knows and has learned.
template <Effort effort>
struct SliceLayers {
    SliceLayers(Budget& budget, SliceRange range, MirrorPlane mirror) : diffs(budget, range, mirror), model(budget) {}
    DiffSlice diffs;
    DiffModel<effort> model;
};

// starts: the first Morton code of each slice.
template <Effort effort>
std::vector<SliceLayers<effort>> make_slices(Budget& budget, const Plan& plan, Span<const uint64_t> starts) {
    std::vector<SliceLayers<effort>> slices;
    for (size_t i = 0; i < starts.size(); i++) {
        SliceRange range{plan.bits, starts[i]};
        if (i + 1 < starts.size()) range.end = starts[i + 1];
        slices.emplace_back(budget, range, plan.mirror);
    }
    return slices;
}

template <Effort effort>
class DecoderLayersOf final : public DecoderLayers {
public:
    DecoderLayersOf(Budget& budget, const Plan& plan, Span<const uint64_t> starts)
        : plan_(plan), reliable_(budget), slices_(make_slices<effort>(budget, plan, starts)) {}

    void decode_base(Span<const uint8_t> payload, LevelChain& chain, int base_depth) override {
        RangeDecoder coder(payload);
        decode_levels(coder, chain, base_depth);
        coder.finish();
    }
    void decode_preview(Span<const uint8_t> payload, LevelChain& chain, int leaf_depth) override {
        RangeDecoder coder(payload);
        decode_levels(coder, chain, leaf_depth);
        code_planes<effort>(coder, chain, slices_[0].diffs, slices_[0].model, plan_.bits);
        coder.finish();
    }
    void decode_next_level(Span<const uint8_t> payload, LevelChain& chain) override {
        RangeDecoder coder(payload);
        code_next_level<effort>(coder, plan_, reliable_, chain);
        coder.finish();
    }
    void decode_planes(Span<const uint8_t> payload, const LevelChain& chain, size_t slice, int depth) override {
        RangeDecoder coder(payload);
        code_planes<effort>(coder, chain, slices_[slice].diffs, slices_[slice].model, depth);
        coder.finish();
    }
    const DiffSlice& slice(size_t number) const override { return slices_[number].diffs; }

private:
    void decode_levels(RangeDecoder& coder, LevelChain& chain, int depth) {
        while (chain.known_depth() < depth) code_next_level<effort>(coder, plan_, reliable_, chain);
        for (auto& each : slices_) each.diffs.enter(chain.at(0));
    }

    Plan plan_;
    ReliableModels<effort> reliable_;
    std::vector<SliceLayers<effort>> slices_;
};

std::unique_ptr<DecoderLayers> make_decoder_layers(Effort effort, Budget& budget, const Plan& plan,
                                                   Span<const uint64_t> starts);

// The same for an encoder, which knows the whole octree. Payloads are written into `out`.
class EncoderLayers {
public:
    virtual ~EncoderLayers() = default;
    virtual void encode_base(int base_depth, Array<uint8_t>& out) = 0;
    virtual void encode_next_level(Array<uint8_t>& out) = 0;
    // The bit planes of a slice up to a depth, whose level is known.
    virtual void encode_planes(size_t slice, int depth, Array<uint8_t>& out) = 0;
    // Levels down to the one whose cells are all leaves, and all bit planes.
    virtual void encode_preview(Array<uint8_t>& out) = 0;
    virtual const LevelChain& chain() const = 0;
};

std::unique_ptr<EncoderLayers> make_encoder_layers(Effort effort, Budget& budget, const Octree& octree,
                                                   const MirrorPlane& mirror, Span<const uint64_t> starts);

} // namespace meshtide::inline MESHTIDE_ISA
