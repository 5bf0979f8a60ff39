// Logarithms that are the same on every machine, which those of C libraries are not: from + - * / alone.
#pragma once

#include "base/lanes.hpp"

#include <cmath>

namespace meshtide::inline MESHTIDE_ISA {

constexpr double LOG_2 = 0.693147180559945309417;

// Of a positive number, to about 1e-14.
inline double natural_logarithm(double value) {
    int exponent = 0;
    double mantissa = std::frexp(value, &exponent);
    if (mantissa < 0.70710678118654752) mantissa *= 2.0, exponent--;
    double t = (mantissa - 1.0) / (mantissa + 1.0), squared = t * t, sum = 0.0;
    for (int odd = 17; odd >= 1; odd -= 2) sum = sum * squared + 1.0 / odd;
    return 2.0 * t * sum + exponent * LOG_2;
}

// Of a number of magnitude below 700.
inline double exponential(double value) {
    int exponent = static_cast<int>(std::floor(value / LOG_2 + 0.5));
    double rest = value - exponent * LOG_2, sum = 1.0;
    for (int k = 14; k >= 1; k--) sum = 1.0 + rest * sum / k;
    return std::ldexp(sum, exponent);
}

} // namespace meshtide::inline MESHTIDE_ISA
