// The C interface: handles, checks of arguments, and failures as errors.
#include "base/processor.hpp"
#include "codec/compact_decoder.hpp"
#include "meshtide.h"
#include "self_check.hpp"

#include <cstddef>
#include <new>

#ifndef MESHTIDE_SOURCES
#define MESHTIDE_SOURCES ""
#endif

using namespace meshtide;

static_assert(sizeof(mt_packet) == sizeof(PacketEntry) && offsetof(mt_packet, kind) == offsetof(PacketEntry, kind));
static_assert(sizeof(mt_state) == sizeof(StateEntry) && offsetof(mt_state, level) == offsetof(StateEntry, level));
static_assert(sizeof(mt_limits) == sizeof(Limits) && offsetof(mt_limits, memory) == offsetof(Limits, memory));

struct mt_stream {
    mt_stream() : budget(UINT64_MAX), header(budget), bytes(budget) {}
    Budget budget;
    Header header;
    Array<uint8_t> bytes; // as it was written
    mt_header fields{};
};

struct mt_decoder {
    mt_decoder(const Header& header, const Limits& limits)
        : budget(limits.memory), decoder(header, limits, budget), shown(budget) {}
    Budget budget;
    CompactDecoder decoder;
    Shown shown;
};

struct mt_encoder {
    mt_encoder() : budget(UINT64_MAX), positions(budget), faces(budget), payload(budget), coded(budget) {}
    Budget budget;
    Array<int32_t> positions, faces;
    Array<uint8_t> payload, coded;
    std::unique_ptr<Octree> octree;
    std::unique_ptr<EncoderLayers> layers;
};

namespace {

#ifndef __wasm__ // where a failure ends the instance, and its host reads mt_last_failure
void tell(mt_error* error, const Failure& failure, const PacketPlace* place) {
    if (error == nullptr) return;
    *error = {static_cast<int32_t>(failure.fault),
              -1,
              -1,
              -1,
              failure.offset,
              failure.claimed,
              failure.allowed,
              failure.text};
    if (place == nullptr) return;
    error->kind = static_cast<int32_t>(place->kind);
    error->level = static_cast<int32_t>(place->level);
    error->slice = static_cast<int32_t>(place->slice);
}
#endif

// Runs something that may fail. In WebAssembly a failure traps instead, see base/failure.cpp.
template <class Work>
int32_t guarded(mt_error* error, Work work, const PacketPlace* place = nullptr) {
#ifdef __wasm__
    (void)error, (void)place;
    work();
    return MT_OK;
#else
    try {
        work();
        return MT_OK;
    } catch (const Failure& failure) {
        tell(error, failure, place);
        return static_cast<int32_t>(failure.fault);
    } catch (const std::bad_alloc&) {
        tell(error, {Fault::memory, "the system has no memory left"}, place);
        return MT_MEMORY;
    }
#endif
}

void require(bool condition, const char* text) {
    if (!condition) fail(Fault::argument, text);
}

template <class T>
Span<const T> lent(const T* data, uint64_t count) {
    return {data, checked_size(count)};
}

void fill_fields(mt_stream& stream) {
    const Header& header = stream.header;
    mt_header& fields = stream.fields;
    fields = {};
    fields.profile = static_cast<int32_t>(header.profile);
    fields.bits = header.bits;
    for (size_t k = 0; k < 3; k++) fields.origin[k] = header.origin[k];
    fields.extent = header.extent;
    fields.packets = reinterpret_cast<const mt_packet*>(header.packets.begin());
    fields.packet_count = header.packets.size();
    fields.states = reinterpret_cast<const mt_state*>(header.states.begin());
    fields.state_count = header.states.size();
    const CompactOptions& compact = header.compact;
    fields.effort = compact.effort;
    fields.mirror_axis = compact.mirror_axis;
    fields.mirror_sum = compact.mirror_sum;
    fields.base_depth = compact.base_depth;
    fields.diff_depths = compact.diff_depths;
    fields.previews = compact.previews;
    std::memcpy(fields.strengths, compact.strengths, sizeof compact.strengths);
    fields.slices = compact.slices.begin();
    fields.slice_count = compact.slices.size();
    const ClassicOptions& classic = header.classic;
    fields.levels = classic.levels;
    fields.diffs = classic.diffs;
    std::memcpy(fields.shifts, classic.shifts, sizeof classic.shifts);
    fields.filter = static_cast<int32_t>(classic.filter);
    fields.degree = classic.degree;
    fields.denominator_degree = classic.denominator_degree;
    fields.chebyshev = classic.chebyshev;
    fields.norm = classic.norm;
    fields.taubin_lambda = classic.taubin_lambda;
    fields.taubin_mu = classic.taubin_mu;
}

void take_fields(const mt_header& fields, Header& header) {
    require(fields.profile == MT_CLASSIC || fields.profile == MT_COMPACT, "an unknown profile");
    require(fields.bits >= LEAST_BITS && fields.bits <= MOST_BITS, "B is not 4..20");
    require(fields.base_depth >= 0 && fields.base_depth <= fields.bits, "the base depth is not 0..B");
    header.profile = static_cast<Profile>(fields.profile);
    header.bits = fields.bits;
    for (size_t k = 0; k < 3; k++) header.origin[k] = fields.origin[k];
    header.extent = fields.extent;
    header.packets.copy(lent(reinterpret_cast<const PacketEntry*>(fields.packets), fields.packet_count));
    header.states.copy(lent(reinterpret_cast<const StateEntry*>(fields.states), fields.state_count));
    CompactOptions& compact = header.compact;
    compact.effort = fields.effort;
    compact.mirror_axis = fields.mirror_axis;
    compact.mirror_sum = fields.mirror_sum;
    compact.base_depth = fields.base_depth;
    std::memcpy(compact.strengths, fields.strengths, sizeof compact.strengths);
    compact.slices.copy(lent(fields.slices, fields.slice_count));
    ClassicOptions& classic = header.classic;
    require(fields.levels <= sizeof classic.shifts, "more levels than B allows");
    classic.levels = fields.levels;
    classic.diffs = fields.diffs;
    std::memcpy(classic.shifts, fields.shifts, sizeof classic.shifts);
    require(fields.filter >= 0 && fields.filter <= 4, "a filter of no known kind");
    classic.filter = static_cast<FilterKind>(fields.filter);
    classic.degree = static_cast<uint8_t>(fields.degree);
    classic.denominator_degree = static_cast<uint8_t>(fields.denominator_degree);
    classic.chebyshev = static_cast<uint8_t>(fields.chebyshev);
    classic.norm = fields.norm;
    classic.taubin_lambda = fields.taubin_lambda;
    classic.taubin_mu = fields.taubin_mu;
}

uint64_t morton_code(Span<const int32_t> positions, size_t vertex, int bits) {
    uint64_t code = 0;
    for (int i = bits - 1; i >= 0; i--)
        for (size_t k = 0; k < 3; k++) code = code << 1 | (static_cast<uint32_t>(positions[3 * vertex + k]) >> i & 1);
    return code;
}

// What an octree takes for granted.
void check_mesh(Span<const int32_t> positions, Span<const int32_t> faces, int bits) {
    size_t vertices = positions.size() / 3;
    require(vertices > 0 && vertices < 1u << 28 && faces.size() / 3 < 1u << 28, "no vertices, or too many");
    for (int32_t coordinate : positions)
        require(coordinate >= 0 && coordinate >> bits == 0, "a position outside of the grid");
    for (size_t v = 1; v < vertices; v++)
        require(morton_code(positions, v - 1, bits) < morton_code(positions, v, bits), "positions out of Morton order");
    for (int32_t corner : faces)
        require(corner >= 0 && static_cast<size_t>(corner) < vertices, "a corner that is no vertex");
    for (size_t t = 0; t < faces.size(); t += 3)
        require(faces[t] != faces[t + 1] && faces[t + 1] != faces[t + 2] && faces[t + 2] != faces[t],
                "a face with two equal corners");
}

} // namespace

const char* mt_kind(void) { return KIND; }

const char* mt_best_kind(void) { return best_kind(); }

const char* mt_sources(void) { return MESHTIDE_SOURCES; }

uint64_t mt_self_check(void) {
    uint64_t digest = 0;
    return guarded(nullptr, [&] { digest = self_check(); }) == MT_OK ? digest : 0;
}

int32_t mt_stream_parse(const uint8_t* bytes, uint64_t size, const mt_limits* limits, mt_stream** stream,
                        mt_error* error) {
    std::unique_ptr<mt_stream> made;
    int32_t fault = guarded(error, [&] {
        made = std::make_unique<mt_stream>();
        parse_header(lent(bytes, size), *reinterpret_cast<const Limits*>(limits), made->header);
        fill_fields(*made);
    });
    *stream = fault == MT_OK ? made.release() : nullptr;
    return fault;
}

void mt_stream_free(mt_stream* stream) { delete stream; }

const mt_header* mt_stream_header(const mt_stream* stream) { return &stream->fields; }

int32_t mt_stream_write(const mt_header* header, mt_stream** stream, mt_bytes* bytes, mt_error* error) {
    std::unique_ptr<mt_stream> made;
    int32_t fault = guarded(error, [&] {
        made = std::make_unique<mt_stream>();
        take_fields(*header, made->header);
        write_header(made->header, made->bytes);
        fill_fields(*made);
        *bytes = {made->bytes.begin(), made->bytes.size()};
    });
    *stream = fault == MT_OK ? made.release() : nullptr;
    return fault;
}

int32_t mt_decoder_new(const mt_stream* stream, const mt_limits* limits, mt_decoder** decoder, mt_error* error) {
    *decoder = nullptr;
    return guarded(error, [&] {
        require(stream->header.profile == Profile::compact, "a stream of another profile");
        *decoder = std::make_unique<mt_decoder>(stream->header, *reinterpret_cast<const Limits*>(limits)).release();
    });
}

void mt_decoder_free(mt_decoder* decoder) { delete decoder; }

int32_t mt_decoder_push(mt_decoder* decoder, int32_t kind, int32_t level, int32_t slice, const uint8_t* payload,
                        uint64_t size, mt_error* error) {
    return guarded(
        error,
        [&] {
            require(kind >= 0 && kind < static_cast<int32_t>(PACKET_KINDS) && level >= 0 && slice >= 0,
                    "a packet of no kind, level or slice");
            decoder->decoder.push(
                {static_cast<PacketKind>(kind), static_cast<uint32_t>(level), static_cast<uint32_t>(slice)},
                lent(payload, size));
        },
        &decoder->decoder.place());
}

uint64_t mt_decoder_available(const mt_decoder* decoder) { return decoder->decoder.available(); }

uint64_t mt_decoder_exact(const mt_decoder* decoder) { return decoder->decoder.exact(); }

int32_t mt_decoder_show(mt_decoder* decoder, int32_t level, mt_shown* shown, mt_error* error) {
    return guarded(error, [&] {
        require(level >= 0, "the level is not available yet");
        decoder->decoder.show(static_cast<uint32_t>(level), decoder->shown);
        const Shown& made = decoder->shown;
        *shown = {made.positions.begin(), made.positions.size() / 3, made.faces.begin(), made.faces.size() / 3};
    });
}

int32_t mt_encoder_new(const int32_t* positions, uint64_t vertex_count, const int32_t* faces, uint64_t face_count,
                       const mt_encoder_options* options, mt_encoder** encoder, mt_error* error) {
    std::unique_ptr<mt_encoder> made;
    int32_t fault = guarded(error, [&] {
        require(options->bits >= LEAST_BITS && options->bits <= MOST_BITS, "B is not 4..20");
        check_mesh(lent(positions, 3 * vertex_count), lent(faces, 3 * face_count), options->bits);
        made = std::make_unique<mt_encoder>();
        made->positions.copy(lent(positions, 3 * vertex_count));
        made->faces.copy(lent(faces, 3 * face_count));
        made->octree =
            std::make_unique<Octree>(made->positions.span(), made->faces.span(), options->bits, made->budget);
        require(made->octree->depths.back().faces.size() == 3 * face_count, "a face that is there twice");
        Effort effort = options->effort == 0 ? Effort::standard : Effort::high;
        made->layers =
            make_encoder_layers(effort, made->budget, *made->octree, {options->mirror_axis, options->mirror_sum},
                                lent(options->slices, options->slice_count));
    });
    *encoder = fault == MT_OK ? made.release() : nullptr;
    return fault;
}

void mt_encoder_free(mt_encoder* encoder) { delete encoder; }

int32_t mt_encoder_sizes(const mt_encoder* encoder, uint64_t* cells, uint64_t* faces) {
    const auto& depths = encoder->octree->depths;
    for (size_t b = 0; b < depths.size(); b++) {
        cells[b] = depths[b].cell_count();
        faces[b] = depths[b].faces.size() / 3;
    }
    return MT_OK;
}

int32_t mt_encoder_base(mt_encoder* encoder, int32_t depth, mt_bytes* payload, mt_error* error) {
    return guarded(error, [&] {
        require(depth >= 0 && depth <= encoder->octree->bits, "the base depth is not 0..B");
        encoder->layers->encode_base(depth, encoder->payload);
        *payload = {encoder->payload.begin(), encoder->payload.size()};
    });
}

int32_t mt_encoder_next_level(mt_encoder* encoder, mt_bytes* payload, mt_error* error) {
    return guarded(error, [&] {
        require(!encoder->layers->chain().ends(), "all cells are leaves");
        encoder->layers->encode_next_level(encoder->payload);
        *payload = {encoder->payload.begin(), encoder->payload.size()};
    });
}

int32_t mt_encoder_planes(mt_encoder* encoder, int32_t slice, int32_t depth, mt_bytes* payload, mt_error* error) {
    return guarded(error, [&] {
        require(slice >= 0 && depth >= 0 && depth <= encoder->layers->chain().known_depth(),
                "a level that is not coded");
        encoder->layers->encode_planes(static_cast<size_t>(slice), depth, encoder->payload);
        *payload = {encoder->payload.begin(), encoder->payload.size()};
    });
}

int32_t mt_encoder_preview(mt_encoder* encoder, mt_bytes* payload, mt_error* error) {
    return guarded(error, [&] {
        encoder->layers->encode_preview(encoder->coded);
        int bits = encoder->octree->bits, leaf_depth = 0;
        while (encoder->octree->depths[static_cast<size_t>(leaf_depth)].cell_count() < encoder->positions.size() / 3)
            leaf_depth++;
        encoder->payload.clear();
        write_number(encoder->payload, static_cast<uint64_t>(bits * (bits + 1) / 2 + leaf_depth));
        for (uint8_t byte : encoder->coded) encoder->payload.push(byte);
        *payload = {encoder->payload.begin(), encoder->payload.size()};
    });
}
