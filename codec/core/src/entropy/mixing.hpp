// The mixer: one decision from many contexts (docs/format.md, Mixed decisions).
//
// M. Mahoney's logistic mixing (PAQ), two stages: each of several neurons, chosen by a class of its own, weighs all
// inputs; a final one weighs what the neurons say. All of it in 16-bit integers whose every operation is one
// instruction for eight lanes. A context gives two inputs: the mean of its probabilities, stretched, and the slow one
// as it is.
#pragma once

#include "base/effort.hpp"
#include "entropy/contexts.hpp"
#include "entropy/tables.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// Weights are 16-bit, 1.0 is 2^14.
constexpr int WEIGHT_ONE = 1 << 14;

// The sign of an input, for four contexts at a time: lane k and lane k + 4 are -1 where context k holds the opposite.
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

// The shape of a mixer, and how many questions it is asked at once: known to the compiler, which then writes out all of
// its loops,
template <int Groups, int Neurons, int Rate, int Questions = 1>
struct FixedShape {
    static_assert(Groups >= 1 && Neurons >= 1 && Neurons <= 8 && Rate >= 3 && Rate <= 6);
    static constexpr int most_groups = Groups, most_neurons = Neurons, most_questions = Questions;
    static constexpr int groups = Groups, neurons = Neurons, rate = Rate, questions = Questions;
    static constexpr int context_count = 4 * Groups;
    static constexpr int lanes = 8 * Groups + 8; // inputs of a neuron: for each group four that are stretched, four
                                                 // as they are; then eight numbers
    static constexpr int rows = Neurons > 4 ? 8 : 4, most_rows = rows; // places of neurons that are checked
};
// or that of the effort,
template <class Standard, class High>
struct EitherShape {
    static constexpr int most_groups = High::groups, most_neurons = High::neurons;
    static constexpr ByEffort<Standard::groups, High::groups> groups{};
    static constexpr ByEffort<Standard::neurons, High::neurons> neurons{};
    static constexpr ByEffort<Standard::rate, High::rate> rate{};
    static constexpr ByEffort<Standard::questions, High::questions> questions{};
    static constexpr ByEffort<Standard::context_count, High::context_count> context_count{};
    static constexpr ByEffort<Standard::lanes, High::lanes> lanes{};
    static constexpr ByEffort<Standard::rows, High::rows> rows{};
    static constexpr int most_rows = High::most_rows;
};
// or arguments of the code, of which one copy then serves all mixers.
struct AnyShape {
    static constexpr int most_groups = DECODES_ALL ? 5 : 2, most_neurons = DECODES_ALL ? 8 : 3;
    static constexpr int most_rows = DECODES_ALL ? 8 : 4, most_questions = 3;
    int groups, neurons, rate, questions;
};

template <class Shape>
struct MixerQuestion {
    uint32_t contexts[4 * Shape::most_groups]; // places
    I16x8 opposed[Shape::most_groups];         // signs, as made by opposed()
    I16x8 numbers;                             // -2047..2047 each
    uint32_t neurons[Shape::most_rows] = {};   // which of them; best stored in vectors, as they are loaded
    uint32_t final_neuron;
};

namespace detail {

inline constexpr I16x8 RATE_FLOORS = {SLOWEST_RATE,  SLOWEST_RATE,  SLOWEST_RATE,  SLOWEST_RATE,
                                      FASTEST_FLOOR, FASTEST_FLOOR, FASTEST_FLOOR, FASTEST_FLOOR};

typedef uint64_t U64x2 __attribute__((vector_size(16)));

MESHTIDE_INLINE uint64_t bytes_of(const Context& context) {
    uint64_t bytes;
    std::memcpy(&bytes, &context, 8);
    return bytes;
}
// Four contexts as their slow and fast probabilities and rates, slow ones first.
MESHTIDE_INLINE void gather(const Context* contexts, const uint32_t* places, I16x8& probabilities, I16x8& rates) {
    auto a = reinterpret_cast<I16x8>(U64x2{bytes_of(contexts[places[0]]), bytes_of(contexts[places[1]])});
    auto b = reinterpret_cast<I16x8>(U64x2{bytes_of(contexts[places[2]]), bytes_of(contexts[places[3]])});
    I16x8 even = interleave_low(a, b), odd = interleave_high(a, b); // contexts 0 and 2, 1 and 3
    probabilities = interleave_low(even, odd);
    rates = interleave_high(even, odd);
}
// Four inputs each: the means of slow and fast probabilities, stretched, and the slow ones as they are.
MESHTIDE_INLINE I16x8 inputs_of(I16x8 probabilities) {
    I16x8 plain = (probabilities ^ splat16(-32768)) >> 5;
    auto slow = reinterpret_cast<U16x8>(probabilities);
    U16x8 fast = __builtin_shufflevector(slow, slow, 4, 5, 6, 7, 4, 5, 6, 7);
    // (slow + fast) >> 1, without its carry.
    U16x8 means = (slow & fast) + ((slow ^ fast) >> 1);
    uint64_t places = reinterpret_cast<U64x2>(means >> 4)[0], stretched = 0;
    auto stretch = [](uint64_t place) {
        return static_cast<uint64_t>(static_cast<uint16_t>(LOGISTIC.stretch[place & 0xffff]));
    };
    stretched =
        stretch(places) | stretch(places >> 16) << 16 | stretch(places >> 32) << 32 | stretch(places >> 48) << 48;
    return reinterpret_cast<I16x8>(U64x2{stretched, reinterpret_cast<U64x2>(plain)[0]});
}
MESHTIDE_INLINE void put(Context& context, uint64_t bytes) { std::memcpy(static_cast<void*>(&context), &bytes, 8); }
MESHTIDE_INLINE void scatter(Context* contexts, const uint32_t* places, I16x8 probabilities, I16x8 rates) {
    I16x8 slow = interleave_low(probabilities, rates), fast = interleave_high(probabilities, rates);
    auto a = reinterpret_cast<U64x2>(interleave_low(slow, fast));
    auto b = reinterpret_cast<U64x2>(interleave_high(slow, fast));
    // One after the other: where two places are the same, the last one counts.
    put(contexts[places[0]], a[0]);
    put(contexts[places[1]], a[1]);
    put(contexts[places[2]], b[0]);
    put(contexts[places[3]], b[1]);
}

} // namespace detail

// The same, and what places are checked against.
struct MixerKnown : MixerStates {
    int32_t last_context, last_neuron;
};

namespace detail {

// A question from its prediction until it has been learned from.
template <class Shape>
struct Prediction {
    I16x8 probabilities[Shape::most_groups], rates[Shape::most_groups], inputs[Shape::most_groups + 1];
    int16_t* weights[Shape::most_neurons];
    int16_t* final_weights;
    I16x8 opinions;
    int probability;

    MESHTIDE_INLINE void predict(const Shape& shape, const MixerKnown& states, const MixerQuestion<Shape>& question) {
        for (int g = 0; g < shape.groups; g++) {
            gather(states.contexts.begin(), question.contexts + 4 * g, probabilities[g], rates[g]);
            inputs[g] = (inputs_of(probabilities[g]) ^ question.opposed[g]) - question.opposed[g];
        }
        inputs[shape.groups] = question.numbers;

        const auto lanes = static_cast<size_t>(8 * shape.groups + 8);
        I32x4 totals[Shape::most_rows] = {};
        for (int j = 0; j < shape.neurons; j++) {
            weights[j] = states.weights.begin() + static_cast<size_t>(question.neurons[j]) * lanes;
            I32x4 total = multiply_pairs(load<I16x8>(weights[j]), inputs[0]);
            for (int i = 1; i <= shape.groups; i++)
                total = add32(total, multiply_pairs(load<I16x8>(weights[j] + 8 * i), inputs[i]));
            totals[j] = total;
        }
        I32x4 first = sums(totals[0], totals[1], totals[2], totals[3]) >> 14;
        I32x4 second = splat32(0);
        if constexpr (Shape::most_rows > 4)
            if (shape.neurons > 4) second = sums(totals[4], totals[5], totals[6], totals[7]) >> 14;
        opinions = greatest(least(pack(first, second), splat16(2047)), splat16(-2047));

        final_weights = states.final_weights.block(static_cast<size_t>(question.final_neuron) * 8, 8);
        int total = sum(multiply_pairs(load<I16x8>(final_weights), opinions)) >> 14;
        total = total < -2047 ? -2047 : total > 2047 ? 2047 : total;
        probability = LOGISTIC.squash[static_cast<size_t>(total + 2048)];
    }

    MESHTIDE_INLINE void learn(const Shape& shape, const MixerKnown& states, const MixerQuestion<Shape>& question,
                               int bit) const {
        int target = bit << 16;
        I16x8 final_row = load<I16x8>(final_weights);
        store(final_weights,
              add_saturated(final_row, multiply_rounded(opinions, splat16((target - probability + 32) >> 6))));
        for (int j = 0; j < shape.neurons; j++) {
            int error = target - LOGISTIC.squash[static_cast<size_t>(opinions[j] + 2048)];
            I16x8 scaled = splat16((error + (1 << (shape.rate - 1))) >> shape.rate);
            for (int i = 0; i <= shape.groups; i++) {
                int16_t* row = weights[j] + 8 * i;
                store(row, add_saturated(load<I16x8>(row), multiply_rounded(inputs[i], scaled)));
            }
        }
        for (int g = 0; g < shape.groups; g++) {
            I16x8 mask = splat16(-bit) ^ question.opposed[g];
            I16x8 distance = probabilities[g] ^ mask;
            distance = distance - multiply_high(distance, rates[g]);
            I16x8 next = rates[g] - multiply_high(rates[g], rates[g]);
            scatter(states.contexts.begin(), question.contexts + 4 * g, distance ^ mask, greatest(next, RATE_FLOORS));
        }
    }
};

} // namespace detail

// Decisions that are asked at once, the bit of question k being bit k. All are predicted before any of them is coded,
// so that a processor has as many to work on as there are questions; then they learn, one after the other.
template <class Shape, class Coder>
MESHTIDE_ONCE int mix(Coder& coder, const Shape shape, const MixerKnown& states, const MixerQuestion<Shape>* questions,
                      int bits) {
    // Four places at a time: one that is negative, or more than the last one, makes a sign.
    I32x4 wrong = splat32(0), last_context = splat32(states.last_context), last_neuron = splat32(states.last_neuron);
    auto check = [&wrong](const uint32_t* from, I32x4 last) {
        I32x4 places = load<I32x4>(from);
        wrong |= places | (last - places);
    };
    for (int k = 0; k < shape.questions; k++) {
        for (int i = 0; i < 4 * shape.groups; i += 4) check(questions[k].contexts + i, last_context);
        for (int i = 0; i < Shape::most_rows; i += 4) check(questions[k].neurons + i, last_neuron);
    }
    if (signs(wrong) != 0) [[unlikely]]
        fail_access();
    detail::Prediction<Shape> predictions[Shape::most_questions];
    for (int k = 0; k < shape.questions; k++) predictions[k].predict(shape, states, questions[k]);
    int coded = 0;
    for (int k = 0; k < shape.questions; k++) {
        int bit = bits >> k & 1;
        if constexpr (requires { coder.watch(*states.contexts.begin(), bit); })
            for (int i = 0; i < 4 * shape.groups; i++)
                coder.watch(states.contexts[questions[k].contexts[i]], bit ^ (questions[k].opposed[i / 4][i % 4] & 1));
        coded |= coder.code(static_cast<uint32_t>(predictions[k].probability), bit) << k;
    }
    for (int k = 0; k < shape.questions; k++) predictions[k].learn(shape, states, questions[k], coded >> k & 1);
    return coded;
}

template <class Shape>
class MixerOf : public Shape {
#ifdef __wasm__
    using Told = AnyShape;
#else
    using Told = Shape;
#endif

public:
    static constexpr auto neuron_count = Shape::neurons;
    using Question = MixerQuestion<Told>;

    explicit MixerOf(MixerStates states)
        : states_{states, static_cast<int32_t>(states.contexts.size()) - 1,
                  static_cast<int32_t>(states.weights.size() / static_cast<size_t>(Shape::lanes)) - 1} {}

    template <class Coder>
    MESHTIDE_INLINE int code(Coder& coder, const Question* asked, int bits) const {
        if constexpr (std::is_same_v<Told, Shape>)
            return mix(coder, Shape{}, states_, asked, bits);
        else
            return mix(coder, Told{Shape::groups, Shape::neurons, Shape::rate, Shape::questions}, states_, asked, bits);
    }
    // Where one is asked at once.
    template <class Coder>
    MESHTIDE_INLINE int code(Coder& coder, const Question& question, int bit = 0) const {
        return code(coder, &question, bit);
    }

private:
    MixerKnown states_;
};

template <int Groups, int Neurons, int Rate, int Questions = 1>
using Mixer = MixerOf<FixedShape<Groups, Neurons, Rate, Questions>>;

namespace detail {

template <Effort effort, class Standard, class High>
struct EffortShape {
    using Shape = EitherShape<Standard, High>;
};
template <class Standard, class High>
struct EffortShape<Effort::standard, Standard, High> {
    using Shape = Standard;
};
template <class Standard, class High>
struct EffortShape<Effort::high, Standard, High> {
    using Shape = High;
};

} // namespace detail

// The mixer of an effort, by the shapes of both.
template <Effort effort, class Standard, class High>
using EffortMixer = MixerOf<typename detail::EffortShape<effort, Standard, High>::Shape>;

} // namespace meshtide::inline MESHTIDE_ISA
