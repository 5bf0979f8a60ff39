// What of a compact stream depends on its effort, behind one interface: everything else is the same code for both.
#pragma once

#include "codec/stream_decoder.hpp"

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
    // The depth that the Diffs of all slices have come to.
    virtual int known_depth() const = 0;
    // Bytes of Maps that were decoded.
    virtual size_t map_bytes() const = 0;
};

// The slices of the Diffs, and what each has learned. A header may announce thousands; one without vertices takes no
// models of its own.
template <Effort effort>
class SliceLayers {
public:
    // starts: the first Morton code of each.
    SliceLayers(Budget& budget, const Plan& plan, Span<const uint64_t> starts, const DiffModel<effort>& trained)
        : budget_(budget), trained_(trained), slices_(budget) {
        for (size_t i = 0; i < starts.size(); i++) {
            SliceRange range{plan.bits, starts[i]};
            if (i + 1 < starts.size()) range.end = starts[i + 1];
            slices_.add(budget, range, plan.mirror);
        }
    }

    void enter(const Level& root) {
        for (Slice& slice : slices_) slice.diffs.enter(root);
    }
    template <class Coder>
    void code(Coder& coder, const LevelChain& chain, size_t number, int depth, const Octree* truth = nullptr) {
        DiffSlice& slice = slices_[number].diffs;
        auto& model = slices_[slice.run_of(chain.at(depth)).count() == 0 ? 0 : number].model;
        if (!model) {
            model = std::make_unique<DiffModel<effort>>(budget_);
            model->copy(trained_);
        }
        code_planes<effort>(coder, chain, slice, *model, depth, truth);
    }
    const DiffSlice& at(size_t number) const { return slices_[number].diffs; }
    size_t size() const { return slices_.size(); }
    // The depth that the Diffs of all slices have come to.
    int known_depth() const {
        int known = at(0).known_depth();
        for (const Slice& slice : slices_) known = std::min(known, slice.diffs.known_depth());
        return known;
    }

private:
    struct Slice {
        Slice(Budget& budget, SliceRange range, MirrorPlane mirror) : diffs(budget, range, mirror) {}
        DiffSlice diffs;
        std::unique_ptr<DiffModel<effort>> model;
    };

    Budget& budget_;
    const DiffModel<effort>& trained_;
    List<Slice> slices_;
};

template <Effort effort>
class DecoderLayersOf final : public DecoderLayers {
public:
    DecoderLayersOf(Effort chosen, Budget& budget, const Plan& plan, Span<const uint64_t> starts,
                    const TrainedLayers<effort>& trained, int64_t& offset)
        : chosen_(chosen), plan_(plan), reliable_(budget, trained), slices_(budget, plan, starts, trained.diff),
          offset_(offset) {}

    void decode_base(Span<const uint8_t> payload, LevelChain& chain, int base_depth) override {
        choose(chosen_);
        PayloadDecoder decoder(payload, offset_);
        decode_levels(decoder.coder, chain, base_depth);
        decoder.coder.finish();
    }
    void decode_preview(Span<const uint8_t> payload, LevelChain& chain, int leaf_depth) override {
        choose(chosen_);
        PayloadDecoder decoder(payload, offset_);
        decode_levels(decoder.coder, chain, leaf_depth);
        slices_.code(decoder.coder, chain, 0, plan_.bits);
        decoder.coder.finish();
    }
    void decode_next_level(Span<const uint8_t> payload, LevelChain& chain) override {
        choose(chosen_);
        PayloadDecoder decoder(payload, offset_);
        code_next_level<effort>(decoder.coder, plan_, reliable_, chain);
        decoder.coder.finish();
    }
    void decode_planes(Span<const uint8_t> payload, const LevelChain& chain, size_t slice, int depth) override {
        choose(chosen_);
        PayloadDecoder decoder(payload, offset_);
        slices_.code(decoder.coder, chain, slice, depth);
        decoder.coder.finish();
    }
    const DiffSlice& slice(size_t number) const override { return slices_.at(number); }
    int known_depth() const override { return slices_.known_depth(); }
    size_t map_bytes() const override { return reliable_.map_bytes; }

private:
    void decode_levels(RangeDecoder& coder, LevelChain& chain, int depth) {
        while (chain.known_depth() < depth) code_next_level<effort>(coder, plan_, reliable_, chain);
        slices_.enter(chain.at(0));
    }

    Effort chosen_;
    Plan plan_;
    ReliableModels<effort> reliable_;
    SliceLayers<effort> slices_;
    int64_t& offset_;
};

// offset: becomes how far each payload was read.
std::unique_ptr<DecoderLayers> make_decoder_layers(Effort effort, Budget& budget, const Plan& plan,
                                                   Span<const uint64_t> starts, const Trained& trained,
                                                   int64_t& offset);

// The same for an encoder, which knows the whole octree. Payloads are written into `out`.
class EncoderLayers {
public:
    virtual ~EncoderLayers() = default;
    virtual void encode_base(int base_depth, Array<uint8_t>& out) = 0;
    virtual void encode_next_level(Array<uint8_t>& out) = 0;
    // The bit planes of a slice up to a depth, whose level is known, are added to its payload in the making; how long
    // that is by now.
    virtual size_t add_planes(size_t slice, int depth) = 0;
    // Ends that payload, which is empty where nothing had to be coded.
    virtual void take_planes(size_t slice, Array<uint8_t>& out) = 0;
    // Levels down to the one whose cells are all leaves, and all bit planes.
    virtual void encode_preview(Array<uint8_t>& out) = 0;
    virtual const LevelChain& chain() const = 0;
};

std::unique_ptr<EncoderLayers> make_encoder_layers(Effort effort, Budget& budget, const Octree& octree,
                                                   const MirrorPlane& mirror, Span<const uint64_t> starts,
                                                   const Trained& trained);

} // namespace meshtide::inline MESHTIDE_ISA
