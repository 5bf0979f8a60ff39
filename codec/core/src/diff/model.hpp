// The contexts and the mixer of the Diff layer.
#pragma once

#include "base/effort.hpp"
#include "entropy/mixing.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// How many places each context has, and how many neurons there are of each kind; see questions.hpp.
template <Effort effort>
struct DiffShape {
    static constexpr bool high = effort == Effort::high;
    static constexpr int groups = high ? 4 : 2, contexts = 4 * groups, neurons = high ? 8 : 5;
    static constexpr int JOINT_PLACES = 4 * 4 * 7 * 8 * 5;
    static constexpr int context_sizes[16] = {
        12 * 10 * 2 * 6, 5 * 4 * 3 * 4 * 2, 10 * 8 * 3 * 3 * 5, JOINT_PLACES + 8 * 9 * 2, // plane, alignment, across
        16 * 8 * 4 * 4,  12 * 9 * 8 * 8,    3 * 3 * 16 * 8,     16 * 7 * 7,               // midpoint, ring
        24 * 4 * 24,     12 * 9 * 9 * 4,    5 * 5 * 3 * 3 * 4,  16 * 9 * 9,               // surface
        16 * 8 * 4 * 4,  12 * 9 * 8 * 8,    16 * 8 * 4 * 4,     12 * 9 * 4 * 4,           // pairs, ring, far mean
    };
    static constexpr int neuron_sizes[8] = {3 * 8 * 3, 24 * 4, 9 * 3 * 3, 8 * 8, 16 * 3, 24 * 4, 8 * 8, 5 * 5 * 3};

    static constexpr int sum(const int* sizes, int count) { return count == 0 ? 0 : sizes[0] + sum(sizes + 1, count - 1); }
    static constexpr int first_place(int context) { return sum(context_sizes, context); }
    static constexpr int first_neuron(int kind) { return sum(neuron_sizes, kind); }
    static constexpr size_t context_count = static_cast<size_t>(sum(context_sizes, contexts));
    static constexpr size_t neuron_count = static_cast<size_t>(sum(neuron_sizes, neurons));
    static constexpr size_t final_neuron_count = 3 * 8;
};

// What training has left, a byte each.
struct DiffTraining {
    Span<const uint8_t> contexts;      // 0: never met; else 1 + 2 * (log-odds + 7), in steps of 1 in -7..7, and 1 more
                                       // if many meshes agree on it
    Span<const int8_t> weights;        // 1.0 is 16
    Span<const int8_t> final_weights;  // 1.0 is 64
};

template <Effort effort>
struct DiffModel {
    using Shape = DiffShape<effort>;
    using DiffMixer = Mixer<Shape::groups, Shape::neurons, 4>;

    // As it stands before the first bit plane of a slice.
    DiffModel(Budget& budget, const DiffTraining& training)
        : contexts(budget), weights(budget), final_weights(budget) {
        contexts.assign(Shape::context_count, Context{});
        weights.resize(Shape::neuron_count * DiffMixer::lanes);
        final_weights.resize(Shape::final_neuron_count * 8);
        for (size_t i = 0; i < contexts.size(); i++) {
            int state = training.contexts[i];
            if (state == 0) continue;
            int odds = (state - 1) / 2 - 7;
            expect(odds <= 7, "a trained state that is none");
            Context& context = contexts[i];
            context.slow = context.fast = LOGISTIC.squash[static_cast<size_t>(2048 + 256 * odds)];
            context.slow_rate = context.fast_rate = (state & 1) != 0 ? UNSURE_RATE : SURE_RATE;
        }
        for (size_t i = 0; i < weights.size(); i++)
            weights[i] = static_cast<int16_t>(training.weights[i] * (WEIGHT_ONE / 16));
        for (size_t i = 0; i < final_weights.size(); i++)
            final_weights[i] = static_cast<int16_t>(training.final_weights[i] * (WEIGHT_ONE / 64));
    }

    MixerStates states() { return {contexts.span(), weights.span(), final_weights.span()}; }

    Array<Context> contexts;
    Array<int16_t> weights, final_weights;

private:
    // As if they had seen 1 decision, and 14.
    static constexpr uint16_t UNSURE_RATE = 65536 / 3, SURE_RATE = 65536 / 16;
};

} // namespace meshtide::inline MESHTIDE_ISA
