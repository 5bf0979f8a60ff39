#include "codec/stream_decoder.hpp"

#include "codec/classic_decoder.hpp"
#include "codec/compact_decoder.hpp"

namespace meshtide::inline MESHTIDE_ISA {

StreamDecoder::StreamDecoder(const Header& header, Budget& budget)
    : header_(header), budget_(budget), taken_(budget), decoded_(budget) {
    taken_.assign(header.packets.size(), 0);
}

size_t StreamDecoder::entry_of(PacketPlace place) {
    size_t count = header_.packets.size();
    for (size_t steps = 0; steps < count; steps++) {
        size_t i = (next_ + steps) % count;
        const PacketEntry& entry = header_.packets[i];
        if (entry.kind == static_cast<uint8_t>(place.kind) && entry.level == place.level && entry.slice == place.slice)
            return i;
    }
    fail(Fault::malformed, "this stream has no such packet");
}

void StreamDecoder::push(PacketPlace place, Span<const uint8_t> payload) {
    place_ = place;
    decoded_.clear();
    uint64_t before = available();
    improved_ = changed_ = 0;
    size_t entry = entry_of(place);
    expect(taken_[entry] == 0, "it came twice");
    take(place, payload);
    changed_ = available() & (improved_ | ~before);
    taken_[entry] = 1;
    next_ = entry + 1;
}

PacketPlace StreamDecoder::faces_of(uint32_t level) const {
    PacketPlace found{PacketKind::base, MOST_LEVEL, 0};
    for (const PacketEntry& entry : header_.packets) {
        auto kind = static_cast<PacketKind>(entry.kind);
        if (kind != PacketKind::base && kind != PacketKind::map_conn) continue;
        if (entry.level >= level && entry.level <= found.level) found = {kind, entry.level, 0};
    }
    return found;
}

void StreamDecoder::replace_diffs(size_t which, Span<const double> values) {
    if (which >= decoded_.size() || values.size() != decoded_[which].values.size())
        fail(Fault::argument, "other Diffs than were decoded");
    for (double value : values)
        if (value - value != 0) fail(Fault::argument, "Diffs that are not finite");
    replace(decoded_[which], values);
}

std::unique_ptr<StreamDecoder> make_stream_decoder(const Header& header, const Trained& trained, Budget& budget) {
    if constexpr (DECODES_ALL)
        if (header.profile == Profile::classic) return std::make_unique<ClassicDecoder>(header, trained, budget);
    return std::make_unique<CompactDecoder>(header, trained, budget);
}

} // namespace meshtide::inline MESHTIDE_ISA
