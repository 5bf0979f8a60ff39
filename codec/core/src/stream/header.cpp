#include "stream/header.hpp"

#include "base/effort.hpp"

#include <bit>

namespace meshtide {

void check_share(uint64_t vertices, uint64_t faces, uint64_t coding_bytes, const Limits& limits) {
    auto most = [coding_bytes](uint64_t free, uint64_t share) {
        bool fits = std::bit_width(coding_bytes) + std::bit_width(share) <= 64;
        uint64_t earned = fits ? coding_bytes * share : UINT64_MAX;
        return earned > free ? earned : free;
    };
    expect_at_most(vertices, most(FREE_VERTICES, limits.vertices_per_byte), "vertices_per_byte");
    expect_at_most(faces, most(FREE_FACES, limits.faces_per_byte), "faces_per_byte");
}

namespace {

// A row of the packet table begins with kind + 8 step + 32 completes.
enum Step : uint32_t { same_level = 0, next_slice = 1, next_level = 2, elsewhere = 3 };
enum Completes : uint32_t { nothing = 0, own_state = 1, more_states = 2, same_size = 3 };

struct Place {
    uint64_t level = 0, slice = 0;
    bool operator==(const Place&) const = default;
};

Place stepped(Place before, uint32_t step) {
    if (step == same_level) return {before.level, 0};
    if (step == next_slice) return {before.level, before.slice + 1};
    return {before.level - 1, 0}; // below 0 it is too large, which is checked
}

uint32_t step_to(Place before, Place place) {
    for (uint32_t step = 0; step < elsewhere; step++)
        if (stepped(before, step) == place) return step;
    return elsewhere;
}

int64_t surplus_of(uint64_t vertices, uint64_t faces) {
    return static_cast<int64_t>(faces) - 2 * static_cast<int64_t>(vertices);
}

constexpr int64_t LARGEST_COUNT = static_cast<int64_t>(1) << 40; // far above any limit, far below an overflow

// The states that follow one packet's row.
void parse_states(ByteReader& reader, uint32_t completes, uint64_t level, Header& header, const Limits& limits) {
    uint64_t count = completes == nothing ? 0 : completes == more_states ? reader.number() : 1;
    expect_at_most(header.states.size() + count, limits.levels, "levels");
    for (uint64_t i = 0; i < count; i++) {
        StateEntry state{};
        uint64_t own = completes == more_states ? reader.number() : level;
        if (own > MOST_LEVEL) reader.fail_here("a level above 63");
        state.level = static_cast<uint32_t>(own);
        state.packet_count = static_cast<uint32_t>(header.packets.size());
        int64_t vertices = 0, faces = 0;
        if (!header.states.empty()) {
            vertices = static_cast<int64_t>(header.states.back().vertices);
            faces = static_cast<int64_t>(header.states.back().faces);
        }
        if (completes != same_size) {
            int64_t growth = reader.signed_number(), surplus_growth = reader.signed_number();
            if (growth < -LARGEST_COUNT || growth > LARGEST_COUNT || surplus_growth < -4 * LARGEST_COUNT ||
                surplus_growth > 4 * LARGEST_COUNT)
                reader.fail_here("a size that no mesh has");
            int64_t surplus = faces - 2 * vertices + surplus_growth;
            vertices += growth;
            faces = surplus + 2 * vertices;
        }
        if (vertices < 1 || faces < 0) reader.fail_here("a level without vertices, or with less than no faces");
        state.vertices = static_cast<uint64_t>(vertices);
        state.faces = static_cast<uint64_t>(faces);
        expect_at_most(state.vertices, limits.vertices, "vertices");
        expect_at_most(state.faces, limits.faces, "faces");
        uint8_t high = reader.byte();
        state.distances = unpack_distances(static_cast<uint16_t>(high << 8 | reader.byte()));
        header.states.push(state);
    }
}

void parse_packets(ByteReader& reader, Header& header, const Limits& limits) {
    uint64_t count = reader.number();
    expect_at_most(count, limits.packets, "packets");
    if (count == 0) reader.fail_here("the packet table is empty");
    Place place;
    for (uint64_t i = 0; i < count; i++) {
        uint64_t row = reader.number();
        auto kind = static_cast<uint32_t>(row % 8);
        auto step = static_cast<uint32_t>(row / 8 % 4);
        uint64_t completes = row / 32;
        if (kind >= PACKET_KINDS || completes > same_size) reader.fail_here("the row of a packet begins as none does");
        if (step == elsewhere) {
            place.level = reader.number();
            place.slice = reader.number();
        } else {
            place = stepped(place, step);
        }
        if (place.level > MOST_LEVEL || place.slice > MOST_SLICE) reader.fail_here("a packet of no level or slice");
        PacketEntry entry{};
        entry.kind = static_cast<uint8_t>(kind);
        entry.level = static_cast<uint8_t>(place.level);
        entry.slice = static_cast<uint16_t>(place.slice);
        entry.length = reader.number();
        expect_at_most(entry.length, limits.packet_bytes, "packet_bytes");
        entry.checksum = static_cast<uint32_t>(reader.fixed(4));
        header.packets.push(entry);
        parse_states(reader, static_cast<uint32_t>(completes), place.level, header, limits);
    }
    if (header.states.empty() || header.states.back().level != 0)
        reader.fail_here("the table of states does not end with level 0");
}

// Sizes of levels against the bytes that code them: Diffs may be missing, so they do not count.
void check_shares(const Header& header, size_t header_bytes, const Limits& limits) {
    uint64_t known[MOST_LEVEL + 1] = {}; // bytes of the packets of that level
    for (const PacketEntry& packet : header.packets) {
        auto kind = static_cast<PacketKind>(packet.kind);
        if (kind == PacketKind::base || kind == PacketKind::map_conn || kind == PacketKind::preview)
            known[packet.level] += packet.length;
    }
    uint64_t bytes = header_bytes;
    for (size_t level = MOST_LEVEL + 1; level-- > 0;) known[level] = bytes += known[level];
    for (const StateEntry& state : header.states) {
        check_share(state.vertices, state.faces, known[state.level], limits);
    }
}

enum CompactFlags : uint32_t { flag_high = 1, flag_mirror = 2, flag_slices = 4 };

void parse_compact(ByteReader& reader, Header& header) {
    CompactOptions& options = header.compact;
    uint32_t bases = 0, least_diff = MOST_BITS + 1;
    for (const PacketEntry& packet : header.packets) {
        int depth = header.bits - packet.level;
        switch (static_cast<PacketKind>(packet.kind)) {
        case PacketKind::base:
            bases++;
            if (depth < 0) reader.fail_here("a Base packet of a level above B");
            options.base_depth = depth;
            break;
        case PacketKind::diff:
            if (depth < 0) reader.fail_here("a Diff packet of a level above B");
            options.diff_depths |= 1u << depth;
            least_diff = static_cast<uint32_t>(depth) < least_diff ? static_cast<uint32_t>(depth) : least_diff;
            break;
        case PacketKind::preview:
            options.previews++;
            break;
        case PacketKind::map_conn:
            if (header.state_of(packet.level) == nullptr) reader.fail_here("the table of states lacks a level");
            break;
        case PacketKind::param:
            reader.fail_here("a compact stream has no Param packets");
        case PacketKind::order:
            break;
        }
    }
    if (bases != 1) reader.fail_here("not one Base packet");
    if (least_diff < static_cast<uint32_t>(options.base_depth)) reader.fail_here("a Diff before the base depth");
    if (options.previews > MOST_PREVIEWS) reader.fail_here("more than 8 previews");

    uint64_t flags = reader.number();
    if (flags > 7) reader.fail_here("options of a compact stream that there are not");
    options.effort = (flags & flag_high) != 0;
    if (!DECODES_ALL && options.effort != 0) fail(Fault::unsupported, "effort high");
    if ((flags & flag_mirror) != 0) {
        uint8_t axis = reader.byte();
        uint64_t sum = reader.number();
        if (axis > 2 || sum >= static_cast<uint64_t>(2) << header.bits)
            reader.fail_here("a mirror plane outside of the grid");
        options.mirror_axis = axis;
        options.mirror_sum = static_cast<int32_t>(sum);
    }
    options.slices.push(0);
    if ((flags & flag_slices) != 0) {
        uint64_t more = reader.number();
        // Besides the first one, each begins at a vertex.
        if (more == 0 || more >= MOST_SLICES || more > header.vertices())
            reader.fail_here("more slices than there can be");
        for (uint64_t i = 0; i < more; i++) {
            uint64_t step = reader.number(), end = static_cast<uint64_t>(1) << (3 * header.bits);
            if (step == 0 || step >= end - options.slices.back())
                reader.fail_here("slices that do not ascend in the cube");
            options.slices.push(options.slices.back() + step);
        }
    }
    Span<const uint8_t> packed = reader.rest();
    auto depths = static_cast<size_t>(header.bits - options.base_depth + 1);
    if (packed.size() > (depths + 1) / 2) reader.fail_here("more strengths of the display filter than depths");
    for (size_t i = 0; i < depths; i++)
        if (i / 2 < packed.size()) options.strengths[i] = i % 2 == 0 ? packed[i / 2] >> 4 : packed[i / 2] & 15;
}

constexpr uint8_t MOST_DEGREE = 15, MOST_DENOMINATOR_DEGREE = 4;

void parse_classic(ByteReader& reader, Header& header) {
    ClassicOptions& options = header.classic;
    options.levels = reader.byte();
    if (options.levels < 1 || options.levels > static_cast<uint32_t>(header.bits) + 1)
        reader.fail_here("not as many levels as B allows");
    for (uint32_t l = 1; l < options.levels; l++) {
        options.shifts[l] = reader.byte();
        if (options.shifts[l] <= options.shifts[l - 1] || options.shifts[l] > header.bits)
            reader.fail_here("dropped bits that do not ascend up to B");
    }
    uint64_t diffs = reader.number();
    if (diffs >> (options.levels - 1) != 0) reader.fail_here("a Diff of a level that is not predicted");
    options.diffs = static_cast<uint32_t>(diffs);
    uint8_t kind = reader.byte();
    if (kind > static_cast<uint8_t>(FilterKind::rational)) reader.fail_here("a filter of no known kind");
    options.filter = static_cast<FilterKind>(kind);
    if (options.filter == FilterKind::taubin) {
        options.degree = 2;
        options.taubin_lambda = reader.coordinate();
        options.taubin_mu = reader.coordinate();
        for (double factor : {options.taubin_lambda, options.taubin_mu})
            if (!(factor >= 0 && factor <= 2)) reader.fail_here("a factor of Taubin's filter outside of 0..2");
    } else if (options.filter == FilterKind::gaussian) {
        options.degree = 1;
    } else if (options.filter != FilterKind::zeroth) {
        options.degree = reader.byte();
        options.chebyshev = reader.byte();
        options.norm = reader.coordinate();
        bool infinite = options.norm == 0; // how l-infinity is written
        if (options.degree > MOST_DEGREE || options.chebyshev > 1 ||
            !(infinite || (options.norm >= 1 && options.norm <= 2)))
            reader.fail_here("a filter of another degree, basis or norm than there are");
        if (options.filter == FilterKind::rational) {
            options.denominator_degree = reader.byte();
            if (options.denominator_degree < 1 || options.denominator_degree > MOST_DENOMINATOR_DEGREE)
                reader.fail_here("a denominator of another degree than 1..4");
        }
    }
    if (!reader.at_end()) reader.fail_here("bytes follow the options");
    if (header.states.size() != options.levels) reader.fail_here("not one state for each level");
    for (uint32_t i = 0; i < options.levels; i++) {
        if (header.states[i].level != options.levels - 1 - i) reader.fail_here("levels out of order");
        if (i > 0 && header.states[i].vertices < header.states[i - 1].vertices)
            reader.fail_here("a level with fewer vertices than the coarser one");
    }
}

bool is_finite(double value) { return value - value == 0; }

} // namespace

const StateEntry* Header::state_of(uint32_t level) const {
    for (size_t i = states.size(); i-- > 0;)
        if (states[i].level == level) return &states[i];
    return nullptr;
}

void parse_header(Span<const uint8_t> bytes, const Limits& limits, Header& header) {
    expect_at_most(bytes.size(), limits.header_bytes, "header_bytes");
    ByteReader reader(bytes);
    if (reader.byte() != FORMAT_VERSION)
        fail(Failure{Fault::version, "a header of another format", 0, bytes[0], FORMAT_VERSION});
    uint8_t profile = reader.byte();
    if (profile > static_cast<uint8_t>(Profile::compact))
        reader.fail_here("an unknown profile; a newer meshtide may read it");
    header.profile = static_cast<Profile>(profile);
    if (!DECODES_ALL && header.profile != Profile::compact) fail(Fault::unsupported, "profile classic");
    header.bits = reader.byte();
    if (header.bits < LEAST_BITS || header.bits > MOST_BITS) reader.fail_here("B is not 4..20");
    for (double& coordinate : header.origin) coordinate = reader.coordinate();
    header.extent = reader.coordinate();
    if (!(header.extent >= 0)) reader.fail_here("the grid's extent is less than nothing");
    bool distinct = false;
    for (double coordinate : header.origin) {
        double size = coordinate < 0 ? -coordinate : coordinate;
        if (!is_finite(size + 1.125 * header.extent)) reader.fail_here("the grid reaches beyond the largest number");
        distinct = distinct || coordinate + header.extent != coordinate;
    }
    parse_packets(reader, header, limits);
    check_shares(header, bytes.size(), limits);
    if (!distinct && header.vertices() > 1) reader.fail_here("a grid of one point for several vertices");
    if (!DECODES_ALL || header.profile == Profile::compact)
        parse_compact(reader, header);
    else
        parse_classic(reader, header);
}

void write_header(const Header& header, Array<uint8_t>& out) {
    out.clear();
    out.push(FORMAT_VERSION);
    out.push(static_cast<uint8_t>(header.profile));
    out.push(static_cast<uint8_t>(header.bits));
    for (double coordinate : header.origin) write_coordinate(out, coordinate);
    write_coordinate(out, header.extent);
    write_number(out, header.packets.size());
    Place before;
    uint64_t vertices = 0, faces = 0;
    size_t next = 0;
    for (size_t i = 0; i < header.packets.size(); i++) {
        const PacketEntry& packet = header.packets[i];
        size_t end = next;
        while (end < header.states.size() && header.states[end].packet_count == i + 1) end++;
        bool own = end - next == 1 && header.states[next].level == packet.level;
        uint32_t completes = own ? own_state : end > next ? more_states : nothing;
        if (own && header.states[next].vertices == vertices && header.states[next].faces == faces)
            completes = same_size;
        Place place{packet.level, packet.slice};
        uint32_t step = step_to(before, place);
        write_number(out, packet.kind + 8 * step + 32 * completes);
        if (step == elsewhere) {
            write_number(out, place.level);
            write_number(out, place.slice);
        }
        before = place;
        write_number(out, packet.length);
        write_fixed(out, 4, packet.checksum);
        if (completes == more_states) write_number(out, end - next);
        for (; next < end; next++) {
            const StateEntry& state = header.states[next];
            if (!own) write_number(out, state.level);
            if (completes != same_size) {
                write_signed(out, static_cast<int64_t>(state.vertices) - static_cast<int64_t>(vertices));
                write_signed(out, surplus_of(state.vertices, state.faces) - surplus_of(vertices, faces));
            }
            uint16_t distances = pack_distances(state.distances);
            out.push(static_cast<uint8_t>(distances >> 8));
            out.push(static_cast<uint8_t>(distances));
            vertices = state.vertices;
            faces = state.faces;
        }
    }
    if (header.profile == Profile::compact) {
        const CompactOptions& options = header.compact;
        uint32_t flags = 0;
        if (options.effort != 0) flags |= flag_high;
        if (options.mirror_axis >= 0) flags |= flag_mirror;
        if (options.slices.size() > 1) flags |= flag_slices;
        write_number(out, flags);
        if (options.mirror_axis >= 0) {
            out.push(static_cast<uint8_t>(options.mirror_axis));
            write_number(out, static_cast<uint64_t>(options.mirror_sum));
        }
        if (options.slices.size() > 1) {
            write_number(out, options.slices.size() - 1);
            for (size_t i = 1; i < options.slices.size(); i++)
                write_number(out, options.slices[i] - options.slices[i - 1]);
        }
        auto depths = static_cast<size_t>(header.bits - options.base_depth + 1);
        while (depths > 0 && options.strengths[depths - 1] == 0) depths--;
        for (size_t i = 0; i < depths; i += 2) {
            uint8_t lower = i + 1 < depths ? options.strengths[i + 1] : 0;
            out.push(static_cast<uint8_t>(options.strengths[i] << 4 | lower));
        }
        return;
    }
    const ClassicOptions& options = header.classic;
    out.push(static_cast<uint8_t>(options.levels));
    for (uint32_t l = 1; l < options.levels; l++) out.push(options.shifts[l]);
    write_number(out, options.diffs);
    out.push(static_cast<uint8_t>(options.filter));
    if (options.filter == FilterKind::taubin) {
        write_coordinate(out, options.taubin_lambda);
        write_coordinate(out, options.taubin_mu);
    } else if (options.filter == FilterKind::polynomial || options.filter == FilterKind::rational) {
        out.push(options.degree);
        out.push(options.chebyshev);
        write_coordinate(out, options.norm);
        if (options.filter == FilterKind::rational) out.push(options.denominator_degree);
    }
}

} // namespace meshtide
