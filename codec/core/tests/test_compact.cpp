// codec/: whatever the mesh and the order of the packets, a compact stream gives it back; damaged packets are refused
// or decode to something, within the limits.
#include "streams.hpp"

namespace meshtide::testing {

namespace {

constexpr uint64_t MEMORY = 1u << 28;
constexpr uint64_t STREAMS = 0x6ed92ca29a3c136e; // digest of all payloads and levels, the same on every machine

std::vector<size_t> shuffled(size_t count, Numbers& numbers) {
    std::vector<size_t> order(count);
    for (size_t i = 0; i < count; i++) order[i] = i;
    for (size_t i = count; i > 1; i--) std::swap(order[i - 1], order[numbers.below(static_cast<uint32_t>(i))]);
    return order;
}

void show_all(const CompactDecoder& decoder, Shown& shown) {
    for (uint32_t level = 0; level <= MOST_LEVEL; level++)
        if ((decoder.available() >> level & 1) != 0) decoder.show(level, shown);
}

// Every level that the order makes available can be shown on the way; at the end level 0 is the mesh.
void check_round_trip(const RandomStream& stream, const std::vector<size_t>& order, const RandomMesh& mesh,
                      Digest& digest) {
    Budget budget(MEMORY);
    CompactDecoder decoder(stream.header, Limits{}, budget);
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

// Levels decode without Diffs; those of a slice after a missing one wait.
void check_missing_diffs(const RandomStream& stream, Numbers& numbers) {
    Budget budget(MEMORY);
    CompactDecoder decoder(stream.header, Limits{}, budget);
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
    size_t which = numbers.below(static_cast<uint32_t>(stream.payloads.size()));
    std::vector<uint8_t> whole = stream.payloads[which];
    if (whole.empty()) return;
    std::vector<uint8_t>& payload = stream.payloads[which];
    auto length = static_cast<uint32_t>(whole.size());
    if (numbers.below(3) == 0)
        payload.resize(numbers.below(length));
    else
        for (uint32_t i = 1 + numbers.below(4); i > 0; i--)
            payload[numbers.below(length)] ^= static_cast<uint8_t>(1u << numbers.below(8));
    Budget budget(MEMORY);
    CompactDecoder decoder(stream.header, Limits{}, budget);
    Shown shown(budget);
    for (size_t i : order) {
        try {
            decoder.push(stream.place(i), stream.payload(i));
        } catch (const Failure& failure) {
            check_equal(static_cast<int>(failure.fault), static_cast<int>(Fault::malformed));
        }
        show_all(decoder, shown);
    }
    payload = whole;
}
#endif

} // namespace

void test_compact() {
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
        check_missing_diffs(stream, others);
#ifndef __wasm__
        for (int i = 0; i < 10; i++) check_damage(stream, order, others);
#endif
    }
    check_equal(digest.value, STREAMS);
}

} // namespace meshtide::testing
