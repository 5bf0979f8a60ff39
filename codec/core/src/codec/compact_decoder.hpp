// The decoder of profile compact: rebuilds previews and levels from their packets, in any order, also without the
// Diffs.
//
// Base and Map&Conn give the cells and faces of each level, whatever happens to the Diffs. A Diff tells more bits of
// the vertices that are alone in their cells; one that is missing leaves its vertices inside of the cells that are
// known, and the later Diffs of its slice wait for it.
#pragma once

#include "codec/effort_layers.hpp"
#include "stream/header.hpp"
#include "surface/display_filter.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// What a client draws.
struct Shown {
    explicit Shown(Budget& budget) : positions(budget), faces(budget) {}
    Array<double> positions; // three for each vertex, in finest steps
    Array<int32_t> faces;    // three corners each, the least one first, in lexicographic order
};

// Which packet a failure is about; it may be an earlier one, which had to wait.
struct PacketPlace {
    PacketKind kind = PacketKind::base;
    uint32_t level = 0;
    uint32_t slice = 0;
};

class CompactDecoder {
public:
    CompactDecoder(const Header& header, const Limits& limits, Budget& budget);

    // Takes one packet. Fails where it has no place in the stream, came before, or is damaged; what was decoded before
    // stays usable.
    void push(PacketPlace place, Span<const uint8_t> payload);
    // The packet that the last failure is about.
    const PacketPlace& place() const { return place_; }

    // Levels and previews that can be shown, and those of them that are as the encoder made them: bit l for level l.
    uint64_t available() const;
    uint64_t exact() const;

    void show(uint32_t level, Shown& shown) const;

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
        std::vector<Waiting> waiting;
        bool broken = false;
    };

    int depth_of(uint32_t level) const { return header_.bits - static_cast<int>(level); }
    uint32_t coarsest() const { return static_cast<uint32_t>(header_.bits - header_.compact.base_depth); }
    size_t entry_of(PacketPlace place) const;
    void decode_preview(PacketPlace place, Span<const uint8_t> payload);
    void decode_levels();
    void decode_diffs(size_t slice);
    int reached_depth() const;

    const Header& header_;
    Limits limits_;
    Budget& budget_;
    Plan plan_;
    LevelChain chain_;
    std::unique_ptr<DecoderLayers> layers_;
    bool has_base_ = false, broken_ = false;
    std::vector<Waiting> waiting_; // Map&Conn packets
    std::vector<SliceProgress> slices_;
    std::vector<Preview> previews_;
    Array<uint8_t> taken_; // 1 for each entry of the packet table that came
    PacketPlace place_;
};

// Where to draw vertices of which the middles of known cells are given, in half finest steps, their depths in the fourth
// lanes; by the faces in `shown`. What was known is used up.
void draw_known(Span<F32x4> known, int bits, Strength strength, Shown& shown, Budget& budget);

// Faces of a level as they are told to others: each rotated so that its least corner comes first, in lexicographic
// order.
void canonical_faces(const Level& level, Array<int32_t>& faces, Budget& budget);

} // namespace meshtide::inline MESHTIDE_ISA
