// The stream header: all that a receiver knows before the first packet (docs/format.md, Header).
//
// Nothing in it is believed before it is checked: counts against the limits before memory is taken, tables against each
// other, the sizes of levels against the bytes that code them.
#pragma once

#include "base/memory.hpp"
#include "stream/numbers.hpp"

namespace meshtide {

constexpr uint8_t FORMAT_VERSION = 4;
constexpr int LEAST_BITS = 4, MOST_BITS = 20; // B
constexpr uint32_t MOST_LEVEL = 63, MOST_SLICE = 65535, MOST_PREVIEWS = 8, MOST_SLICES = 4096;

// The largest claims of a stream that a decoder accepts.
struct Limits {
    uint64_t vertices = 1u << 26; // of one level
    uint64_t faces = 1u << 27;    // of one level
    uint64_t levels = 64;         // states
    uint64_t packets = 1u << 16;
    uint64_t header_bytes = 1u << 24;
    uint64_t packet_bytes = 1u << 30;
    uint64_t memory = 1ull << 34;          // bytes that decoding takes
    uint64_t vertices_per_byte = 1u << 12; // beyond FREE_VERTICES, by the bytes that code them
    uint64_t faces_per_byte = 1u << 13;    // beyond FREE_FACES
};
constexpr uint64_t FREE_VERTICES = 1u << 16, FREE_FACES = 1u << 17;

// Fails where so few bytes claim a mesh of that size.
void check_share(uint64_t vertices, uint64_t faces, uint64_t coding_bytes, const Limits& limits);

enum class Profile : uint8_t { classic = 0, compact = 1 };
enum class PacketKind : uint8_t { base = 0, map_conn = 1, param = 2, diff = 3, preview = 4, order = 5 };
constexpr uint32_t PACKET_KINDS = 6;

struct PacketEntry {
    uint64_t length;   // bytes of the payload
    uint32_t checksum; // CRC-32 of them
    uint16_t slice;
    uint8_t level;
    uint8_t kind; // PacketKind
};

// Something that a client can show, once so many packets are there.
struct StateEntry {
    uint64_t vertices;
    uint64_t faces;
    Distances distances;
    uint32_t packet_count;
    uint32_t level;
};

struct CompactOptions {
    explicit CompactOptions(Budget& budget) : slices(budget) {}

    int32_t effort = 0;                    // 0 default, 1 high
    int32_t mirror_axis = -1;              // 0..2; -1: no plane of symmetry
    int32_t mirror_sum = 0;                // of a coordinate and its mirrored one, in finest steps
    uint8_t strengths[MOST_BITS + 1] = {}; // of the display filter, 0..15, from the base depth on
    Array<uint64_t> slices;                // the first Morton code of each, ascending from 0
    // By the packet table.
    int32_t base_depth = 0;
    uint32_t previews = 0;
    uint32_t diff_depths = 0; // bit b: Diff packets end at depth b
};

enum class FilterKind : uint8_t { zeroth = 0, gaussian = 1, taubin = 2, polynomial = 3, rational = 4 };

struct ClassicOptions {
    uint32_t levels = 0;
    uint8_t shifts[MOST_BITS + 1] = {}; // bits that each level has dropped, level 0 first
    uint32_t diffs = 0;                 // bit l: level l sends a Diff
    FilterKind filter = FilterKind::zeroth;
    uint8_t degree = 0, denominator_degree = 0;
    uint8_t chebyshev = 0; // basis: 0 powers, 1 Chebyshev polynomials
    double norm = 2;       // what the encoder minimised; means nothing to a decoder
    double taubin_lambda = 0, taubin_mu = 0;
};

struct Header {
    explicit Header(Budget& budget) : packets(budget), states(budget), compact(budget) {}

    Profile profile = Profile::compact;
    int32_t bits = 12; // B
    double origin[3] = {};
    double extent = 1;
    Array<PacketEntry> packets;
    Array<StateEntry> states;
    CompactOptions compact;
    ClassicOptions classic;

    uint64_t vertices() const { return states.back().vertices; }
    uint64_t faces() const { return states.back().faces; }
    // The row of the last state of a level, or null.
    const StateEntry* state_of(uint32_t level) const;
};

// Fails with `malformed`, or with `limit` where a claim is over one.
void parse_header(Span<const uint8_t> bytes, const Limits& limits, Header& header);
void write_header(const Header& header, Array<uint8_t>& out);

} // namespace meshtide
