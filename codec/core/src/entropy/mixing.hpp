// The mixer: one decision from many contexts (docs/format.md, Mixed decisions).
//
// M. Mahoney's logistic mixing (PAQ), two stages: each of several neurons, chosen by a class of its own, weighs all
// inputs; a final one weighs what the neurons say. All of it in 16-bit integers whose every operation is one
// instruction for eight lanes. A context gives four inputs: its slow and its fast probability, each stretched and as it
// is.
#pragma once

#include "entropy/contexts.hpp"
#include "entropy/tables.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// Weights are 16-bit, 1.0 is 2^14.
constexpr int WEIGHT_ONE = 1 << 14;

// The sign of an input, for four contexts at a time: lane k and lane k + 4 are -1 where context k tells the opposite.
MESHTIDE_INLINE I16x8 opposed(bool a, bool b, bool c, bool d) {
    uint64_t lanes =
        (a ? 0xffffull : 0) | (b ? 0xffffull << 16 : 0) | (c ? 0xffffull << 32 : 0) | (d ? 0xffffull << 48 : 0);
    typedef uint64_t U64x2 __attribute__((vector_size(16)));
    return reinterpret_cast<I16x8>(U64x2{lanes, lanes});
}

// What a mixer of `Groups` times four contexts and `Neurons` neurons (at most 8) knows. Places are checked on use.
struct MixerStates {
    Span<Context> contexts;
    Span<int16_t> weights;       // `lanes` for each neuron
    Span<int16_t> final_weights; // 8 for each final neuron
};

template <int Groups, int Neurons, int Rate>
class Mixer {
    static_assert(Groups >= 1 && Neurons >= 1 && Neurons <= 8 && Rate >= 3 && Rate <= 6);

public:
    static constexpr int context_count = 4 * Groups;
    static constexpr int neuron_count = Neurons;
    static constexpr int lanes = 16 * Groups + 8; // inputs of a neuron: for each group 4 slow, 4 fast stretched, the
                                                  // same as they are; then eight numbers

    struct Question {
        uint32_t contexts[context_count]; // places
        I16x8 opposed[Groups];            // signs, as made by opposed()
        I16x8 numbers;                    // -2047..2047 each
        uint32_t neurons[neuron_count];   // which of them
        uint32_t final_neuron;
    };

    explicit Mixer(MixerStates states) : states_(states) {}

    template <class Coder>
    MESHTIDE_INLINE int code(Coder& coder, const Question& question, int bit = 0) const {
        Context* at[context_count];
        for (int i = 0; i < context_count; i++) at[i] = &states_.contexts[question.contexts[i]];

        I16x8 probabilities[Groups], rates[Groups], inputs[2 * Groups + 1];
        for (int g = 0; g < Groups; g++) {
            gather(at + 4 * g, probabilities[g], rates[g]);
            I16x8 flip = question.opposed[g];
            I16x8 stretched;
            for (int i = 0; i < 8; i++)
                stretched[i] = LOGISTIC.stretch[static_cast<uint16_t>(probabilities[g][i]) >> 4];
            inputs[2 * g] = (stretched ^ flip) - flip;
            I16x8 plain = (probabilities[g] ^ splat16(-32768)) >> 5;
            inputs[2 * g + 1] = (plain ^ flip) - flip;
        }
        inputs[2 * Groups] = question.numbers;

        int16_t* weights[Neurons];
        I32x4 totals[8] = {};
        for (int j = 0; j < Neurons; j++) {
            weights[j] = states_.weights.block(static_cast<size_t>(question.neurons[j]) * lanes, lanes);
            I32x4 total = multiply_pairs(load<I16x8>(weights[j]), inputs[0]);
            for (int i = 1; i <= 2 * Groups; i++)
                total = add32(total, multiply_pairs(load<I16x8>(weights[j] + 8 * i), inputs[i]));
            totals[j] = total;
        }
        I32x4 first = sums(totals[0], totals[1], totals[2], totals[3]) >> 14;
        I32x4 second = Neurons > 4 ? sums(totals[4], totals[5], totals[6], totals[7]) >> 14 : splat32(0);
        I16x8 opinions = greatest(least(pack(first, second), splat16(2047)), splat16(-2047));

        int16_t* final_weights = states_.final_weights.block(static_cast<size_t>(question.final_neuron) * 8, 8);
        I16x8 final_row = load<I16x8>(final_weights);
        int total = sum(multiply_pairs(final_row, opinions)) >> 14;
        total = total < -2047 ? -2047 : total > 2047 ? 2047 : total;
        int probability = LOGISTIC.squash[static_cast<size_t>(total + 2048)];

        bit = coder.code(static_cast<uint32_t>(probability), bit);

        int target = bit << 16;
        store(final_weights,
              add_saturated(final_row, multiply_rounded(opinions, splat16((target - probability + 32) >> 6))));
        for (int j = 0; j < Neurons; j++) {
            int error = target - LOGISTIC.squash[static_cast<size_t>(opinions[j] + 2048)];
            I16x8 scaled = splat16((error + (1 << (Rate - 1))) >> Rate);
            for (int i = 0; i <= 2 * Groups; i++) {
                int16_t* row = weights[j] + 8 * i;
                store(row, add_saturated(load<I16x8>(row), multiply_rounded(inputs[i], scaled)));
            }
        }
        for (int g = 0; g < Groups; g++) {
            I16x8 mask = splat16(-bit) ^ question.opposed[g];
            I16x8 distance = probabilities[g] ^ mask;
            distance = distance - multiply_high(distance, rates[g]);
            I16x8 next = rates[g] - multiply_high(rates[g], rates[g]);
            scatter(at + 4 * g, distance ^ mask, greatest(next, RATE_FLOORS));
        }
        return bit;
    }

private:
    static constexpr I16x8 RATE_FLOORS = {SLOWEST_RATE,  SLOWEST_RATE,  SLOWEST_RATE,  SLOWEST_RATE,
                                          FASTEST_FLOOR, FASTEST_FLOOR, FASTEST_FLOOR, FASTEST_FLOOR};

    typedef uint64_t U64x2 __attribute__((vector_size(16)));

    static MESHTIDE_INLINE uint64_t bytes_of(const Context* context) {
        uint64_t bytes;
        std::memcpy(&bytes, context, 8);
        return bytes;
    }
    // Four contexts as their slow and fast probabilities and rates, slow ones first.
    static MESHTIDE_INLINE void gather(Context* const* at, I16x8& probabilities, I16x8& rates) {
        auto a = reinterpret_cast<I16x8>(U64x2{bytes_of(at[0]), bytes_of(at[1])});
        auto b = reinterpret_cast<I16x8>(U64x2{bytes_of(at[2]), bytes_of(at[3])});
        I16x8 even = interleave_low(a, b), odd = interleave_high(a, b); // contexts 0 and 2, 1 and 3
        probabilities = interleave_low(even, odd);
        rates = interleave_high(even, odd);
    }
    static MESHTIDE_INLINE void scatter(Context* const* at, I16x8 probabilities, I16x8 rates) {
        I16x8 slow = interleave_low(probabilities, rates), fast = interleave_high(probabilities, rates);
        auto a = reinterpret_cast<U64x2>(interleave_low(slow, fast));
        auto b = reinterpret_cast<U64x2>(interleave_high(slow, fast));
        // One after the other: where two places are the same, the last one counts.
        put(at[0], a[0]);
        put(at[1], a[1]);
        put(at[2], b[0]);
        put(at[3], b[1]);
    }
    static MESHTIDE_INLINE void put(Context* context, uint64_t bytes) {
        std::memcpy(static_cast<void*>(context), &bytes, 8);
    }

    MixerStates states_;
};

} // namespace meshtide::inline MESHTIDE_ISA
