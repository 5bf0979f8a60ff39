// What the core is asked to do under an instruction counter (tests/bench/work.py): one kind of work on one stream.
//
//     core_work STATES_FOLDER (decode | encode | surface) STREAM
//
// The mesh that is encoded, simplified and measured is the one that the stream holds. `core_work compiler` tells what
// compiled it.
#include "meshtide.h"

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

namespace {

typedef std::vector<uint8_t> Bytes;
constexpr size_t PREAMBLE = 18, HEADER_LENGTH = 10; // of a .tide file: bytes before the header, and where its length is

void check(bool holds, const char* what) {
    if (holds) return;
    std::fprintf(stderr, "%s\n", what);
    std::exit(1);
}

void must(int32_t fault, const mt_error& error) { check(fault == MT_OK, error.text); }

Bytes read(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    check(file.good(), path.c_str());
    return {std::istreambuf_iterator<char>(file), {}};
}

struct Mesh {
    std::vector<int32_t> positions, faces;
    uint64_t vertex_count() const { return positions.size() / 3; }
    uint64_t face_count() const { return faces.size() / 3; }
};

struct Stream {
    mt_stream* parsed = nullptr;
    const mt_header* header = nullptr;
    Bytes file;
    size_t packets = 0; // where they begin
};

Stream open_stream(const std::string& path) {
    Stream stream;
    mt_error error{};
    stream.file = read(path);
    uint32_t length = 0;
    check(stream.file.size() > PREAMBLE, "no stream");
    std::memcpy(&length, &stream.file[HEADER_LENGTH], sizeof length);
    stream.packets = PREAMBLE + length;
    check(stream.file.size() > stream.packets, "no packets");
    mt_limits limits;
    std::memset(&limits, 0x3f, sizeof limits); // none to speak of
    must(mt_stream_parse(&stream.file[PREAMBLE], length, &limits, &stream.parsed, &error), error);
    stream.header = mt_stream_header(stream.parsed);
    return stream;
}

Mesh decode(const Stream& stream, const mt_states* states) {
    mt_error error{};
    mt_limits limits;
    std::memset(&limits, 0x3f, sizeof limits);
    mt_decoder* decoder = nullptr;
    must(mt_decoder_new(stream.parsed, &limits, states, &decoder, &error), error);
    size_t at = stream.packets;
    for (uint64_t i = 0; i < stream.header->packet_count; i++) {
        const mt_packet& packet = stream.header->packets[i];
        must(mt_decoder_push(decoder, packet.kind, packet.level, packet.slice, &stream.file[at], packet.length, &error),
             error);
        at += packet.length;
    }
    mt_shown shown;
    must(mt_decoder_show(decoder, 0, &shown, &error), error);
    Mesh mesh;
    for (uint64_t i = 0; i < 3 * shown.vertex_count; i++)
        mesh.positions.push_back(static_cast<int32_t>(shown.positions[i]));
    mesh.faces.assign(shown.faces, shown.faces + 3 * shown.face_count);
    mt_decoder_free(decoder);
    return mesh;
}

void encode(const Mesh& mesh, const mt_header& header, const mt_states* states) {
    mt_error error{};
    mt_encoder_options options{header.bits,       header.effort, header.mirror_axis,
                               header.mirror_sum, header.slices, header.slice_count};
    mt_encoder* encoder = nullptr;
    must(mt_encoder_new(mesh.positions.data(), mesh.vertex_count(), mesh.faces.data(), mesh.face_count(), &options,
                        states, &encoder, &error),
         error);
    uint64_t cells[32], faces[32], size = 0;
    mt_encoder_sizes(encoder, cells, faces);
    uint8_t strengths[32];
    mt_bytes payload;
    must(mt_encoder_strengths(encoder, header.base_depth, strengths, &error), error);
    must(mt_encoder_base(encoder, header.base_depth, &payload, &error), error);
    for (int depth = header.base_depth; depth <= header.bits; depth++) {
        if (depth > header.base_depth && cells[depth - 1] < mesh.vertex_count())
            must(mt_encoder_next_level(encoder, &payload, &error), error);
        for (uint64_t slice = 0; slice < header.slice_count; slice++)
            must(mt_encoder_add_planes(encoder, static_cast<int32_t>(slice), depth, &size, &error), error);
    }
    mt_encoder_free(encoder);
}

// The choice of previews: closest points, simplification, fits; then the distances of those.
void measure(const Mesh& mesh, int32_t bits, const mt_states* states) {
    mt_error error{};
    mt_grid_mesh grid{mesh.positions.data(), mesh.vertex_count(), mesh.faces.data(), mesh.face_count(), bits};
    mt_previews* previews = nullptr;
    must(mt_previews_choose(&grid, states, &previews, &error), error);
    check(mt_previews_count(previews) > 0, "a mesh without previews");
    std::vector<double> vertices(mesh.positions.begin(), mesh.positions.end());
    mt_surface original{vertices.data(), mesh.vertex_count(), mesh.faces.data(), mesh.face_count()};
    mt_meter* meter = nullptr;
    must(mt_meter_new(&original, 4000, 8192, 0, &meter, &error), error);
    for (uint64_t i = 0; i < mt_previews_count(previews); i++) {
        const mt_grid_mesh& made = mt_previews_list(previews)[i].mesh;
        std::vector<double> points(made.positions, made.positions + 3 * made.vertex_count);
        mt_surface surface{points.data(), made.vertex_count, made.faces, made.face_count};
        double rms = 0, maximum = 0;
        must(mt_meter_measure(meter, &surface, &rms, &maximum, &error), error);
    }
    mt_meter_free(meter);
    mt_previews_free(previews);
}

} // namespace

int main(int count, char** arguments) {
    if (count == 2 && std::strcmp(arguments[1], "compiler") == 0) {
#ifdef __clang__
        std::printf("clang++ %d.%d\n", __clang_major__, __clang_minor__);
#else
        std::printf("g++ %d.%d\n", __GNUC__, __GNUC_MINOR__);
#endif
        return 0;
    }
    check(count == 4, "usage: core_work STATES_FOLDER (decode | encode | surface) STREAM");
    std::string folder = arguments[1], work = arguments[2];
    Stream stream = open_stream(arguments[3]);
    mt_states* states = mt_states_new();
    mt_error error{};
    for (int32_t effort = 0; effort <= stream.header->effort; effort++) {
        Bytes bytes = read(folder + (effort == 0 ? "/default.states" : "/high.states"));
        must(mt_states_load(states, effort, bytes.data(), bytes.size(), &error), error);
    }
    Mesh mesh = decode(stream, states);
    if (work == "encode") encode(mesh, *stream.header, states);
    if (work == "surface") measure(mesh, stream.header->bits, states);
    mt_states_free(states);
    mt_stream_free(stream.parsed);
    return 0;
}
