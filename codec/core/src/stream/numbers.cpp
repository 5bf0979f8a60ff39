#include "stream/numbers.hpp"

#include <bit>

namespace meshtide {

namespace {

constexpr int MOST_DECIMALS = 22; // 10^22 is the largest power of ten that a double holds
constexpr uint8_t SINGLE = 32, DOUBLE = 64;
constexpr uint64_t LARGEST_MANTISSA = static_cast<uint64_t>(1) << 53;
constexpr double POWERS_OF_TEN[MOST_DECIMALS + 1] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                                     1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                                     1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};

int64_t unfolded(uint64_t value) {
    return (value & 1) != 0 ? -static_cast<int64_t>(value / 2) - 1 : static_cast<int64_t>(value / 2);
}

uint64_t folded(int64_t value) {
    return value >= 0 ? static_cast<uint64_t>(value) * 2 : static_cast<uint64_t>(-(value + 1)) * 2 + 1;
}

size_t digits(uint64_t value) {
    size_t count = 1;
    while (value >= 128) {
        value >>= 7;
        count++;
    }
    return count;
}

constexpr double LARGEST_DISTANCE = 127.0 / 64.0;
constexpr uint32_t RMS_CODES = 2048, FACTOR_CODES = 32, NO_FACTOR = 31;

double power_of_two(int exponent) { return std::bit_cast<double>(static_cast<uint64_t>(exponent + 1023) << 52); }

double rms_of(uint32_t code) {
    return code == 0 ? 0.0 : (64.0 + code % 64) * power_of_two(static_cast<int>(code / 64) - 37);
}

double maximum_of(double rms, uint32_t factor) {
    if (factor == NO_FACTOR) return LARGEST_DISTANCE;
    double maximum = rms * ((4.0 + factor % 4) * power_of_two(static_cast<int>(factor / 4) - 2));
    return maximum < LARGEST_DISTANCE ? maximum : LARGEST_DISTANCE;
}

} // namespace

void ByteReader::fail_here(const char* text) const {
    fail(Failure{Fault::malformed, text, static_cast<int64_t>(position_)});
}

uint8_t ByteReader::byte() {
    if (position_ >= bytes_.size()) fail_here("it ends early");
    return bytes_[position_++];
}

uint64_t ByteReader::number() {
    uint64_t value = 0;
    for (int digit = 0; digit < 9; digit++) {
        uint8_t next = byte();
        value |= static_cast<uint64_t>(next & 127) << (7 * digit);
        if (next < 128) return value;
    }
    fail_here("a number of more than nine bytes");
}

int64_t ByteReader::signed_number() { return unfolded(number()); }

uint64_t ByteReader::fixed(int count) {
    uint64_t value = 0;
    for (int i = 0; i < count; i++) value |= static_cast<uint64_t>(byte()) << (8 * i);
    return value;
}

double ByteReader::coordinate() {
    uint8_t kind = byte();
    if (kind == SINGLE) return static_cast<double>(std::bit_cast<float>(static_cast<uint32_t>(fixed(4))));
    if (kind == DOUBLE) return std::bit_cast<double>(fixed(8));
    if (kind > MOST_DECIMALS) fail_here("a coordinate of no known form");
    uint64_t mantissa = number();
    if (mantissa > 2 * LARGEST_MANTISSA) fail_here("a decimal number of more digits than a double holds");
    return static_cast<double>(unfolded(mantissa)) / POWERS_OF_TEN[kind];
}

void write_number(Array<uint8_t>& out, uint64_t value) {
    while (value >= 128) {
        out.push(static_cast<uint8_t>(value | 128));
        value >>= 7;
    }
    out.push(static_cast<uint8_t>(value));
}

void write_signed(Array<uint8_t>& out, int64_t value) { write_number(out, folded(value)); }

void write_fixed(Array<uint8_t>& out, int count, uint64_t value) {
    for (int i = 0; i < count; i++) out.push(static_cast<uint8_t>(value >> (8 * i)));
}

void write_coordinate(Array<uint8_t>& out, double value) {
    bool negative_zero = std::bit_cast<uint64_t>(value) == std::bit_cast<uint64_t>(-0.0);
    auto single = static_cast<float>(value);
    bool is_single = std::bit_cast<uint64_t>(static_cast<double>(single)) == std::bit_cast<uint64_t>(value);
    size_t other = is_single ? 4 : 8;
    for (int decimals = 0; !negative_zero && decimals <= MOST_DECIMALS; decimals++) {
        double product = value * POWERS_OF_TEN[decimals];
        if (!(product >= -static_cast<double>(LARGEST_MANTISSA) && product <= static_cast<double>(LARGEST_MANTISSA)))
            break;
        double whole = __builtin_nearbyint(product);
        if (whole / POWERS_OF_TEN[decimals] != value) continue;
        uint64_t mantissa = folded(static_cast<int64_t>(whole));
        if (digits(mantissa) > other) break;
        out.push(static_cast<uint8_t>(decimals));
        write_number(out, mantissa);
        return;
    }
    out.push(is_single ? SINGLE : DOUBLE);
    if (is_single)
        write_fixed(out, 4, std::bit_cast<uint32_t>(single));
    else
        write_fixed(out, 8, std::bit_cast<uint64_t>(value));
}

uint16_t pack_distances(Distances distances) {
    if (distances.rms == 0.0 && distances.maximum == 0.0) return 0;
    uint32_t code = 1;
    while (code < RMS_CODES - 1 && rms_of(code) < distances.rms) code++;
    uint32_t factor = 0;
    while (factor < NO_FACTOR && maximum_of(rms_of(code), factor) < distances.maximum) factor++;
    return static_cast<uint16_t>(code * FACTOR_CODES + factor);
}

Distances unpack_distances(uint16_t word) {
    double rms = rms_of(word / FACTOR_CODES);
    return {rms, maximum_of(rms, word % FACTOR_CODES)};
}

} // namespace meshtide
