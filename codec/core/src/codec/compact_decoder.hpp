// The decoder of profile compact: rebuilds previews and levels from their packets, in any order, also without the
// Diffs.
//
// Base and Map&Conn give the cells and faces of each level, whatever happens to the Diffs. A Diff adds bits of
// the vertices that are alone in their cells; one that is missing leaves its vertices inside of the cells that are
// known, and the later Diffs of its slice wait for it.
#pragma once

#include "codec/effort_layers.hpp"
#include "surface/display_filter.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

class CompactDecoder final : public StreamDecoder {
public:
    CompactDecoder(const Header& header, const Trained& trained, Budget& budget);

    uint64_t available() const override;
    uint64_t exact() const override;
    uint64_t map_bytes() const override;
    void show(uint32_t level, Shown& shown) override;

protected:
    void take(PacketPlace place, Span<const uint8_t> payload) override;
    void replace(const DecodedDiffs& decoded, Span<const double> values) override;

private:
    struct Preview {
        explicit Preview(Budget& budget) : shown(budget) {}
        uint32_t level = 0;
        Shown shown;
    };
    // A payload that came before what it builds on.
    struct Waiting {
        Waiting(Budget& budget, int depth_, Span<const uint8_t> payload_) : depth(depth_), payload(budget) {
            payload.copy(payload_);
        }
        int depth;
        Array<uint8_t> payload;
    };
    struct SliceProgress {
        explicit SliceProgress(Budget& budget) : waiting(budget) {}
        List<Waiting> waiting;
        bool broken = false;
    };

    int depth_of(uint32_t level) const { return header_.bits - static_cast<int>(level); }
    int first_drawn() const { return std::max(header_.compact.base_depth, chain_.first_drawn()); }
    uint32_t coarsest() const { return static_cast<uint32_t>(header_.bits - header_.compact.base_depth); }
    // Of those that wait, the one that ends at a depth; as many as there are if none does.
    static size_t find(const List<Waiting>& waiting, int depth);
    void decode_preview(PacketPlace place, Span<const uint8_t> payload);
    void decode_levels();
    void decode_diffs(size_t slice);

    const Trained& trained_;
    Plan plan_;
    LevelChain chain_;
    std::unique_ptr<DecoderLayers> layers_;
    bool has_base_ = false, broken_ = false;
    List<Waiting> waiting_; // Map&Conn packets
    List<SliceProgress> slices_;
    List<Preview> previews_;
    bool refined_ = false; // a Diff of this push made something known
};

// Where a decoder draws the vertices of a level when the Diffs down to a depth are there, by the octree that gives the
// truth: three coordinates for each.
void show_truth(const Octree& octree, int depth, int known_depth, Strength strength, Span<double> positions,
                Budget& budget);

} // namespace meshtide::inline MESHTIDE_ISA
