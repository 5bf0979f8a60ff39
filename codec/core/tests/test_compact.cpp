// codec/: whatever the mesh and the order of the packets, a compact stream gives it back; damaged packets are refused
// or decode to something, within the limits.
#include "streams.hpp"

namespace meshtide::testing {

namespace {

constexpr uint64_t MEMORY = 1u << 28;
constexpr uint64_t STREAMS = 0x60b591b69d67f13f; // digest of all payloads and levels, the same on every machine

// Every level that the order makes available can be shown on the way; at the end level 0 is the mesh.
void check_round_trip(const RandomStream& stream, const std::vector<size_t>& order, const RandomMesh& mesh,
                      Digest& digest) {
    Budget budget(MEMORY);
    CompactDecoder decoder(stream.header, untrained(), budget);
    Shown shown(budget);
    for (size_t i : order) {
        decoder.push(stream.place(i), stream.payload(i));
        show_all(decoder, shown);
    }
    auto all = (static_cast<uint64_t>(2) << (mesh.bits - stream.header.compact.base_depth)) - 1;
    check_equal(decoder.available(), all);
    check_equal(decoder.exact(), all);
    for (uint32_t level = MOST_LEVEL + 1; level-- > 0;) {
        if ((all >> level & 1) == 0) continue;
        decoder.show(level, shown);
        digest.add(shown.positions.begin(), 8 * shown.positions.size());
        digest.add(shown.faces.begin(), 4 * shown.faces.size());
    }
    check_equal(shown.positions.size(), mesh.positions.size());
    check_equal(shown.faces.size(), mesh.faces.size());
    for (size_t i = 0; i < mesh.positions.size(); i++) check(shown.positions[i] == mesh.positions[i]);
    for (size_t i = 0; i < mesh.faces.size(); i++) check_equal(shown.faces[i], mesh.faces[i]);
}

// A decoder that keeps only the finest level shows that one as the others do, and has less in memory.
void check_finest_only(const RandomStream& stream, const std::vector<size_t>& order) {
    Budget budget(MEMORY), other_budget(MEMORY);
    CompactDecoder decoder(stream.header, untrained(), budget), other(stream.header, untrained(), other_budget);
    decoder.keep_finest_only();
    Shown shown(budget), expected(other_budget);
    for (size_t i : order) {
        decoder.push(stream.place(i), stream.payload(i));
        other.push(stream.place(i), stream.payload(i));
        check((decoder.available() & ~other.available()) == 0);
        check_equal(decoder.exact(), decoder.available() & other.exact());
        for (uint32_t level = 0; level <= MOST_LEVEL; level++) {
            if ((decoder.available() >> level & 1) == 0) continue;
            decoder.show(level, shown);
            other.show(level, expected);
            check_equal(shown.positions.size(), expected.positions.size());
            check(std::equal(shown.positions.begin(), shown.positions.end(), expected.positions.begin()));
            check(std::equal(shown.faces.begin(), shown.faces.end(), expected.faces.begin()));
        }
    }
    check_equal(decoder.available() & 1, 1u);
    check(budget.left() >= other_budget.left());
}

// Levels decode without Diffs; those of a slice after a missing one wait.
void check_missing_diffs(const RandomStream& stream, Numbers& numbers) {
    Budget budget(MEMORY);
    CompactDecoder decoder(stream.header, untrained(), budget);
    Shown shown(budget);
    size_t missing = 0;
    for (size_t i = 0; i < stream.payloads.size(); i++) {
        bool left_out = stream.place(i).kind == PacketKind::diff && numbers.below(2) != 0;
        missing += left_out;
        if (!left_out) decoder.push(stream.place(i), stream.payload(i));
    }
    check_equal(decoder.available() & 1, 1u);
    check_equal(decoder.exact() & 1, missing == 0 ? 1u : 0u);
    show_all(decoder, shown);
}

#ifndef __wasm__ // where a failure ends the program
// Never an access outside of an array, never more memory than is allowed.
void check_damage(RandomStream& stream, const std::vector<size_t>& order, Numbers& numbers) {
    std::vector<uint8_t>& payload = stream.payloads[numbers.below(static_cast<uint32_t>(stream.payloads.size()))];
    if (payload.empty()) return;
    std::vector<uint8_t> whole = payload;
    damage(payload, numbers);
    Budget budget(MEMORY);
    CompactDecoder decoder(stream.header, untrained(), budget);
    Shown shown(budget);
    for (size_t i : order) {
        try {
            decoder.push(stream.place(i), stream.payload(i));
            show_all(decoder, shown);
        } catch (const Failure& failure) {
            check_equal(static_cast<int>(failure.fault), static_cast<int>(Fault::malformed));
        }
    }
    payload = whole;
}
#endif

void test_repeated_faces() {
    Budget budget(MEMORY);
    Level level(budget);
    Array<int32_t> faces(budget);
    level.heads.assign(4, NONE);
    for (int32_t corner : {0, 1, 2, 0, 3, 2, 1, 0, 2, 1, 0, 0}) level.corners.push(corner);
    canonical_faces(level, faces, budget);
    const int32_t expected[] = {0, 1, 2, 0, 2, 1, 1, 3, 2};
    check_equal(faces.size(), 9u);
    for (size_t i = 0; i < 9; i++) check_equal(faces[i], expected[i]);
    for (int32_t corner : {1, 2, 0, 0}) level.corners.push(corner);
    check_fails(Fault::malformed, [&] { canonical_faces(level, faces, budget); });
}

} // namespace

void test_compact() {
    test_repeated_faces();
    Numbers numbers, others{7};
    Digest digest;
    for (int round = 0; round < 25; round++) {
        Budget budget(MEMORY);
        RandomMesh mesh = random_mesh(numbers, round % 20 == 0 ? 2000 : 150);
        RandomStream stream(budget);
        encode_stream(mesh, numbers, stream, budget);
        for (const auto& payload : stream.payloads) digest.add(payload.data(), payload.size());
        std::vector<size_t> order(stream.payloads.size());
        for (size_t i = 0; i < order.size(); i++) order[i] = i;
        check_round_trip(stream, order, mesh, digest);
        order = shuffled(order.size(), numbers);
        check_round_trip(stream, order, mesh, digest);
        check_finest_only(stream, order);
        check_missing_diffs(stream, others);
#ifndef __wasm__
        for (int i = 0; i < 10; i++) check_damage(stream, order, others);
#endif
    }
    check_equal(digest.value, STREAMS);
}

} // namespace meshtide::testing
