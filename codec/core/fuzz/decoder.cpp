// libFuzzer: a stream of a header and packets, damaged in any way; whatever it is, it ends within the limits.
//
// The first two bytes tell the length of the header; the packets follow, as long as its table says. Checksums are not
// looked at here, so mutations get through to the coders.
#include "codec/stream_decoder.hpp"

#include <cstdlib>

using namespace meshtide;

namespace {

const Trained& untrained() {
    static Budget budget(UINT64_MAX);
    static const Trained trained = [] {
        Trained made;
        made.standard = std::make_unique<TrainedLayers<Effort::standard>>(budget);
        made.high = std::make_unique<TrainedLayers<Effort::high>>(budget);
        made.classic = std::make_unique<ClassicFacesModel>(budget);
        return made;
    }();
    return trained;
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t count) {
    if (count < 2) return 0;
    size_t header_size = bytes[0] | static_cast<size_t>(bytes[1]) << 8;
    if (header_size > count - 2) return 0;
    Limits limits;
    limits.vertices = 1u << 14;
    limits.faces = 1u << 15;
    limits.packets = 256;
    limits.memory = 1u << 28;
    Budget budget(limits.memory);
    try {
        Header header(budget);
        parse_header({bytes + 2, header_size}, limits, header);
        auto decoder = make_stream_decoder(header, untrained(), budget);
        Shown shown(budget);
        size_t at = 2 + header_size;
        for (const PacketEntry& entry : header.packets) {
            size_t length = entry.length < count - at ? static_cast<size_t>(entry.length) : count - at;
            try {
                decoder->push({static_cast<PacketKind>(entry.kind), entry.level, entry.slice}, {bytes + at, length});
            } catch (const Failure& failure) {
                if (failure.fault == Fault::internal) std::abort();
            }
            at += length;
        }
        for (uint32_t level = 0; level <= MOST_LEVEL; level++)
            if ((decoder->available() >> level & 1) != 0) decoder->show(level, shown);
    } catch (const Failure& failure) {
        if (failure.fault == Fault::internal) std::abort();
    }
    return 0;
}
