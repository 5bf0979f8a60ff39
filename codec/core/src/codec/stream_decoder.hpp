// A decoder of one stream, of either profile: takes packets in any order, knows what can be shown, and shows it.
//
// Experiments with noise (R. Balan, G. Taubin, "3D mesh geometry filtering algorithms for progressive transmission
// schemes", CAD 32, 2000, section 4.2) look at the Diffs of each packet once they are decoded, and hand back others,
// which are added in their place. Nothing is kept for them unless it is asked for.
#pragma once

#include "codec/layers.hpp"
#include "stream/header.hpp"

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
    int64_t offset = -1; // the byte up to which its payload was read; -1: not yet
};

// The Diffs of one packet.
struct DecodedDiffs {
    DecodedDiffs(Budget& budget, uint32_t level_, uint32_t slice_) : level(level_), slice(slice_), values(budget) {}
    uint32_t level, slice;
    Array<double> values; // three for each, in steps of the level's grid
};

// Decodes a payload; how far it was read is known even if that fails.
class PayloadDecoder {
public:
    PayloadDecoder(Span<const uint8_t> payload, int64_t& offset) : coder(payload), offset_(offset) {}
    ~PayloadDecoder() { offset_ = static_cast<int64_t>(coder.offset()); }
    PayloadDecoder(const PayloadDecoder&) = delete;
    PayloadDecoder& operator=(const PayloadDecoder&) = delete;
    RangeDecoder coder;

private:
    int64_t& offset_;
};

// What other Diffs do, in the place of those that were decoded. Behind an interface, so that a decoder whose Diffs
// nobody can watch, as in a browser, is linked without it.
class DiffShifts {
public:
    virtual ~DiffShifts() = default;
    // Tells the Diffs that have brought a slice to its depth; level: that of this depth.
    virtual void note(size_t number, const DiffSlice& slice, const Level& level, int bits,
                      Array<double>& differences) = 0;
    // Shifts what the Diffs of a slice that ended at this depth have moved. scale: finest steps in one of theirs.
    virtual void replace(size_t number, int depth, double scale, Span<const double> differences,
                         Span<const double> others) = 0;
    // Applies all shifts of a slice to what is drawn of a level.
    virtual void shift(size_t number, const DiffSlice& slice, const Level& level, int bits,
                       Span<double> positions) const = 0;
};

class StreamDecoder {
public:
    StreamDecoder(const Header& header, Budget& budget);
    StreamDecoder(const StreamDecoder&) = delete;
    StreamDecoder& operator=(const StreamDecoder&) = delete;
    virtual ~StreamDecoder() = default;

    // Takes one packet. Fails where it has no place in the stream, came before, or is damaged; what was decoded before
    // stays usable.
    void push(PacketPlace place, Span<const uint8_t> payload);
    // The packet that the last failure is about.
    const PacketPlace& place() const { return place_; }

    // Levels and previews that can be shown, and those of them that are as the encoder made them: bit l for level l.
    virtual uint64_t available() const = 0;
    virtual uint64_t exact() const = 0;

    // Those that became available or better by the last push; none if it failed.
    uint64_t changed() const { return changed_; }
    // Bytes that code vertices in the Base and Map&Conn packets that were decoded; faces take the others.
    virtual uint64_t map_bytes() const = 0;

    virtual void show(uint32_t level, Shown& shown) = 0;
    // The packet that coded the faces of a level: what a failure to show it is about.
    PacketPlace faces_of(uint32_t level) const;

    // From now on no level that a finer one replaces needs to be shown, so it may be given back.
    void keep_finest_only() { only_finest_ = true; }

    // From now on the Diffs that a push decodes are kept. To be called before the first packet.
    void watch_diffs();
    // Those of the packets that the last push decoded: itself, and others that had to wait for it.
    const List<DecodedDiffs>& decoded_diffs() const { return decoded_; }
    // Has other numbers, as many and finite, added in place of one of them.
    void replace_diffs(size_t which, Span<const double> values);

protected:
    // What a packet of the table, that did not come before, brings.
    virtual void take(PacketPlace place, Span<const uint8_t> payload) = 0;
    virtual void replace(const DecodedDiffs& decoded, Span<const double> values) = 0;

    // Levels up to this one become better by the packet in hand, as far as they can be shown.
    void improve(uint32_t coarsest) { improved_ |= (static_cast<uint64_t>(2) << coarsest) - 1; }
    bool watching() const { return shifts_ != nullptr; }
    DiffShifts& shifts() { return *shifts_; }
    bool only_finest() const { return only_finest_; }
    DecodedDiffs& keep_diffs(uint32_t level, uint32_t slice) { return decoded_.add(budget_, level, slice); }

    const Header& header_;
    Budget& budget_;
    PacketPlace place_;

private:
    size_t entry_of(PacketPlace place);

    Array<uint8_t> taken_; // 1 for each entry of the packet table that came
    size_t next_ = 0;      // the entry after the last one that came, where the next one is likely to be
    uint64_t improved_ = 0, changed_ = 0;
    bool only_finest_ = false;
    std::unique_ptr<DiffShifts> shifts_; // where Diffs are watched
    List<DecodedDiffs> decoded_;
};

// The decoder of the header's profile. The header and what is trained have to outlive it.
std::unique_ptr<StreamDecoder> make_stream_decoder(const Header& header, const Trained& trained, Budget& budget);

} // namespace meshtide::inline MESHTIDE_ISA
