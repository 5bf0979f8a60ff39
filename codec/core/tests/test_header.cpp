// stream/header.hpp and stream/numbers.hpp: what is written is read again, and nothing else is believed.
#include "check.hpp"
#include "stream/header.hpp"

#include <cstring>

namespace meshtide::testing {

namespace {

void fill_levels(Header& header, Numbers& numbers, uint32_t levels) {
    uint64_t vertices = 1;
    for (uint32_t level = levels; level-- > 0;) {
        vertices += numbers.below(1000);
        PacketEntry entry{};
        entry.length = numbers.below(100000);
        entry.checksum = numbers.below(UINT32_MAX);
        entry.level = static_cast<uint8_t>(level);
        entry.kind = static_cast<uint8_t>(level + 1 == levels ? PacketKind::base : PacketKind::map_conn);
        header.packets.push(entry);
        if (level + 1 < levels && numbers.below(2) != 0) {
            entry.kind = static_cast<uint8_t>(PacketKind::diff);
            header.packets.push(entry);
        }
        auto word = static_cast<uint16_t>(numbers.below(65536));
        header.states.push(
            {vertices, 2 * vertices, unpack_distances(word), static_cast<uint32_t>(header.packets.size()), level});
    }
}

void fill(Header& header, Numbers& numbers) {
    const double coordinates[] = {0.1, -2.45912, 1.0 / 3, 0.5, 1e10, -0.0, 1.5, 3.4e38};
    header.profile = numbers.below(2) != 0 ? Profile::compact : Profile::classic;
    header.bits = numbers.between(LEAST_BITS, MOST_BITS);
    for (double& coordinate : header.origin) coordinate = coordinates[numbers.below(8)];
    header.extent = 1 + 0.1 * coordinates[numbers.below(4)];
    uint32_t levels = 1 + numbers.below(5);
    fill_levels(header, numbers, levels);
    if (header.profile == Profile::compact) {
        CompactOptions& options = header.compact;
        options.base_depth = header.bits - static_cast<int>(levels) + 1;
        options.effort = static_cast<int32_t>(numbers.below(2));
        if (numbers.below(2) != 0) {
            options.mirror_axis = numbers.between(0, 2);
            options.mirror_sum = static_cast<int32_t>(numbers.below(2u << header.bits));
        }
        options.slices.push(0);
        if (numbers.below(2) != 0) options.slices.push(1 + numbers.below(4000));
        for (uint32_t i = 0; i < levels; i++) options.strengths[i] = static_cast<uint8_t>(numbers.below(16));
        return;
    }
    ClassicOptions& options = header.classic;
    options.levels = levels;
    for (uint32_t level = 1; level < levels; level++) options.shifts[level] = static_cast<uint8_t>(level);
    options.diffs = numbers.below(1u << (levels - 1));
    options.filter = static_cast<FilterKind>(numbers.below(5));
    options.degree = 3;
    options.denominator_degree = 1;
    options.taubin_lambda = 0.6307;
    options.taubin_mu = 0.6732;
}

void check_coordinates(Budget& budget) {
    Array<uint8_t> bytes(budget);
    struct {
        double value;
        size_t length;
    } cases[] = {{0, 2}, {-0.0, 5}, {0.5, 2}, {-2.45912, 4}, {1.0 / 3, 9}, {1e22, 9}, {3.4028234663852886e38, 5}};
    for (const auto& each : cases) {
        bytes.clear();
        write_coordinate(bytes, each.value);
        check_equal(bytes.size(), each.length);
        ByteReader reader(bytes.span());
        double read = reader.coordinate();
        check(reader.at_end() && std::memcmp(&read, &each.value, sizeof read) == 0);
    }
}

void check_distances() {
    for (uint32_t word = 0; word < 65536; word += 7) {
        Distances distances = unpack_distances(static_cast<uint16_t>(word));
        Distances again = unpack_distances(pack_distances(distances));
        check(again.rms == distances.rms && again.maximum == distances.maximum);
        if (distances.rms > 0.01 && distances.rms < 0.5) { // rounded up, and not by much
            Distances above = unpack_distances(pack_distances({distances.rms * 1.0001, distances.maximum}));
            check(above.rms > distances.rms && above.rms < distances.rms * 1.017);
        }
    }
}

} // namespace

void test_header() {
    Budget budget(1u << 24);
    check_coordinates(budget);
    check_distances();
    Numbers numbers;
    for (int round = 0; round < 200; round++) {
        Header header(budget), again(budget);
        fill(header, numbers);
        Array<uint8_t> bytes(budget), second(budget);
        write_header(header, bytes);
        parse_header(bytes.span(), Limits{}, again);
        write_header(again, second);
        check_equal(second.size(), bytes.size());
        check(std::memcmp(second.begin(), bytes.begin(), bytes.size()) == 0);
        check(again.vertices() == header.vertices() && again.packets.size() == header.packets.size());
#ifndef __wasm__ // where a failure ends the program
        auto parse = [&](size_t length) {
            Header other(budget);
            try {
                parse_header({bytes.begin(), length}, Limits{}, other);
                return Fault::none;
            } catch (const Failure& failure) {
                return failure.fault;
            }
        };
        // All but the options, of which those at the end may be missing, ends with an error where it is cut.
        for (size_t length = 0; length < 20; length++) check(parse(length) == Fault::malformed);
        for (size_t bit = 0; bit < 8 * bytes.size(); bit++) {
            bytes[bit / 8] ^= static_cast<uint8_t>(1u << bit % 8);
            Fault fault = parse(bytes.size());
            check(fault != Fault::internal && fault != Fault::memory);
            bytes[bit / 8] ^= static_cast<uint8_t>(1u << bit % 8);
        }
        Limits few;
        few.packets = header.packets.size() - 1;
        check_fails(Fault::limit, [&] {
            Header other(budget);
            parse_header(bytes.span(), few, other);
        });
        bytes[0] = 3;
        check(parse(bytes.size()) == Fault::version);
#endif
    }
}

} // namespace meshtide::testing
