// STRETCH and SQUASH, the logistic domain in integers (docs/format.md, Mixed decisions).
//
// 16 kilobytes that are made when the library is loaded.
#pragma once

#include <array>
#include <cstdint>

namespace meshtide {

struct LogisticTables {
    LogisticTables();
    std::array<int16_t, 4096> stretch; // of a probability >> 4: 256 ln(p / (1 - p)), -2047..2047
    std::array<uint16_t, 4096> squash; // of a stretched value + 2048: the probability, 48..65488
};

extern const LogisticTables LOGISTIC;

} // namespace meshtide
