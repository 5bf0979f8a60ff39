// Trained states as few bytes (docs/format.md, Trained states).
//
// What a coder knows before its first decision: probabilities of contexts, weights of neurons, scores. They are data of
// the format, tens of kilobytes of it, so they are kept as coarsely as the sizes of streams do not notice, and coded by
// the range coder itself: a probability as one of 32 steps of its log-odds given that of the context before, how sure
// it is as one of four rates, a weight by its difference from the same weight of the row before.
//
// One function for both directions again: an encoder reads the spans, a decoder fills them.
#pragma once

#include "entropy/contexts.hpp"
#include "entropy/tables.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// Steps of 128 in the domain of STRETCH.
constexpr int STATE_STEPS = 32;
// Rates of contexts that were never seen in training, a few times, often, and as often as counts.
constexpr int STATE_RATES = 4;

class StatesModel {
public:
    explicit StatesModel(Budget& budget) : rates_(budget), steps_(budget), numbers_(budget) {
        rates_.assign(4 * STATE_RATES, Context{});
        steps_.assign(8 * STATE_STEPS, Context{});
        numbers_.assign(3 * SIGNED_CONTEXTS, Context{});
    }

    // `settled_rate` is the slow rate, out of 65536, of a context that was seen as often as counts.
    template <class Coder>
    void code_contexts(Coder& coder, Span<Context> contexts, uint16_t settled_rate) {
        const uint16_t rates[STATE_RATES] = {
            32767, 13107, static_cast<uint16_t>(settled_rate < 4000 ? 8192 : 2 * settled_rate), settled_rate};
        int step_before = STATE_STEPS / 2, rate_before = 0;
        for (Context& context : contexts) {
            int rate = 0;
            if (Coder::encoding)
                while (rate + 1 < STATE_RATES && context.slow_rate <= (rates[rate] + rates[rate + 1]) / 2) rate++;
            rate = code_tree(coder, rates_.span().part(static_cast<size_t>(4 * rate_before), 4), 2, rate);
            rate_before = rate;
            if (rate == 0) {
                context = Context{};
                continue;
            }
            int step = (LOGISTIC.stretch[context.slow >> 4] + 2048) >> 7;
            auto row = static_cast<size_t>(step_before >> 2) * STATE_STEPS;
            step = code_tree(coder, steps_.span().part(row, STATE_STEPS), 5, step);
            step_before = step;
            uint16_t probability = LOGISTIC.squash[static_cast<size_t>(128 * step + 64)];
            uint16_t fast = rates[rate] < FASTEST_FLOOR ? FASTEST_FLOOR : rates[rate];
            context = Context{probability, probability, rates[rate], fast};
        }
    }

    // Rows of `lanes` weights, each to a multiple of 2^shift.
    template <class Coder>
    void code_weights(Coder& coder, Span<int16_t> weights, size_t lanes, int shift) {
        int half = 1 << (shift - 1);
        for (size_t i = 0; i < weights.size(); i++) {
            int before = i < lanes ? 0 : weights[i - lanes] >> shift; // already rounded
            int value = (weights[i] + half) >> shift;
            value = value > 32767 >> shift ? 32767 >> shift : value;
            int change = code_signed(coder, numbers_.span().part(0, SIGNED_CONTEXTS), value - before);
            expect(change >= -65536 && change <= 65536, "a weight of more than 16 bits");
            int restored = (before + change) * (1 << shift);
            expect(restored >= -32768 && restored <= 32767, "a weight of more than 16 bits");
            weights[i] = static_cast<int16_t>(restored);
        }
    }

    // Scores of candidates, to multiples of 2^shift; most of a table's entries are near the one before.
    template <class Coder>
    void code_scores(Coder& coder, Span<int16_t> scores, int shift) {
        code_weights(coder, scores, 1, shift);
    }

private:
    template <class Coder>
    static int code_tree(Coder& coder, Span<Context> contexts, int depth, int value) {
        size_t node = 1;
        for (int left = depth - 1; left >= 0; left--)
            node = node << 1 | static_cast<size_t>(code_bit(coder, contexts[node], value >> left & 1));
        return static_cast<int>(node) - (1 << depth);
    }

    Array<Context> rates_;
    Array<Context> steps_;
    Array<Context> numbers_;
};

} // namespace meshtide::inline MESHTIDE_ISA
