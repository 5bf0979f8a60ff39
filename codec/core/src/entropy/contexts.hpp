// Contexts: what is known of a kind of decision (docs/format.md, Contexts).
//
// A context has two probabilities of a one, which learn at two speeds. The slow one averages all that it has seen,
// until its rate has fallen to 1/202; the fast one forgets at a rate of 1/14. Eight bytes, so one line of the cache.
#pragma once

#include "entropy/range_coder.hpp"

namespace meshtide::inline MESHTIDE_ISA {

struct Context {
    uint16_t slow = 32768, fast = 32768;           // probabilities of a one, out of 65536
    uint16_t slow_rate = 32767, fast_rate = 32767; // how far a probability moves, out of 65536
};
static_assert(sizeof(Context) == 8);

constexpr uint16_t SLOWEST_RATE = 325;
constexpr uint16_t FASTEST_FLOOR = 4819;

// One step of a probability towards the bit. Both directions round towards where it comes from, so it never overflows.
MESHTIDE_INLINE void learn(uint16_t& probability, uint16_t& rate, uint16_t floor, int bit) {
    uint32_t mask = bit != 0 ? 0xffff : 0;
    uint32_t distance = probability ^ mask;
    distance -= distance * rate >> 16;
    probability = static_cast<uint16_t>(distance ^ mask);
    uint32_t next = rate - (static_cast<uint32_t>(rate) * rate >> 16);
    rate = static_cast<uint16_t>(next < floor ? floor : next);
}

MESHTIDE_INLINE uint32_t mean_of(const Context& context) {
    return (static_cast<uint32_t>(context.slow) + context.fast) >> 1;
}

// A decision by one context: the mean of its two probabilities. Coders that train watch contexts and what they meet.
template <class Coder>
MESHTIDE_ONCE int code_bit(Coder& coder, Context& context, int bit = 0) {
    uint32_t probability = mean_of(context);
    probability = probability < LEAST_PROBABILITY      ? LEAST_PROBABILITY
                  : probability > GREATEST_PROBABILITY ? GREATEST_PROBABILITY
                                                       : probability;
    if constexpr (requires { coder.watch(context, bit); }) coder.watch(context, bit);
    bit = coder.code(probability, bit);
    learn(context.slow, context.slow_rate, SLOWEST_RATE, bit);
    learn(context.fast, context.fast_rate, FASTEST_FLOOR, bit);
    return bit;
}

// `count` bits of equal chance, the highest first.
template <class Coder>
uint32_t code_raw(Coder& coder, int count, uint32_t value = 0) {
    uint32_t result = 0;
    for (int i = count - 1; i >= 0; i--)
        result = result << 1 | static_cast<uint32_t>(coder.code(32768, static_cast<int>(value >> i & 1)));
    return result;
}

constexpr size_t UNSIGNED_CONTEXTS = 131;
constexpr size_t SIGNED_CONTEXTS = 132;

// An integer 0..2^32 - 2 by the length of its successor, the two bits below the leading one, and the rest raw.
template <class Coder>
uint32_t code_unsigned(Coder& coder, Span<Context> contexts, uint32_t value = 0) {
    uint32_t successor = value + 1;
    int length = Coder::encoding ? 31 - std::countl_zero(successor) : 0;
    int known = 0;
    while (code_bit(coder, contexts[static_cast<size_t>(known)], known < length ? 1 : 0) != 0) {
        known++;
        expect(known < 32, "a number of more than 32 bits");
    }
    uint32_t read = 1;
    for (int left = known - 1; left >= 0; left--) {
        int bit = static_cast<int>(successor >> left & 1);
        auto place = static_cast<size_t>(32 + 3 * known);
        if (left == known - 1)
            bit = code_bit(coder, contexts[place], bit);
        else if (left == known - 2)
            bit = code_bit(coder, contexts[place + 1 + (read & 1)], bit);
        else
            bit = static_cast<int>(code_raw(coder, 1, static_cast<uint32_t>(bit)));
        read = read << 1 | static_cast<uint32_t>(bit);
    }
    return read - 1;
}

// An integer of magnitude below 2^31: the magnitude, and a sign unless that is 0.
template <class Coder>
int32_t code_signed(Coder& coder, Span<Context> contexts, int32_t value = 0) {
    uint32_t magnitude =
        code_unsigned(coder, contexts, value < 0 ? 0u - static_cast<uint32_t>(value) : static_cast<uint32_t>(value));
    expect(magnitude < 1u << 31, "a number of more than 31 bits");
    if (magnitude == 0) return 0;
    bool negative = code_bit(coder, contexts[131], value < 0) != 0;
    return negative ? -static_cast<int32_t>(magnitude) : static_cast<int32_t>(magnitude);
}

} // namespace meshtide::inline MESHTIDE_ISA
