#include "entropy/tables.hpp"

#include <cstddef>

namespace meshtide {

// The format defines them by integers of 128 bits. Doubles give the same: their error stays below 2^-41 of a value,
// where the nearest of 4096 roundings is 2^-14 of one away, and the nearest of 2048 comparisons 2^-22.
LogisticTables::LogisticTables() {
    constexpr std::size_t POWERS = 4098;
    double powers[POWERS] = {1}; // powers[k] is exp(-k / 512)
    for (std::size_t k = 1; k < POWERS; k++) powers[k] = powers[k - 1] * 0x1.ff003ff556aa9p-1;
    int k = 0;
    for (std::size_t i = 2048; i < 4096; i++) {
        double e = powers[2 * (i - 2048)], e_below = powers[2 * (i - 2047)];
        auto above = static_cast<uint16_t>(65536 / (1 + e)),
             below = static_cast<uint16_t>(65536 * e_below / (1 + e_below));
        squash[i] = above > 65488 ? uint16_t{65488} : above;
        squash[4095 - i] = below < 48 ? uint16_t{48} : below;
        double odds = static_cast<double>(8191 - 2 * i) / static_cast<double>(2 * i + 1);
        while (k < 2047 && powers[static_cast<std::size_t>(2 * k + 1)] > odds) k++;
        stretch[i] = static_cast<int16_t>(k);
        stretch[4095 - i] = static_cast<int16_t>(-k);
    }
}

const LogisticTables LOGISTIC;

} // namespace meshtide
