// STRETCH and SQUASH, the logistic domain in integers (docs/format.md, Models).
//
// Made of integer products alone, so that they are the same everywhere; computed by the compiler.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace meshtide {

struct LogisticTables {
    std::array<int16_t, 4096> stretch; // of a probability >> 4: 256 ln(p / (1 - p)), -2047..2047
    std::array<uint16_t, 4096> squash; // of a stretched value + 2048: the probability, 48..65488
};

namespace detail {

__extension__ typedef unsigned __int128 Wide;

// The upper 128 bits of a product.
constexpr Wide multiply_high(Wide a, Wide b) {
    Wide mask = ~static_cast<uint64_t>(0);
    Wide a_low = a & mask, a_high = a >> 64, b_low = b & mask, b_high = b >> 64;
    Wide middle = a_high * b_low + (a_low * b_low >> 64);
    Wide other = a_low * b_high + (middle & mask);
    return a_high * b_high + (middle >> 64) + (other >> 64);
}

// a b > c 2^128, for factors b and c below 2^13.
constexpr bool exceeds(Wide a, uint32_t b, uint32_t c) {
    Wide low = (a & ~static_cast<uint64_t>(0)) * b, high = (a >> 64) * b + (low >> 64);
    uint64_t whole = static_cast<uint64_t>(high >> 64);
    bool rest = static_cast<uint64_t>(high) != 0 || static_cast<uint64_t>(low) != 0;
    return whole > c || (whole == c && rest);
}

constexpr LogisticTables make_logistic_tables() {
    LogisticTables tables{};
    // powers[k] is exp(-k / 512) 2^128.
    const Wide step = static_cast<Wide>(0xFF801FFAAB554445u) << 64 | 0xB04105B043E8F48Du;
    std::array<Wide, 4098> powers{};
    powers[1] = step; // powers[0], 2^128, is one too many for 128 bits
    for (std::size_t k = 2; k < powers.size(); k++) powers[k] = multiply_high(powers[k - 1], step);
    for (std::size_t i = 0; i < 4096; i++) {
        std::size_t distance = i < 2048 ? 2048 - i : i - 2048;
        uint32_t value = 32768;
        if (distance != 0) {
            // 2^16 n / (2^128 + e) with n = 2^128 or e, in 128 bits: both halved until the product fits.
            Wide e = powers[2 * distance] >> 17, one = static_cast<Wide>(1) << 111;
            Wide numerator = i < 2048 ? e : one;
            value = static_cast<uint32_t>((numerator << 16) / (one + e));
        }
        tables.squash[i] = static_cast<uint16_t>(value < 48 ? 48 : value > 65488 ? 65488 : value);
    }
    uint32_t k = 0;
    for (uint32_t i = 2048; i < 4096; i++) {
        while (k < 2047 && exceeds(powers[2 * k + 1], 2 * i + 1, 8191 - 2 * i)) k++;
        tables.stretch[i] = static_cast<int16_t>(k);
        tables.stretch[4095 - i] = static_cast<int16_t>(-static_cast<int>(k));
    }
    return tables;
}

} // namespace detail

extern const LogisticTables LOGISTIC;

} // namespace meshtide
