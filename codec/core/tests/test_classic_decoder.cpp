// classic/: whatever the mesh, the filter and the order of the packets, a classic stream gives the mesh back; damaged
// packets are refused or decode to something. Both profiles: others in the place of Diffs do what they should.
#include "codec/classic_decoder.hpp"
#include "classic/encoder.hpp"
#include "classic/geometry.hpp"
#include "streams.hpp"
#include "surface/filters.hpp"
#include "surface/triangles.hpp"

namespace meshtide::testing {

namespace {

constexpr uint64_t MEMORY = 1u << 28;
constexpr uint64_t STREAMS = 0xd3785bd1aa7f32df; // digest of all payloads and levels, the same on every machine

struct TestLevel {
    int shift = 0;
    std::vector<int32_t> cells, faces, parents; // parents in the coarser level
};

// Faces of the children as the parents see them, canonical.
std::vector<int32_t> coarse_faces(const std::vector<int32_t>& faces, const std::vector<int32_t>& parents) {
    Budget budget(MEMORY);
    Array<int32_t> above(budget);
    for (int32_t corner : faces) above.push(parents[static_cast<size_t>(corner)]);
    canonical_faces(above, static_cast<size_t>(parents.back()) + 1, budget);
    return {above.begin(), above.end()};
}

// Level 0 first; each drops some more bits than the one before.
std::vector<TestLevel> make_levels(const RandomMesh& mesh, Numbers& numbers) {
    std::vector<TestLevel> levels;
    TestLevel level;
    level.cells = mesh.positions;
    level.faces = mesh.faces;
    while (true) {
        int more = numbers.between(1, 4);
        bool last = level.shift + more > mesh.bits || numbers.below(8) == 0;
        TestLevel coarse;
        coarse.shift = level.shift + more;
        for (size_t v = 0; v < level.cells.size() && !last; v += 3) {
            const int32_t cell[3] = {level.cells[v] >> more, level.cells[v + 1] >> more, level.cells[v + 2] >> more};
            if (coarse.cells.empty() || !std::equal(cell, cell + 3, coarse.cells.end() - 3))
                coarse.cells.insert(coarse.cells.end(), cell, cell + 3);
            level.parents.push_back(static_cast<int32_t>(coarse.cells.size() / 3) - 1);
        }
        if (!last) coarse.faces = coarse_faces(level.faces, level.parents);
        levels.push_back(std::move(level));
        if (last) return levels;
        level = std::move(coarse);
    }
}

Filter random_filter(Numbers& numbers, ClassicOptions& options) {
    options.filter = static_cast<FilterKind>(numbers.below(5));
    bool fitted = options.filter == FilterKind::polynomial || options.filter == FilterKind::rational;
    if (fitted) {
        options.degree = static_cast<uint8_t>(numbers.below(6));
        options.chebyshev = static_cast<uint8_t>(numbers.below(2));
    }
    if (options.filter == FilterKind::rational)
        options.denominator_degree = static_cast<uint8_t>(numbers.between(1, 4));
    if (options.filter == FilterKind::taubin) options.taubin_lambda = 0.5, options.taubin_mu = 0.625;
    return filter_of(options);
}

// Coefficients that any filter can use: those of x first.
void random_coefficients(const Filter& filter, Numbers& numbers, Array<float>& coefficients) {
    for (size_t i = 0; i < 3 * filter.coefficient_count(); i++) {
        size_t place = i % filter.coefficient_count();
        auto part = static_cast<float>(numbers.between(-64, 64)) / 512;
        coefficients.push(place == 0 ? 1 + part : place > filter.degree ? std::abs(part) : part);
    }
}

struct ClassicTruth {
    std::vector<TestLevel> levels;
    std::vector<std::vector<double>> differences; // of each level that sends them
};

// Of any filter, levels and Diffs; that of level 0 is there.
ClassicTruth encode_classic(const RandomMesh& mesh, Numbers& numbers, RandomStream& stream, Budget& budget) {
    ClassicTruth truth{make_levels(mesh, numbers), {}};
    const auto& levels = truth.levels;
    truth.differences.resize(levels.size());
    Header& header = stream.header;
    header.profile = Profile::classic;
    header.bits = mesh.bits;
    ClassicOptions& options = header.classic;
    Filter filter = random_filter(numbers, options);
    options.levels = static_cast<uint32_t>(levels.size());
    for (size_t l = 0; l < levels.size(); l++) options.shifts[l] = static_cast<uint8_t>(levels[l].shift);
    ClassicEncoder encoder(budget, *untrained().classic);
    Array<uint8_t> payload(budget);
    Array<Vector> geometry(budget), extension(budget);
    for (size_t l = levels.size(); l-- > 0;) {
        const TestLevel& level = levels[l];
        auto number = static_cast<uint32_t>(l);
        size_t n = level.cells.size() / 3;
        ClassicGrid grid{mesh.bits, level.shift};
        Span<const int32_t> faces{level.faces.data(), level.faces.size()};
        if (l + 1 == levels.size()) {
            encoder.encode_base({level.cells.data(), level.cells.size()}, grid.bits - grid.shift, faces, payload);
            add_packet(stream, {PacketKind::base, number, 0}, payload);
            geometry.clear();
            for (size_t v = 0; v < 3 * n; v += 3)
                geometry.push(
                    {grid.middle(level.cells[v]), grid.middle(level.cells[v + 1]), grid.middle(level.cells[v + 2])});
        } else {
            encoder.encode_map_conn({level.parents.data(), n}, faces, payload);
            add_packet(stream, {PacketKind::map_conn, number, 0}, payload);
            Array<float> coefficients(budget);
            random_coefficients(filter, numbers, coefficients);
            if (!coefficients.empty()) {
                payload.clear();
                for (float c : coefficients)
                    for (int i = 0; i < 4; i++)
                        payload.push(static_cast<uint8_t>(std::bit_cast<uint32_t>(c) >> (8 * i)));
                add_packet(stream, {PacketKind::param, number, 0}, payload);
            }
            Graph graph(budget);
            build_graph(faces, n, graph, budget);
            extension.clear();
            for (int32_t parent : level.parents) extension.push(geometry[static_cast<size_t>(parent)]);
            geometry.resize(n);
            predict(graph, filter, coefficients.span(), extension.span(), geometry.span(), budget);
            std::vector<int32_t> differences;
            for (size_t v = 0; v < n; v++) {
                geometry[v] = grid.within(geometry[v]);
                const double predicted[3] = {geometry[v].x, geometry[v].y, geometry[v].z};
                for (size_t k = 0; k < 3; k++)
                    differences.push_back(level.cells[3 * v + k] - static_cast<int32_t>(grid.cell_of(predicted[k])));
            }
            if (l == 0 || numbers.below(3) != 0) {
                options.diffs |= 1u << number;
                encoder.encode_diff({differences.data(), differences.size()}, payload);
                add_packet(stream, {PacketKind::diff, number, 0}, payload);
                truth.differences[l].assign(differences.begin(), differences.end());
                for (size_t v = 0; v < n; v++) geometry[v] = grid.moved(geometry[v], &truth.differences[l][3 * v]);
            }
        }
        header.states.push({n, level.faces.size() / 3, {}, static_cast<uint32_t>(header.packets.size()), number});
    }
    return truth;
}

void check_round_trip(const RandomStream& stream, const std::vector<size_t>& order, const RandomMesh& mesh,
                      const ClassicTruth& truth, Digest& digest) {
    Budget budget(MEMORY);
    auto decoder = make_stream_decoder(stream.header, untrained(), budget);
    Shown shown(budget);
    for (size_t i : order) {
        decoder->push(stream.place(i), stream.payload(i));
        show_all(*decoder, shown);
    }
    check_equal(decoder->decoded_diffs().size(), 0u);
    auto all = (static_cast<uint64_t>(1) << truth.levels.size()) - 1;
    check_equal(decoder->available(), all);
    check_equal(decoder->exact(), all);
    for (size_t l = truth.levels.size(); l-- > 0;) {
        decoder->show(static_cast<uint32_t>(l), shown);
        digest.add(shown.positions.begin(), 8 * shown.positions.size());
        check_equal(shown.faces.size(), truth.levels[l].faces.size());
        for (size_t i = 0; i < shown.faces.size(); i++) check_equal(shown.faces[i], truth.levels[l].faces[i]);
    }
    check_equal(shown.positions.size(), mesh.positions.size());
    for (size_t i = 0; i < mesh.positions.size(); i++) check(shown.positions[i] == mesh.positions[i]);
}

// Without some Diffs all levels can be shown; none at or below a missing one is exact.
void check_missing_diffs(const RandomStream& stream, Numbers& numbers) {
    Budget budget(MEMORY);
    auto decoder = make_stream_decoder(stream.header, untrained(), budget);
    Shown shown(budget);
    uint64_t exact = ~static_cast<uint64_t>(0);
    for (size_t i = 0; i < stream.payloads.size(); i++) {
        bool left_out = stream.place(i).kind == PacketKind::diff && numbers.below(2) != 0;
        if (left_out)
            exact &= ~((static_cast<uint64_t>(2) << stream.place(i).level) - 1);
        else
            decoder->push(stream.place(i), stream.payload(i));
    }
    check_equal(decoder->exact(), decoder->available() & exact);
    show_all(*decoder, shown);
}

#ifndef __wasm__ // where a failure ends the program
void check_damage(RandomStream& stream, const std::vector<size_t>& order, Numbers& numbers) {
    std::vector<uint8_t>& payload = stream.payloads[numbers.below(static_cast<uint32_t>(stream.payloads.size()))];
    if (payload.empty()) return;
    std::vector<uint8_t> whole = payload;
    damage(payload, numbers);
    Budget budget(MEMORY);
    auto decoder = make_stream_decoder(stream.header, untrained(), budget);
    Shown shown(budget);
    for (size_t i : order) {
        try {
            decoder->push(stream.place(i), stream.payload(i));
        } catch (const Failure& failure) {
            check_equal(static_cast<int>(failure.fault), static_cast<int>(Fault::malformed));
        }
        show_all(*decoder, shown);
    }
    payload = whole;
}
#endif

// Classic Diffs are told as they were sent, and others are added in their place: where level 0's are larger by a
// quarter, its vertices lie a quarter further, and all other levels where they are.
void check_changed_diffs(const RandomStream& stream, const RandomMesh& mesh, const ClassicTruth& truth) {
    if (truth.levels.size() < 2) return;
    Budget budget(MEMORY);
    auto decoder = make_stream_decoder(stream.header, untrained(), budget);
    auto plain = make_stream_decoder(stream.header, untrained(), budget);
    decoder->watch_diffs();
    Shown shown(budget), expected(budget);
    for (size_t i = 0; i < stream.payloads.size(); i++) {
        PacketPlace place = stream.place(i);
        decoder->push(place, stream.payload(i));
        plain->push(place, stream.payload(i));
        check_equal(decoder->decoded_diffs().size(), place.kind == PacketKind::diff ? 1u : 0u);
        if (place.kind != PacketKind::diff) continue;
        const DecodedDiffs& told = decoder->decoded_diffs()[0];
        const std::vector<double>& sent = truth.differences[place.level];
        check_equal(told.level, place.level);
        check_equal(told.values.size(), sent.size());
        std::vector<double> others(sent.size());
        for (size_t k = 0; k < sent.size(); k++) {
            check(told.values[k] == sent[k]);
            others[k] = sent[k] + (place.level == 0 ? 0.25 : 0);
        }
        decoder->replace_diffs(0, {others.data(), others.size()});
        check_fails(Fault::argument, [&] { decoder->replace_diffs(1, {others.data(), others.size()}); });
        check_fails(Fault::argument, [&] { decoder->replace_diffs(0, {others.data(), others.size() - 3}); });
        others[0] = INFINITY;
        check_fails(Fault::argument, [&] { decoder->replace_diffs(0, {others.data(), others.size()}); });
    }
    decoder->show(0, shown);
    for (size_t i = 0; i < mesh.positions.size(); i++) check(shown.positions[i] == mesh.positions[i] + 0.25);
    decoder->show(1, shown);
    plain->show(1, expected);
    for (size_t i = 0; i < shown.positions.size(); i++) check(shown.positions[i] == expected.positions[i]);
}

// Diffs of profile compact add up to where vertices lie in their leaf cells; others move vertices by as much, and never
// out of these cells. Packets come in any order, so some wait for others.
void check_compact(const RandomMesh& mesh, Numbers& numbers) {
    Budget budget(MEMORY);
    RandomStream stream(budget);
    encode_stream(mesh, numbers, stream, budget);
    auto decoder = make_stream_decoder(stream.header, untrained(), budget);
    auto far = make_stream_decoder(stream.header, untrained(), budget);
    decoder->watch_diffs();
    far->watch_diffs();
    size_t told = 0, sent = 0;
    double moved[3] = {};
    for (size_t i : shuffled(stream.payloads.size(), numbers)) {
        PacketPlace place = stream.place(i);
        sent += place.kind == PacketKind::diff && place.level < static_cast<uint32_t>(mesh.bits); // of depth 0: empty
        for (StreamDecoder* each : {decoder.get(), far.get()}) each->push(place, stream.payload(i));
        told += decoder->decoded_diffs().size();
        for (size_t d = 0; d < decoder->decoded_diffs().size(); d++) {
            const DecodedDiffs& diffs = decoder->decoded_diffs()[d];
            std::vector<double> none(diffs.values.size()), large(diffs.values.size());
            for (size_t k = 0; k < none.size(); k++) {
                double steps = static_cast<double>(1 << diffs.level);
                moved[k % 3] += diffs.values[k] * steps;
                large[k] = diffs.values[k] + 1000;
            }
            decoder->replace_diffs(d, {none.data(), none.size()});
            far->replace_diffs(d, {large.data(), large.size()});
        }
    }
    check_equal(told, sent);
    Octree octree(mesh.position_span(), mesh.face_span(), mesh.bits, budget);
    Level level(budget);
    octree.make_level(mesh.bits, level, budget);
    Shown middles(budget), borders(budget);
    decoder->show(0, middles);
    far->show(0, borders);
    double expected[3] = {};
    for (size_t v = 0; v < mesh.vertex_count(); v++) {
        double side = static_cast<double>(1 << (mesh.bits - level.cell_depths[v]));
        for (size_t k = 0; k < 3; k++) {
            size_t place = 3 * v + k;
            double middle = 0.5 * (static_cast<double>(level.centres[v][static_cast<int>(k)]) - 1);
            expected[k] += mesh.positions[place] - middle;
            check(middles.positions[place] == middle); // Diffs of zero leave it there
            bool at_border = borders.positions[place] == middle + side / 2;
            check(at_border || borders.positions[place] == mesh.positions[place]); // as it is without any Diff
        }
    }
    for (size_t k = 0; k < 3; k++) check(moved[k] == expected[k]);
}

} // namespace

void test_classic_decoder() {
    Numbers numbers, others{7};
    Digest digest;
    for (int round = 0; round < 60; round++) {
        Budget budget(MEMORY);
        RandomMesh mesh = random_mesh(numbers, round % 20 == 0 ? 2000 : 150);
        RandomStream stream(budget);
        ClassicTruth truth = encode_classic(mesh, numbers, stream, budget);
        for (const auto& payload : stream.payloads) digest.add(payload.data(), payload.size());
        std::vector<size_t> order(stream.payloads.size());
        for (size_t i = 0; i < order.size(); i++) order[i] = i;
        check_round_trip(stream, order, mesh, truth, digest);
        check_round_trip(stream, shuffled(order.size(), numbers), mesh, truth, digest);
        check_missing_diffs(stream, others);
        check_changed_diffs(stream, mesh, truth);
#ifndef __wasm__
        for (int i = 0; i < 10; i++) check_damage(stream, shuffled(order.size(), others), others);
#endif
    }
    check_equal(digest.value, STREAMS);
    for (int round = 0; round < 20; round++) check_compact(random_mesh(numbers, 150), others);
}

} // namespace meshtide::testing
