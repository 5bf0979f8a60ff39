// The C interface: handles, checks of arguments, and failures as errors.
#include "interface.hpp"

#include "base/processor.hpp"
#include "codec/compact_decoder.hpp"
#include "codec/preview_payload.hpp"
#include "self_check.hpp"

#include <cstddef>

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
    mt_decoder(const Header& header, const Limits& limits, const Trained& trained)
        : budget(limits.memory), decoder(make_stream_decoder(header, trained, budget)), shown(budget) {}
    Budget budget;
    std::unique_ptr<StreamDecoder> decoder;
    Shown shown;
};

struct mt_encoder {
    mt_encoder() : budget(UINT64_MAX), positions(budget), payload(budget) {}
    Budget budget;
    Array<int32_t> positions;
    Array<uint8_t> payload;
    size_t slice_count = 0;
    std::unique_ptr<Octree> octree;
    std::unique_ptr<EncoderLayers> layers;

    EncoderLayers& coding() const {
        if (!layers) fail(Fault::argument, "coding was finished");
        return *layers;
    }
};

namespace {

void fill_classic(const ClassicOptions& classic, mt_header& fields) {
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

void fill_fields(mt_stream& stream) {
    const Header& header = stream.header;
    mt_header& fields = stream.fields;
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
    if (DECODES_ALL) fill_classic(header.classic, fields);
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
    for (uint8_t strength : compact.strengths) require(strength < STRENGTH_COUNT, "no such strength");
    compact.slices.copy(lent(fields.slices, fields.slice_count));
    for (size_t i = 1; i < compact.slices.size(); i++)
        require(compact.slices[i - 1] < compact.slices[i], "slices that do not ascend");
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

} // namespace

namespace meshtide {

void fill_error(mt_error* error, const Failure& failure, const PacketPlace* place) {
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
    if (error->offset < 0) error->offset = place->offset;
}

} // namespace meshtide

const char* mt_kind(void) { return KIND; }

const char* mt_best_kind(void) { return best_kind(); }

const char* mt_sources(void) { return MESHTIDE_SOURCES; }

uint64_t mt_self_check(void) {
    uint64_t digest = 0;
    return guarded(nullptr, [&] { digest = self_check(); }) == MT_OK ? digest : 0;
}

void mt_stored_distances(double* rms, double* maximum) {
    Distances stored = unpack_distances(pack_distances({*rms, *maximum}));
    *rms = stored.rms;
    *maximum = stored.maximum;
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

mt_states* mt_states_new(void) { return new (std::nothrow) mt_states; }

void mt_states_free(mt_states* states) { delete states; }

int32_t mt_states_load(mt_states* states, int32_t effort, const uint8_t* bytes, uint64_t size, mt_error* error) {
    return guarded(error, [&] {
        require(effort >= 0 && effort <= (DECODES_ALL ? 2 : 0), "there are no such states");
        choose(effort == 1 ? Effort::high : Effort::standard);
        RangeDecoder coder(lent(bytes, size));
        auto load = [&](auto& loaded) {
            auto made = std::make_unique<std::decay_t<decltype(*loaded)>>(states->budget);
            made->code_states(coder, states->budget);
            coder.finish();
            loaded = std::move(made);
        };
        if constexpr (DECODES_ALL) {
            if (effort == 1) return load(states->trained.high);
            if (effort == 2) return load(states->trained.classic);
        }
        load(states->trained.standard);
    });
}

int32_t mt_decoder_new(const mt_stream* stream, const mt_limits* limits, const mt_states* states, mt_decoder** decoder,
                       mt_error* error) {
    *decoder = nullptr;
    return guarded(error, [&] {
        *decoder =
            std::make_unique<mt_decoder>(stream->header, *reinterpret_cast<const Limits*>(limits), states->trained)
                .release();
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
            decoder->decoder->push(
                {static_cast<PacketKind>(kind), static_cast<uint32_t>(level), static_cast<uint32_t>(slice)},
                lent(payload, size));
        },
        &decoder->decoder->place());
}

uint64_t mt_decoder_available(const mt_decoder* decoder) { return decoder->decoder->available(); }

uint64_t mt_decoder_exact(const mt_decoder* decoder) { return decoder->decoder->exact(); }

uint64_t mt_decoder_changed(const mt_decoder* decoder) { return decoder->decoder->changed(); }

uint64_t mt_decoder_map_bytes(const mt_decoder* decoder) { return decoder->decoder->map_bytes(); }

int32_t mt_decoder_show(mt_decoder* decoder, int32_t level, mt_shown* shown, mt_error* error) {
    PacketPlace place = decoder->decoder->faces_of(static_cast<uint32_t>(level));
    return guarded(
        error,
        [&] {
            require(level >= 0, "the level is not available yet");
            decoder->decoder->show(static_cast<uint32_t>(level), decoder->shown);
            const Shown& made = decoder->shown;
            *shown = {made.positions.begin(), made.positions.size() / 3, made.faces.begin(), made.faces.size() / 3};
        },
        &place);
}

void mt_decoder_keep_finest_only(mt_decoder* decoder) { decoder->decoder->keep_finest_only(); }

void mt_decoder_watch_diffs(mt_decoder* decoder) { decoder->decoder->watch_diffs(); }

uint64_t mt_decoder_diff_count(const mt_decoder* decoder) { return decoder->decoder->decoded_diffs().size(); }

int32_t mt_decoder_diffs(const mt_decoder* decoder, uint64_t number, mt_diffs* diffs, mt_error* error) {
    return guarded(error, [&] {
        const auto& decoded = decoder->decoder->decoded_diffs();
        require(number < decoded.size(), "fewer Diffs were decoded");
        const DecodedDiffs& each = decoded[static_cast<size_t>(number)];
        *diffs = {each.values.begin(), each.values.size() / 3, static_cast<int32_t>(each.level),
                  static_cast<int32_t>(each.slice)};
    });
}

int32_t mt_decoder_replace_diffs(mt_decoder* decoder, uint64_t number, const double* values, uint64_t count,
                                 mt_error* error) {
    return guarded(error, [&] { decoder->decoder->replace_diffs(checked_size(number), lent(values, 3 * count)); });
}

int32_t mt_encoder_new(const int32_t* positions, uint64_t vertex_count, const int32_t* faces, uint64_t face_count,
                       const mt_encoder_options* options, const mt_states* states, mt_encoder** encoder,
                       mt_error* error) {
    std::unique_ptr<mt_encoder> made;
    int32_t fault = guarded(error, [&] {
        require(options->bits >= LEAST_BITS && options->bits <= MOST_BITS, "B is not 4..20");
        if (vertex_count >= ROOMY) trim_heap(); // what the caller has given back
        made = std::make_unique<mt_encoder>();
        made->positions.copy(lent(positions, 3 * vertex_count));
        made->octree =
            std::make_unique<Octree>(made->positions.span(), lent(faces, 3 * face_count), options->bits, made->budget);
        require(made->octree->depths.back().faces.size() == 3 * face_count, "a face that is there twice");
        made->slice_count = checked_size(options->slice_count);
        Effort effort = options->effort == 0 ? Effort::standard : Effort::high;
        made->layers =
            make_encoder_layers(effort, made->budget, *made->octree, {options->mirror_axis, options->mirror_sum},
                                lent(options->slices, options->slice_count), states->trained);
    });
    *encoder = fault == MT_OK ? made.release() : nullptr;
    return fault;
}

void mt_encoder_free(mt_encoder* encoder) { delete encoder; }

int32_t mt_encoder_sizes(const mt_encoder* encoder, uint64_t* cells, uint64_t* faces) {
    for (int b = 0; b <= encoder->octree->bits; b++) {
        const Octree::Depth& depth = encoder->octree->at(b);
        cells[b] = depth.cell_count();
        faces[b] = depth.faces.size() / 3;
    }
    return MT_OK;
}

int32_t mt_encoder_base(mt_encoder* encoder, int32_t depth, mt_bytes* payload, mt_error* error) {
    return guarded(error, [&] {
        require(depth >= 0 && depth <= encoder->octree->bits, "the base depth is not 0..B");
        encoder->coding().encode_base(depth, encoder->payload);
        *payload = {encoder->payload.begin(), encoder->payload.size()};
    });
}

int32_t mt_encoder_next_level(mt_encoder* encoder, mt_bytes* payload, mt_error* error) {
    return guarded(error, [&] {
        require(!encoder->coding().chain().ends(), "all cells are leaves");
        encoder->coding().encode_next_level(encoder->payload);
        *payload = {encoder->payload.begin(), encoder->payload.size()};
    });
}

int32_t mt_encoder_add_planes(mt_encoder* encoder, int32_t slice, int32_t depth, uint64_t* size, mt_error* error) {
    return guarded(error, [&] {
        require(slice >= 0 && static_cast<size_t>(slice) < encoder->slice_count, "no such slice");
        require(depth >= 0 && depth <= encoder->coding().chain().known_depth(), "a level that is not coded");
        *size = encoder->coding().add_planes(static_cast<size_t>(slice), depth);
    });
}

int32_t mt_encoder_take_planes(mt_encoder* encoder, int32_t slice, mt_bytes* payload, mt_error* error) {
    return guarded(error, [&] {
        require(slice >= 0 && static_cast<size_t>(slice) < encoder->slice_count, "no such slice");
        encoder->coding().take_planes(static_cast<size_t>(slice), encoder->payload);
        *payload = {encoder->payload.begin(), encoder->payload.size()};
    });
}

void mt_encoder_finish(mt_encoder* encoder) {
    encoder->layers.reset();
    if (encoder->positions.size() >= 3 * ROOMY) trim_heap();
}

int32_t mt_encoder_strengths(mt_encoder* encoder, int32_t first, uint8_t* strengths, mt_error* error) {
    return guarded(error, [&] {
        require(first >= 0 && first <= encoder->octree->bits, "the base depth is not 0..B");
        Array<uint8_t> chosen(encoder->budget);
        choose_strengths(*encoder->octree, first, chosen, encoder->budget);
        std::memcpy(strengths, chosen.begin(), chosen.size());
    });
}

int32_t mt_encoder_show(mt_encoder* encoder, int32_t depth, int32_t known_depth, int32_t strength, double* positions,
                        int32_t* faces, mt_error* error) {
    return guarded(error, [&] {
        require(depth >= 0 && depth <= encoder->octree->bits, "a level of no depth");
        require(known_depth >= 0 && known_depth <= encoder->octree->bits, "Diffs of no depth");
        require(strength >= 0 && static_cast<size_t>(strength) < STRENGTH_COUNT, "no such strength");
        const Octree::Depth& cells = encoder->octree->at(depth);
        std::memcpy(faces, cells.faces.begin(), sizeof(int32_t) * cells.faces.size());
        show_truth(*encoder->octree, depth, known_depth, STRENGTHS[static_cast<size_t>(strength)],
                   {positions, 3 * cells.cell_count()}, encoder->budget);
    });
}
